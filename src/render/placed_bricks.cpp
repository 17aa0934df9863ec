#include "render/placed_bricks.h"

#include <cmath>

namespace tessera {

double BrickFrame::spacingWorld(Depth depth) const {
    return std::ldexp(rootSpacingWorld, -depth.halvings());
}

Box3d BrickFrame::boxWorld(const DepthKey& key) const {
    const double edge = spacingWorld(key.depth) * cells;
    return {originWorld + Vec3d(key.index) * edge, originWorld + Vec3d(key.index + 1) * edge};
}

std::vector<PlacedBrick> placeBricks(const PoolTarget& target, int channel) {
    std::vector<PlacedBrick> placed;
    for (const BrickInPool* brick : target.shown()) {
        const BrickInPool::Channel& of = brick->channels[std::size_t(channel)];
        placed.push_back(
            {brick->key, brick->slot, of.range, brick->isCovered, brick->isWhole && of.isFinite});
    }
    return placed;
}

}  // namespace tessera
