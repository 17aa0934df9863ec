#pragma once

#include <cstdint>
#include <vector>

#include "mesh/box_tree.h"
#include "surface/surface.h"
#include "surface/tetrahedralize_options.h"

namespace tessera {

/// How long edges are to be at every place: the least of the length wished for everywhere and of those wished
/// for on the surface, which grow with the distance from it.
class SizeField {
  public:
    /// Throws InputError where the surface lacks the field, or a value of it isn't above 0.
    SizeField(const Surface& surface, const SizeWishes& wishes, const Execution& execution);

    /// World units; infinite without any wish. Thread-safe.
    double at(const Vec3d& placeWorld) const;
    /// The least length anywhere.
    double least() const { return least_; }

  private:
    void buildTree(const Surface& surface, const Execution& execution);
    double nearSurface(const Vec3d& placeWorld, double most) const;

    std::vector<double> sizes_;  ///< at the points; empty: none
    double everywhere_, growth_, least_;
    BoxTree tree_;
    std::vector<std::array<Vec3d, 3>> corners_;  ///< of the triangles, in the tree's order
    std::vector<std::array<double, 3>> cornerSizes_;
    /// The least size below every child of the tree's nodes, level by level.
    std::vector<std::vector<std::array<double, BoxTree::kWidth>>> leastBelow_;
};

/// Radius of curvature at every point of a surface, world units, by the angles between the normals at the
/// ends of its edges: the least of all directions. Infinite where it is flat.
std::vector<double> curvatureRadii(const Surface& surface);

}  // namespace tessera
