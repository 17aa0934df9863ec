#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "brick/seams.h"
#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

/// The finest level at which the bricks hold at most `maxPoints` points.
int chooseFlatLevel(const BrickTree& tree, std::int64_t maxPoints);
/// Points of all bricks at the spacing of one level.
double flatPointCount(const BrickTree& tree, int level);

/// Bricks of one level: what trilinear interpolation of one grid reads.
struct FlatBricks {
    BrickTree tree;
    BrickStore store;
};

/// Tells which points of a level lie in the mesh: calls the sink for every box.
using CoverageSource =
    std::function<void(const Lattice& lattice, std::span<const IndexBox> boxes, const BlockSink& sink)>;

struct FlattenOptions {
    int level = 0;                     ///< of the tree: the spacing of the result
    std::optional<Box3d> boundsWorld;  ///< only the points that reading inside this box needs
    int layers = 0;                    ///< of the extension
};

/// Samples the reconstruction of bricks of several levels on the lattice of one, so that trilinear
/// interpolation there equals it (where the level isn't coarser than the bricks are). Every point holds the
/// value that the reconstruction has there, exact samples where the bricks are as fine or finer; coverage is
/// that of the mesh. The result's level 0 is `options.level`.
/// @param store samples of `tree`. When all bricks have the level already they move to the result.
/// @param coverage is asked about the points inside coarser bricks.
FlatBricks flatten(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree, BrickStore& store,
                   const NearestOnDemand& nearest, const CoverageSource& coverage,
                   const FlattenOptions& options, const Execution& execution);

/// The bricks of some size that hold a covered or an extended point.
BrickTree treeOfPoints(const BrickTree& tree, const BrickStore& store);

}  // namespace tessera
