#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/box_tree.h"
#include "surface/surface.h"

namespace tessera {

/// Triangles of a surface by the places they are at. Refers to the surface.
class TriangleTree {
  public:
    /// @param leftOut one entry a triangle, not 0: not in the tree.
    TriangleTree(const Surface& surface, std::span<const std::uint8_t> leftOut, const Execution& execution);

    const Surface& surface() const { return surface_; }
    std::int64_t count() const { return std::int64_t(byPlace_.size()); }
    /// The triangle at one of count() places of the tree's order.
    std::int32_t triangleAt(std::int64_t place) const { return byPlace_[std::size_t(place)]; }
    Box3d boxOf(std::int32_t triangle) const;

    /// Calls visit(place) for every triangle whose box meets the closed box.
    template <class Visit>
    void visitOverlaps(const Box3d& box, Visit&& visit) const {
        tree_.visitOverlaps(box, visit);
    }

  private:
    const Surface& surface_;
    BoxTree tree_;
    std::vector<std::int32_t> byPlace_;
};

}  // namespace tessera
