#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "brick/brick_tree.h"
#include "refine/mesh_bricks.h"
#include "refine/refine_options.h"
#include "refine/wish_plan.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// What a plan would cost, before sampling.
struct PlanEstimate {
    std::int64_t storedPoints = 0;  ///< leaves x B^3
    std::vector<std::int64_t> bricksPerLevel;
    std::int64_t levelsBytes = 0;  ///< samples of all chosen fields, --layout levels
    std::int64_t flatPoints = 0;   ///< points of the same volume at the finest spacing
    std::int64_t flatBytes = 0;
};

/// The chosen leaf bricks. Throws InputError when the smallest sensible plan exceeds maxVoxels or
/// maxMemoryBytes (the message says what would fit); a plan around focuses then leaves out what is worth
/// least. Error-driven refinement samples as it goes, see refineAndResample.
/// @param channels components of all fields that will be sampled: what a point costs.
/// @param notes when not null, receives sentences for the user (a plan coarsened to keep a default bound).
BrickTree planBricks(const TetMesh& mesh, const RefineOptions& options, const Execution& execution,
                     int channels = 1, std::vector<std::string>* notes = nullptr);

/// A plan by the sizes of elements and focuses, as far as the options ask for them.
struct WishPlanning {
    /// Throws InputError when the coarsest bricks are more than maxLeaves.
    WishPlanning(const TetMesh& mesh, const Box3d& meshBoundsWorld, const RefineOptions& options,
                 std::size_t maxLeaves, const Execution& execution);
    MeshBricks bricks;
    WishPlan plan;
};

PlanEstimate estimatePlan(const BrickTree& tree, int channels);

}  // namespace tessera
