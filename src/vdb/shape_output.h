#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "refine/brick_result.h"
#include "refine/refine.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// What a file is to hold of some samples.
struct OutputShape {
    VdbLayout layout = VdbLayout::levels;
    int layers = 0;           ///< of the extension outside the mesh
    bool halfFloat = false;   ///< round values to half floats where those can hold a grid
    bool leafErrors = false;  ///< measure each leaf's error for BrickResult::leafErrors
    std::optional<Box3d> boundsWorld;
    /// flat: bound on points; 0: 2^26, or none when the bricks have one level
    std::int64_t maxFlatVoxels = 0;
    std::int64_t maxFlatBytes = 0;  ///< flat: bound on the grids' memory; 0: a quarter of the machine's

    /// The mesh's surface stands beside the fields.
    bool hasSurface() const { return layout == VdbLayout::levels && layers > 0; }
};

/// The grid that the flat layout makes of some bricks.
struct FlatGridPlan {
    int level = 0;            ///< the finest one within the bounds of OutputShape
    bool isCapped = false;    ///< the finest bricks are finer
    std::int64_t points = 0;  ///< of all bricks at that level's spacing
    std::int64_t bytes = 0;   ///< values of all channels, and the coverage
    std::string note;         ///< when it is capped, a sentence that says so and why
};
FlatGridPlan planFlatGrid(const BrickTree& tree, int channels, const OutputShape& shape);

/// Makes of a run's samples what the file will hold: one grid for the flat layout, the extension and in the
/// levels layout the surface with it, rounded values. Then measures that, so that the report is the file's;
/// `samplesReport` keeps the samples' own when the file is coarser or less precise.
/// @param outputs one for every field: the grids' names. @param resampler what the samples were made by.
void shapeForFile(const TetMesh& mesh, std::span<const int> fields, const std::vector<OutputField>& outputs,
                  const Resampler& resampler, const BindOptions& bind, const OutputShape& shape,
                  BrickResult& result, const Execution& execution);

}  // namespace tessera
