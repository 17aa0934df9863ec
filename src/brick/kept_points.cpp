#include "brick/kept_points.h"

#include <cmath>

namespace tessera {

KeptPoints::KeptPoints(const std::optional<Box3d>& boundsWorld, const Vec3d& originWorld, double spacingWorld,
                       int levelCount)
    : levelCount_(levelCount) {
    // A side of the box that rounding puts just beside a lattice plane lies on it: within less than what
    // locateInBrick takes for rounding. One shift for all levels keeps their points nested: what a finer one
    // is interpolated from is kept too.
    constexpr double kOnPlane = 1.0 / (std::int64_t(1) << 31);
    if (boundsWorld)
        bounds_ = Box3d{(boundsWorld->min - originWorld) / spacingWorld + kOnPlane,
                        (boundsWorld->max - originWorld) / spacingWorld - kOnPlane};
}

IndexBox KeptPoints::corners(int level) const {
    constexpr double kFar = 1 << 30;  // beyond all lattice points
    if (!bounds_) return {Vec3i(-int(kFar)), Vec3i(int(kFar))};
    const double scale = std::ldexp(1.0, -level);
    const Vec3d low = glm::clamp(glm::floor(bounds_->min * scale), Vec3d(-kFar), Vec3d(kFar));
    const Vec3d high = glm::clamp(glm::ceil(bounds_->max * scale), Vec3d(-kFar), Vec3d(kFar));
    return {Vec3i(low), Vec3i(high) + 1};
}

IndexBox KeptPoints::range(int level) const {
    const IndexBox own = corners(level);
    if (!bounds_ || level + 1 >= levelCount_) return own;
    const IndexBox coarse = corners(level + 1);
    return {glm::min(own.min, coarse.min * 2), glm::max(own.max, (coarse.max - 1) * 2 + 1)};
}

void cropToKept(const BrickTree& tree, const KeptPoints& kept, BrickStore& store) {
    if (kept.all()) return;
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        const BrickKey& key = tree.leaves()[leaf];
        const IndexBox owned = tree.ownedPoints(key);
        if (intersect(owned, kept.corners(key.level)) == owned) continue;
        store.crop(leaf, [&](const Vec3i& local) { return kept.keeps(key.level, owned.min + local); });
    }
}

}  // namespace tessera
