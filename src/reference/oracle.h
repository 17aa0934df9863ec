#pragma once

#include <gmpxx.h>

#include <array>
#include <cstdint>

#include "reference/exact_frame.h"

namespace tessera {

/// A place in an element: weights of its four nodes, exact, sum 1.
using ExactWeights = std::array<mpq_class, 4>;

/// The point of a closed element nearest to a lattice point.
struct ExactNearest {
    ExactWeights weights;       ///< none negative
    mpq_class squaredDistance;  ///< voxel units squared; 0 when the lattice point lies in the element
};

/// Exact answers about one mesh on one lattice, in rational arithmetic. All lengths are in voxels: Euclidean
/// in index space, which for a lattice of one spacing is world distance over spacing. The mesh must outlive
/// the oracle. Thread-safe.
class Oracle {
  public:
    Oracle(const TetMesh& mesh, const Lattice& lattice);

    const TetMesh& mesh() const { return *mesh_; }
    const Lattice& lattice() const { return lattice_; }
    const ExactFrame& frame() const { return frame_; }

    /// Sign of the element's volume in index space; elements of volume 0 are no part of the mesh.
    int volumeSign(std::int64_t element) const;

    // The functions below need an element of non-zero volume.

    /// In the closed element.
    bool contains(std::int64_t element, const Vec3i& p) const;
    /// Barycentric coordinates of the lattice point, negative outside.
    ExactWeights barycentrics(std::int64_t element, const Vec3i& p) const;
    /// The same in double, each within 2^-50 relatively.
    std::array<double, 4> approximateBarycentrics(std::int64_t element, const Vec3i& p) const;
    ExactNearest nearest(std::int64_t element, const Vec3i& p) const;
    /// Signed distance to the nearest face plane, negative outside, within 2^-48 relatively.
    double depthVoxels(std::int64_t element, const Vec3i& p) const;

    /// Linear interpolation with the field's node values in double. @param field a point field, finite on the
    /// element.
    mpq_class interpolate(const Field& field, int component, std::int64_t element,
                          const ExactWeights& weights) const;
    /// Squared Euclidean norm of the field's gradient, per voxel squared. @param field as above.
    mpq_class squaredGradient(const Field& field, int component, std::int64_t element) const;

  private:
    struct Corners;
    Corners cornersFrom(std::int64_t element, const ExactVec& origin) const;

    const TetMesh* mesh_;
    Lattice lattice_;
    ExactFrame frame_;
};

}  // namespace tessera
