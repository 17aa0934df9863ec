#pragma once

#include <optional>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"

namespace tessera {

/// The lattice points that trilinear reading inside a box can need, level by level. Without a box: all.
class KeptPoints {
  public:
    KeptPoints() = default;
    /// @param spacingWorld of level 0. @param levelCount levels from 0 on that have bricks.
    KeptPoints(const std::optional<Box3d>& boundsWorld, const Vec3d& originWorld, double spacingWorld,
               int levelCount);

    bool all() const { return !bounds_; }
    /// Corners of the cells of a level that the box meets. A side within 2^-31 voxels of a lattice plane lies
    /// on it.
    IndexBox corners(int level) const;
    /// Box of all points kept of a level.
    IndexBox range(int level) const;
    /// Corners, and those of the level above where a finer brick owns them.
    bool keeps(int level, const Vec3i& p) const {
        if (!bounds_ || corners(level).contains(p)) return true;
        return level + 1 < levelCount_ && !(p.x & 1) && !(p.y & 1) && !(p.z & 1) &&
               corners(level + 1).contains({p.x >> 1, p.y >> 1, p.z >> 1});
    }

  private:
    std::optional<Box3d> bounds_;  // in points of level 0
    int levelCount_ = 0;
};

/// Takes the coverage away at all other points.
void cropToKept(const BrickTree& tree, const KeptPoints& kept, BrickStore& store);

}  // namespace tessera
