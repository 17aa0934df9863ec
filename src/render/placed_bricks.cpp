#include "render/placed_bricks.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/parallel.h"

namespace tessera {

double BrickFrame::spacingWorld(Depth depth) const {
    return std::ldexp(rootSpacingWorld, -depth.halvings());
}

Box3d BrickFrame::boxWorld(const DepthKey& key) const {
    const double edge = spacingWorld(key.depth) * cells;
    return {originWorld + Vec3d(key.index) * edge, originWorld + Vec3d(key.index + 1) * edge};
}

std::vector<PlacedBrick> placeBricks(const PoolTarget& target, std::span<const GrowingLeaf> leaves,
                                     int channel, const Execution& execution) {
    const ShownBricks& bricks = target.bricks();
    std::vector<PlacedBrick> placed(leaves.size());
    parallelFor(execution, std::int64_t(leaves.size()), [&](std::int64_t i) {
        const GrowingLeaf& leaf = leaves[std::size_t(i)];
        PlacedBrick& brick = placed[std::size_t(i)];
        const auto slot = target.slotOf(leaf);
        TESSERA_CHECK(slot.has_value(), "a brick that the pool doesn't show");
        brick.key = leaf.key;
        brick.slot = *slot;
        brick.isWhole = true;
        const PointValues points = bricks.valuesAt(leaf, bricks.closedPoints(leaf.key));
        const auto channels = std::size_t(bricks.channels());
        for (std::size_t p = 0; p < points.covered.size(); ++p) {
            const double value = points.values[p * channels + std::size_t(channel)];
            const bool isCovered = points.covered[p] != 0, isFinite = std::isfinite(value);
            brick.isCovered = brick.isCovered || isCovered;
            brick.isWhole = brick.isWhole && isCovered && isFinite;
            if (!isFinite) continue;
            brick.range.min = std::min(brick.range.min, value);
            brick.range.max = std::max(brick.range.max, value);
        }
    });
    return placed;
}

}  // namespace tessera
