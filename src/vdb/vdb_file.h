#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "brick/seams.h"
#include "refine/refine.h"
#include "tessera/execution.h"
#include "vdb/brick_statistics.h"

namespace tessera {

enum class VdbLayout { levels, flat };

/// How the mesh's axes become the file's: `y` makes the mesh's z axis the file's y axis, (x, z, -y); `z`
/// makes the mesh's y axis the file's z axis, (x, -z, y). Grid transforms and vector values turn; voxel
/// indices don't.
enum class UpAxis { keep, y, z };

/// How one field of the mesh is named and laid out in channels of the store.
struct OutputField {
    std::string name;        ///< grid name
    std::string sourceName;  ///< field in the mesh
    std::string location;    ///< "point" or "cell"
    int components = 1;
    int firstChannel = 0;
};

struct VdbWriteOptions {
    VdbLayout layout = VdbLayout::levels;
    bool halfFloat = false;
    float background = 0;
    UpAxis upAxis = UpAxis::keep;
    /// file units per world unit; 0: 1, or a power of ten when voxels would be too small for OpenVDB
    double unitScale = 0;
    /// the file's transforms place voxel i where lattice point i + voxelShift is, on each axis
    double voxelShift = 0;
    std::optional<Box3d> boundsWorld;  ///< the box that the tree was made for, RefineOptions::boundsWorld
    int layers = 0;                    ///< of the store's extension
    bool brickStatistics = false;      ///< levels: the file has BrickStatistics
    std::optional<float> hiddenValue;  ///< .vti: of points that nothing is stored for; see writeVti
    std::int64_t maxVoxels = 0;        ///< .vti: points that the image may have; 0: kDefaultImagePoints
    std::string algorithm, criterion, sourceFile;
    std::string target;          ///< the device, of algorithms whose results depend on it; else empty
    std::string sampleFormat;    ///< what values were kept in while sampling; empty: 32-bit floats
    std::string repair;          ///< how the mesh was repaired before, as JSON; empty: it wasn't
    std::optional<double> time;  ///< of the step, in the series' own unit
};

/// What was written.
struct VdbWriteResult {
    std::int64_t activeVoxels = 0;  ///< of all grids; of a .vti file the points that a value is stored for
    std::int64_t fileBytes = 0;
    double unitScale = 1;
    std::vector<std::string> notes;  ///< sentences for the user: unit chosen, places rounded
};

/// A file read back.
struct VdbFile {
    /// of the store: the bricks, or in the flat layout the grid cut into bricks of one level
    BrickTree tree;
    BrickStore store;                 ///< samples and extension
    std::optional<BrickTree> bricks;  ///< flat: the bricks that the grid was made of
    std::vector<OutputField> fields;
    ErrorReport report;                        ///< as stated in the file: what its voxels show
    std::optional<ErrorReport> samplesReport;  ///< what the samples showed before, where that differs
    std::optional<BrickStatistics> statistics;
    int layers = 0;  ///< of the extension
    VdbLayout layout = VdbLayout::levels;
    std::string version, sourceFile, algorithm, criterion;
    std::string target, sampleFormat, repair;  ///< as in VdbWriteOptions
    std::optional<double> time;                ///< as in VdbWriteOptions
    double unitScale = 1;
    UpAxis upAxis = UpAxis::keep;
    double voxelShift = 0;   ///< as in VdbWriteOptions; `tree` has the places of the samples themselves
    bool halfFloat = false;  ///< values were rounded to half floats
    std::optional<Box3d> boundsWorld;  ///< the box that was asked for: no error was measured outside it
    float background = 0;
    int flatLevel = 0;  ///< flat: of `bricks`, the level whose spacing the grids have
    std::vector<std::string> gridNames;
    std::vector<std::int64_t> gridVoxels;   ///< active voxels, one a grid
    std::int64_t strayValues = 0;           ///< inactive voxels that hold something else than the background
    std::vector<std::string> gridProblems;  ///< sentences: grids whose place or background aren't the file's
};

}  // namespace tessera
