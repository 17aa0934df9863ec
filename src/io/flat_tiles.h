#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "base/execution.h"
#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "brick/seams.h"

namespace tessera {

/// 8^3 points ready for a grid, in the order of a Tile.
struct OutputTile {
    Vec3i origin{0};  ///< lattice index of its first point, a multiple of 8
    std::array<std::uint64_t, 8> coverage{};
    std::array<std::uint64_t, 8>
        active{};                    ///< coverage, and points outside the mesh that carry an extended value
    const float* values = nullptr;   ///< channels x 512, channel by channel
    std::unique_ptr<float[]> owned;  ///< holds `values` unless a store does

    const float* channel(int c) const { return values + std::size_t(c) * kTilePoints; }
};

using TileBatchSink = std::function<void(std::span<const OutputTile>)>;

/// The finest level at which the bricks hold at most `maxPoints` points.
int chooseFlatLevel(const BrickTree& tree, std::int64_t maxPoints);
/// Points of all bricks at the spacing of one level.
double flatPointCount(const BrickTree& tree, int level);

/// Gives the points of one level inside all bricks, each tile once, in batches of bounded size, and frees the
/// store's tiles when they are no longer needed. Values are those of the reconstruction, so that trilinear
/// interpolation of the grid equals it: a brick of this level gives its samples (its border to a coarser
/// brick interpolated from that), a coarser one is interpolated, of a finer one every 2^n-th point is taken.
/// A point inside a coarser brick is covered when all points that it is interpolated from are.
/// @param reconstruction may be null when all bricks have this level. @param extension may be null; values
/// that a coarse cell at the mesh's border needs are taken from it, which makes points active but not
/// covered.
void forEachFlatTile(const BrickTree& tree, BrickStore& store, const Reconstruction* reconstruction,
                     const ExtensionPoints* extension, int level, const Execution& execution,
                     const TileBatchSink& sink);

/// The stored tiles of one level as they are, in batches; frees them on the way.
void forEachLevelTile(const BrickTree& tree, BrickStore& store, int level, const Execution& execution,
                      const TileBatchSink& sink);

}  // namespace tessera
