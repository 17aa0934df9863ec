#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "refine/refine.h"
#include "refine/refine_options.h"
#include "tessera/vec.h"
#include "vdb/output_formats.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// How mesh files are read, as typed.
struct ReaderArguments {
    std::string kind = "isolated", maxMemory;  ///< maxMemory: empty for a bound from the file's size
    std::optional<double> maxSeconds;
    bool memoryBoundsRun = false;  ///< the command keeps to maxMemory after reading too
};

/// Options of every subcommand.
struct CommonOptions {
    int threads = 0;  ///< 0: one for every processor
    bool quiet = false;
    bool strict = false;   ///< a result that isn't what was asked for is an exit code of its own
    std::string jsonPath;  ///< empty: no report; "-": standard output
    ReaderArguments reader;
};

/// One entry of --field: a field of the mesh and the name of its grid.
struct FieldChoice {
    std::string source;
    std::string name;
    bool named = false;  ///< the name was given
};

/// The resampler and what it runs with, as typed.
struct AlgorithmArguments {
    std::string name = "software";
    std::string gl;  ///< empty: the first that can be had
    std::string sampleFormat = "r32f";
};

/// --repair and what belongs to it, as typed.
struct RepairArguments {
    bool repair = false;
    std::optional<double> aspect, angle;
    std::string maxVolumeLoss;  ///< empty: the default
};

/// The words of `tessera resample`, as typed.
struct ResampleArguments {
    CommonOptions common;
    std::vector<std::string> inputs;  ///< meshes, patterns, or a .pvd file
    std::string output, times;        ///< times: "a:b"; empty: all
    std::string format;               ///< of standard output; empty: the default
    std::string refine = "element-size", errorMeasure = "max";
    std::string program;  ///< of --for; empty: none
    std::string layout;   ///< empty: levels where the output's format can hold them, else flat
    std::string upAxis;   ///< empty until settleProgram: not given
    std::optional<double> voxelShift;
    AlgorithmArguments algorithm;
    RepairArguments repair;
    std::optional<int> resolution, maxLevels;
    std::optional<double> spacing;
    std::optional<std::string> maxError;
    double samplesPerElement = 2;
    int brickSize = 16;
    std::optional<int> extendLayers;   ///< not given: 1 for the flat layout, 0 for levels
    std::optional<double> background;  ///< not given: 0, in a .vti file what writeVti says
    std::optional<double> unitScale;   ///< not given: 1, or a power of ten when voxels are tiny
    int timeStep = -1;
    std::string fields, errorFields, bounds, like, maxVoxels;
    bool half = false;
    bool dryRun = false;
};

/// The same, checked and converted; what depends on the mesh (field indices) is still missing.
struct ResampleSettings {
    RefineOptions refine;
    const OutputFormat* format = nullptr;  ///< of the output
    VdbWriteOptions write;
    OutputShape shape;
    std::vector<FieldChoice> fields;       ///< empty: all
    std::vector<std::string> errorFields;  ///< empty: all chosen point fields
};

/// For commands that were given no mesh to read: throws InputError when there are bounds on reading one.
/// @param why "out.vdb is no mesh".
void refuseReaderBounds(const ReaderArguments& arguments, const std::string& why);

BindOptions bindOptions(const AlgorithmArguments& arguments);
/// The format's name when it isn't r32f, which loses nothing; else empty.
std::string lossyFormat(const BindOptions& options);

/// Throws InputError naming the option, what was expected and what came.
ResampleSettings checkedSettings(const ResampleArguments& arguments);

/// "4096", "64K", "1.5M", "2G", "1T"; decimal multiples unless `binary`. Throws InputError naming `option`.
std::int64_t parseCount(const std::string& option, const std::string& text, bool binary);
/// "a,b=newname". Throws InputError for empty or repeated names.
std::vector<FieldChoice> parseFields(const std::string& text);
/// `count` finite numbers with commas between them. Throws InputError naming `option`.
std::vector<double> parseNumbers(const std::string& option, const std::string& text, std::size_t count);
/// "a,b" with a < b. Throws InputError naming `option`.
std::array<double, 2> parseRange(const std::string& option, const std::string& text);
/// "x,y,z". Throws InputError naming `option`.
Vec3d parseVector(const std::string& option, const std::string& text);
/// "x0,y0,z0,x1,y1,z1". Throws InputError.
Box3d parseBounds(const std::string& text);

}  // namespace tessera
