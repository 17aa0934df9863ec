#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "gl/gl_trial.h"
#include "job/field_selection.h"
#include "job/program_presets.h"
#include "job/resample_request.h"
#include "mesh/repair.h"
#include "tessera/vec.h"

namespace tessera {

/// How mesh files are read, as typed.
struct ReaderArguments {
    std::string kind = "isolated", maxMemory;  ///< maxMemory: empty for a bound from the file's size
    std::optional<double> maxSeconds;
    bool followsLinks = false;
    bool memoryBoundsRun = false;  ///< the command keeps to maxMemory after reading too
};

/// Options of every subcommand.
struct CommonOptions {
    int threads = 0;  ///< 0: one for every processor
    bool quiet = false;
    bool strict = false;   ///< a result that isn't what was asked for is an exit code of its own
    std::string jsonPath;  ///< empty: no report; "-": standard output
    ReaderArguments reader;
    double maxDriverSeconds = GlTrial().seconds;  ///< that drivers of OpenGL may take to answer
};

/// The resampler and what it runs with, as typed.
struct AlgorithmArguments {
    std::string name = "software";
    std::string gl;  ///< empty: the first that can be had
    std::string sampleFormat = "r32f";
    std::string primitives = "device";
};

/// --repair and what belongs to it, as typed.
struct RepairArguments {
    bool repair = false;
    std::optional<double> aspect, angle;
    std::string maxVolumeLoss;  ///< empty: the default
};

/// What was typed behind `tessera resample`: words that are still to be parsed, and what is taken as it is.
struct ResampleArguments {
    CommonOptions common;
    AlgorithmArguments algorithm;
    RepairArguments repair;
    ProgramChoices file;
    std::string format;  ///< of standard output; empty: the default
    std::string refine = "element-size", errorMeasure = "max";
    std::vector<std::string> focus;  ///< "x,y,z" each
    std::string transferFunction;    ///< a file
    std::vector<double> radius;      ///< one for each focus, or one for all
    std::string times;               ///< "a:b"; empty: all
    std::string fields, errorFields, bounds, maxVoxels;
    std::optional<int> resolution, maxLevels;
    std::optional<double> spacing;
    std::optional<std::string> maxError;
    std::optional<double> background;  ///< not given: 0, in a .vti file what writeVti says
    std::optional<double> unitScale;   ///< not given: 1, or a power of ten when voxels are tiny
    ResampleRequest request;
};

BindOptions bindOptions(const AlgorithmArguments& arguments);
/// None without --repair. Throws InputError for values out of range.
std::optional<RepairOptions> repairOptions(const RepairArguments& arguments);

/// Throws InputError naming the option, what was expected and what came.
ResampleRequest resampleRequest(const ResampleArguments& arguments);

/// "4096", "64K", "1.5M", "2G", "1T"; decimal multiples unless `binary`. Throws InputError naming `option`.
std::int64_t parseCount(const std::string& option, const std::string& text, bool binary);
/// "a,b=newname". Throws InputError for empty or repeated names.
std::vector<FieldChoice> parseFields(const std::string& text);
/// `count` finite numbers with commas between them. Throws InputError naming `option`.
std::vector<double> parseNumbers(const std::string& option, const std::string& text, std::size_t count);
/// "a,b" with a < b. Throws InputError naming `option`.
std::array<double, 2> parseRange(const std::string& option, const std::string& text);
/// "1920x1080", from 1 to 32768 each. Throws InputError naming `option`.
std::array<int, 2> parsePictureSize(const std::string& option, const std::string& text);
/// "x,y,z". Throws InputError naming `option`.
Vec3d parseVector(const std::string& option, const std::string& text);
/// "x0,y0,z0,x1,y1,z1". Throws InputError.
Box3d parseBounds(const std::string& text);

}  // namespace tessera
