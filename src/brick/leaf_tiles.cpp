#include "brick/leaf_tiles.h"

#include <algorithm>

#include "base/parallel.h"

namespace tessera {

namespace {

constexpr std::int64_t kLeafChunk = 64;

}  // namespace

bool hasCoarserNeighbour(const BrickTree& tree, std::size_t leaf) {
    const BrickKey& key = tree.leaves()[leaf];
    if (key.level + 1 >= tree.levelCount()) return false;
    for (int n = 0; n < 27; ++n) {
        const BrickKey near{key.level, key.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)};
        const std::int64_t other = tree.findCovering(near);
        if (other >= 0 && tree.leaves()[std::size_t(other)].level > key.level) return true;
    }
    return false;
}

LeafTiles::LeafTiles(const BrickTree& tree, const BrickStore& store, const Execution& execution)
    : tree_(&tree),
      store_(&store),
      edge_(store.tilesPerEdge() + 1),
      stride_(std::size_t(edge_) * std::size_t(edge_) * std::size_t(edge_)),
      leaves_(tree.leafCount()),
      views_(tree.leafCount() * stride_) {
    const std::int64_t count = std::int64_t(tree.leafCount());
    const auto forLeaves = [&](auto&& body) {
        parallelForChunks(execution, count, kLeafChunk, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) body(std::size_t(i));
        });
    };
    forLeaves([&](std::size_t leaf) { viewOwn(leaf); });
    forLeaves([&](std::size_t leaf) { viewNeighbours(leaf); });
}

void LeafTiles::viewOwn(std::size_t leaf) {
    const int n = store_->tilesPerEdge();
    TileView* views = views_.data() + leaf * stride_;
    for (int t = 0; t < store_->tileCount(); ++t) {
        const Tile* tile = store_->tile(leaf, t);
        if (!tile) continue;
        const bool full = std::all_of(tile->coverage.begin(), tile->coverage.end(),
                                      [](std::uint64_t word) { return word == ~std::uint64_t(0); });
        const int x = t / (n * n), y = t / n % n, z = t % n;
        views[(x * edge_ + y) * edge_ + z] = {tile->values.get(), full ? nullptr : tile->coverage.data()};
    }
}

void LeafTiles::viewNeighbours(std::size_t leaf) {
    const BrickKey& key = tree_->leaves()[leaf];
    const bool coarserNear = hasCoarserNeighbour(*tree_, leaf);
    leaves_[leaf] = {Vec3d(key.index * tree_->brickCells()), 1.0 / tree_->spacingWorld(key.level),
                     coarserNear ? 1 : 0};
    // The border to a coarser leaf holds no stored samples, and may be any: all of it takes the long way.
    if (coarserNear) return;
    const int n = store_->tilesPerEdge();
    TileView* views = views_.data() + leaf * stride_;
    for (int side = 1; side < 8; ++side) {
        const Vec3i step{side & 1, (side >> 1) & 1, side >> 2};
        const std::int64_t other = tree_->findLeaf({key.level, key.index + step});
        if (other < 0) continue;
        const TileView* from = views_.data() + std::size_t(other) * stride_;
        const Vec3i low = step * n, high = low + (1 - step) * (n - 1);
        for (int x = low.x; x <= high.x; ++x)
            for (int y = low.y; y <= high.y; ++y)
                for (int z = low.z; z <= high.z; ++z)
                    views[(x * edge_ + y) * edge_ + z] =
                        from[((x - low.x) * edge_ + (y - low.y)) * edge_ + (z - low.z)];
    }
}

}  // namespace tessera
