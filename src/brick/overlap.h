#pragma once

#include <array>

#include "mesh/tet_mesh.h"

namespace tessera {

/// How far below its own first lattice point, in voxels of its level, a brick still counts as touched: more
/// than any resampler spills (2^-8), so the owner of every covered lattice point exists.
inline constexpr double kBrickSlackVoxels = 1.0 / 128;

/// A closed element and half-open boxes [min, max) in one space.
class ElementOverlap {
  public:
    explicit ElementOverlap(const std::array<Vec3d, 4>& nodes);
    const Box3d& bounds() const { return bounds_; }
    /// The element's bounding box meets the box (min inclusive, max exclusive).
    bool boundsTouch(const Box3d& box) const {
        return bounds_.min.x < box.max.x && bounds_.min.y < box.max.y && bounds_.min.z < box.max.z &&
               bounds_.max.x >= box.min.x && bounds_.max.y >= box.min.y && bounds_.max.z >= box.min.z;
    }
    /// Separating axes of the faces and of the edge pairs, on top of boundsTouch. Rounding never separates
    /// what touches.
    bool touches(const Box3d& box) const;

  private:
    std::array<Vec3d, 4> nodes_;
    Box3d bounds_;
};

}  // namespace tessera
