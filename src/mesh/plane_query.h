#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/execution.h"
#include "mesh/box_tree.h"
#include "mesh/tet_mesh.h"

namespace tessera {

/// A plate in space: the places centre + a axes[0] + b axes[1] + c axes[2] with |a| <= half.x and so on. The
/// axes have length 1 and are perpendicular, up to rounding; the third is the normal. A half of infinity is a
/// plate without that edge.
struct PlanePatch {
    Vec3d centreWorld{0};
    std::array<Vec3d, 3> axes{Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)};
    Vec3d halfWorld{0};
};

/// What PlaneQuery::find found.
struct PlaneHits {
    std::vector<std::int32_t> elements;  ///< ascending
    std::int64_t boxes = 0;              ///< elements whose box in the index was looked at
    std::int64_t touched = 0;            ///< of these, elements whose nodes were then read, hit or not
};

/// Finds the elements that a plate can meet by a bounding volume hierarchy over the elements' boxes, so a cut
/// costs time in proportion to what it cuts. Built once a mesh, which must outlive it and stay unchanged;
/// thread-safe after construction.
class PlaneQuery {
  public:
    explicit PlaneQuery(const TetMesh& mesh, const Execution& execution = {});

    /// Box of the elements, world units; empty without elements.
    const Box3d& boundsWorld() const { return boundsWorld_; }

    /// Every element whose extent along each of the plate's axes meets the plate's. No element that meets the
    /// plate by exact arithmetic is missing; beyond those, an element may be there that passes it by (near
    /// the plate's edges, or by the rounding of the coordinates).
    PlaneHits find(const PlanePatch& patch) const;

  private:
    struct Test;
    void visit(int level, std::int64_t index, const Test& test, PlaneHits& hits) const;

    const TetMesh* mesh_;
    BoxTree tree_;
    Box3d boundsWorld_;
};

/// Extent of the cut of elements with the plane through the patch's centre, along its first two axes and
/// relative to its centre; z is 0. Empty when the plane meets none of them.
Box3d cutExtent(const TetMesh& mesh, const std::vector<std::int32_t>& elements, const PlanePatch& patch);

}  // namespace tessera
