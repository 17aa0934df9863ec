#pragma once

#include <array>

#include "tessera/mesh.h"

namespace tessera {

/// How far below its own first lattice point, in voxels of its level, a brick still counts as touched: more
/// than any resampler spills (2^-8), so the owner of every covered lattice point exists.
inline constexpr double kBrickSlackVoxels = 1.0 / 128;

/// Shadows on an axis that lie apart by less than this, of what they are computed from, count as touching:
/// more than all rounding.
inline constexpr double kShadowTolerance = 1e-12;

/// A closed element and half-open boxes [min, max) in one space.
class ElementOverlap {
  public:
    explicit ElementOverlap(const std::array<Vec3d, 4>& nodes);
    const std::array<Vec3d, 4>& nodes() const { return nodes_; }
    const Box3d& bounds() const { return bounds_; }
    /// The element's bounding box meets the box (min inclusive, max exclusive).
    bool boundsTouch(const Box3d& box) const {
        return bounds_.min.x < box.max.x && bounds_.min.y < box.max.y && bounds_.min.z < box.max.z &&
               bounds_.max.x >= box.min.x && bounds_.max.y >= box.min.y && bounds_.max.z >= box.min.z;
    }
    /// Separating axes of the faces and of the edge pairs, on top of boundsTouch. Rounding never separates
    /// what touches.
    bool touches(const Box3d& box) const;
    /// The point lies inside the element. Rounding may deny that, but never claims it.
    bool holds(const Vec3d& point) const;

  private:
    std::array<Vec3d, 4> nodes_;
    Box3d bounds_;
};

/// Nodes of an element in index space of a spacing.
std::array<Vec3d, 4> elementInIndexSpace(const TetMesh& mesh, std::int64_t element, const Vec3d& originWorld,
                                         double spacingWorld);

/// Asks for an element's nodes ahead of their use: elements reach nodes in no order, and waiting for them is
/// most of what a pass over elements costs.
inline void prefetchNodes(const TetMesh& mesh, std::int64_t element) {
    for (const std::int32_t node : mesh.tets[std::size_t(element)])
        __builtin_prefetch(&mesh.points[std::size_t(node)]);
}
inline constexpr std::int64_t kPrefetchElements = 16;  ///< how far ahead

}  // namespace tessera
