#include "brick/closed_coverage.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "brick/leaf_tiles.h"

namespace tessera {

namespace {

bool ownsNoGap(const BrickStore& store, std::size_t leaf) {
    for (int t = 0; t < store.tileCount(); ++t) {
        const Tile* tile = store.tile(leaf, t);
        if (!tile) return false;
        for (const std::uint64_t word : tile->coverage)
            if (word != ~std::uint64_t(0)) return false;
    }
    return true;
}

// The leaf itself and the next ones of its level, which own the points on the + sides; -1: none.
std::array<std::int64_t, 8> ownersOf(const BrickTree& tree, std::size_t leaf) {
    const BrickKey& key = tree.leaves()[leaf];
    std::array<std::int64_t, 8> owners;
    for (int side = 0; side < 8; ++side)
        owners[std::size_t(side)] = tree.findLeaf({key.level, key.index + cornerOffset(side)});
    return owners;
}

}  // namespace

ClosedCoverage::ClosedCoverage(const BrickTree& tree, const BrickStore& store,
                               const Reconstruction& reconstruction, const Execution& execution)
    : tree_(tree), store_(store), reconstruction_(reconstruction), isFull_(tree.leafCount()) {
    parallelFor(execution, std::int64_t(isFull_.size()), [&](std::int64_t leaf) {
        isFull_[std::size_t(leaf)] = ownsNoGap(store_, std::size_t(leaf));
    });
}

bool ClosedCoverage::isSurelyWhole(std::size_t leaf) const {
    for (const std::int64_t owner : ownersOf(tree_, leaf))
        if (owner < 0 || !isFull_[std::size_t(owner)]) return false;
    return !hasCoarserNeighbour(tree_, leaf);
}

std::vector<std::uint8_t> ClosedCoverage::of(std::size_t leaf) const {
    const BrickKey& key = tree_.leaves()[leaf];
    const int b = tree_.brickCells(), edge = b + 1;
    const Vec3i first = tree_.ownedPoints(key).min;
    const std::array<std::int64_t, 8> owners = ownersOf(tree_, leaf);
    const bool coarserNear = hasCoarserNeighbour(tree_, leaf);
    std::vector<std::uint8_t> covered;
    covered.reserve(std::size_t(edge) * std::size_t(edge) * std::size_t(edge));
    for (int z = 0; z < edge; ++z)
        for (int y = 0; y < edge; ++y)
            for (int x = 0; x < edge; ++x) {
                const Vec3i local(x, y, z), next(x == b, y == b, z == b);
                const std::int64_t owner = owners[std::size_t(next.x | next.y << 1 | next.z << 2)];
                const bool onBorder = x == 0 || y == 0 || z == 0 || x == b || y == b || z == b;
                bool isCovered = false;
                if (owner >= 0 && !(onBorder && coarserNear))
                    store_.value(std::size_t(owner), local - next * b, 0, isCovered);
                else
                    isCovered = reconstruction_.isCovered(key.level, first + local);
                covered.push_back(isCovered);
            }
    return covered;
}

}  // namespace tessera
