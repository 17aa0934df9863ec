#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tessera/bricks.h"

namespace tessera {

/// How many grids a file has for a field.
enum class FileLayout {
    /// Levels in a .vdb file, flat in others, which hold nothing else.
    automatic,
    /// One for each level, with exact samples.
    levels,
    /// One, at the finest spacing.
    flat
};

/// Which axis of the file points up. `y`: the mesh's z axis becomes the file's y axis. `z`: the mesh's y axis
/// becomes the file's z axis.
enum class FileAxes { asMesh, y, z };

/// How bricks become a file.
struct OutputOptions {
    FileLayout layout = FileLayout::automatic;
    /// Layers of voxels outside the mesh, so that programs that interpolate see all of it; not given: 1 for
    /// flat, 0 for levels.
    std::optional<int> extend{};
    /// 16-bit floats where they can hold a grid's values.
    bool isHalf = false;
    /// The value of voxels that are not stored; not given: 0.
    std::optional<float> background{};
    FileAxes axes = FileAxes::asMesh;
    /// File units for each world unit; 0: 1, or a power of ten when voxels would be too small for OpenVDB.
    double unitScale = 0;
    /// The file places voxel i where lattice point i + voxelShift is, on each axis.
    double voxelShift = 0;
    /// A field's name -> its name in the file; others keep theirs.
    std::map<std::string, std::string> names{};
};

/// What was written.
struct OutputFile {
    std::int64_t bytes = 0;
    /// Of all grids.
    std::int64_t activeVoxels = 0;
    /// Of what the file's voxels show: they can be coarser or less precise than the samples.
    ErrorReport report;
    /// Criterion::error: that is within the bound; with Criterion::visibility, the samples are. Else true.
    bool isWithinBound = true;
    /// What a user should know, a sentence each: a unit chosen, a grid coarser than the bricks.
    std::vector<std::string> notes;
};

/// Writes bricks with all that they were made of, so that `tessera verify` can check the file against the
/// mesh. The kind of file follows from the name's ending: .vdb, .nvdb or .vti. Nothing stands at `path` until
/// the file is whole. The bricks stay as they are: their samples are copied, unless they are moved in.
///
/// Throws InputError for another ending, options that the kind of file can't follow or names that clash;
/// IoError when the file can't be written; Cancelled.
OutputFile write(Bricks bricks, const std::string& path, const OutputOptions& options = {},
                 const Execution& execution = {});

}  // namespace tessera
