#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "brick/seams.h"
#include "mesh/element_index.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// One element in voxel units: barycentric weights as linear functions of a place, in double, and how far
/// rounding can move them.
struct VoxelElement {
    std::array<Vec3d, 4> corners{};
    std::array<Vec3d, 4> gradients{};  ///< of the weights, per voxel
    double weightError = 0;            ///< bound on a weight's rounding within a voxel of the element's box
    double thicknessVoxels = 0;        ///< least height

    /// False where the element is too thin for double to tell its inside.
    bool isReliable() const { return weightError < 0x1p-6; }
    std::array<double, 4> weights(const Vec3d& place) const {
        std::array<double, 4> w;
        for (std::size_t i = 0; i < 4; ++i) w[i] = glm::dot(gradients[i], place - corners[(i + 1) & 3]);
        return w;
    }
    /// Distance from a place to the solid element, 0 inside; for any element, however thin.
    double distance(const Vec3d& place) const;
};

/// A mesh seen from an axis-parallel lattice: lengths are voxels, lattice points are whole numbers. Answers,
/// in double, what lies around a place. Thread-safe after construction.
class VoxelMesh {
  public:
    /// Throws InputError for a lattice that isn't axis-parallel.
    VoxelMesh(const TetMesh& mesh, const Lattice& lattice, int threads = 0);

    /// False for an element of exactly zero volume.
    bool element(std::int32_t index, VoxelElement& result) const;
    Box3d bounds(std::int32_t index) const;
    /// Appends every element whose bounding box meets the closed box, ascending.
    void query(const Box3d& box, std::vector<std::int32_t>& elements) const { index_.query(box, elements); }

    /// Whether the boundary of the mesh comes within `reach` of the place. Sides that no two elements share
    /// by their nodes but that have mesh on both sides, as where a fine part meets a coarse one, don't count.
    bool isNearBoundary(const Vec3d& place, double reach) const;

    struct Neighbour {
        std::int32_t element = -1;
        double thicknessVoxels = std::numeric_limits<double>::infinity();
    };
    /// Of the elements within `reach` of the place the thinnest; element -1 when there is none.
    Neighbour thinnestNear(const Vec3d& place, double reach) const;

  private:
    TetMesh voxels_;                   // the elements with nodes in voxel units
    std::vector<std::uint8_t> solid_;  // by element: its exact volume isn't zero
    ElementIndex index_;
    NearestOnDemand boundary_;
};

}  // namespace tessera
