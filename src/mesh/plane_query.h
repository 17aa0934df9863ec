#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mesh/element_index.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

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

/// Finds the elements that a plate can meet by the mesh's element index, so a cut costs time in proportion to
/// what it cuts. The mesh must outlive it and stay unchanged; thread-safe after construction.
class PlaneQuery {
  public:
    /// Builds the index, unless somebody did.
    explicit PlaneQuery(std::shared_ptr<const SharedElementIndex> index, const Execution& execution = {});
    explicit PlaneQuery(const TetMesh& mesh, const Execution& execution = {})
        : PlaneQuery(std::make_shared<const SharedElementIndex>(mesh), execution) {}

    /// Box of the elements, world units; empty without elements.
    const Box3d& boundsWorld() const { return index_->get().boundsWorld(); }

    /// Every element whose extent along each of the plate's axes meets the plate's. No element that meets the
    /// plate by exact arithmetic is missing; beyond those, an element may be there that passes it by (near
    /// the plate's edges, or by the rounding of the coordinates).
    PlaneHits find(const PlanePatch& patch) const;

  private:
    std::shared_ptr<const SharedElementIndex> index_;
};

/// Extent of the cut of elements with the plane through the patch's centre, along its first two axes and
/// relative to its centre; z is 0. Empty when the plane meets none of them.
Box3d cutExtent(const TetMesh& mesh, const std::vector<std::int32_t>& elements, const PlanePatch& patch);

}  // namespace tessera
