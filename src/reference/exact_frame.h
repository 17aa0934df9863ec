#pragma once

#include <gmpxx.h>

#include <array>
#include <vector>

#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

/// A place in lattice index space times ExactFrame::unit(): an exact integer vector.
struct ExactVec {
    mpz_class x, y, z;
};

ExactVec operator-(const ExactVec& a, const ExactVec& b);
ExactVec cross(const ExactVec& a, const ExactVec& b);
mpz_class dot(const ExactVec& a, const ExactVec& b);

/// num / den in double, within 2^-50 of the quotient relatively, for numbers of any size. @param den not
/// zero.
double approximateRatio(const mpz_class& num, const mpz_class& den);

/// The nodes of a mesh in the index space of a lattice, without rounding. Every double is an integer times a
/// power of two, so after scaling by a common power all coordinates are integers; index space is reached with
/// the adjugate of the frame matrix, and the determinant stays as a common denominator. Lattice points are
/// integer multiples of that denominator. The mesh must outlive it.
class ExactFrame {
  public:
    /// Throws InternalError when the frame vectors are linearly dependent or a used node isn't finite.
    ExactFrame(const TetMesh& mesh, const Lattice& lattice);

    /// Positive: exact place = unit x index.
    const mpz_class& unit() const { return unit_; }
    ExactVec node(std::int32_t n) const;
    ExactVec nodeFrom(std::int32_t n, const ExactVec& origin) const;
    ExactVec latticePoint(const Vec3i& p) const;
    /// Node in index space in double; each coordinate is within 2^-50 of its size.
    const Vec3d& indexNode(std::int32_t n) const { return indexNodes_[std::size_t(n)]; }

  private:
    ExactVec exactNode(std::int32_t n) const;
    ExactVec scaled(const Vec3d& v) const;

    const TetMesh* mesh_;
    int lowestExponent_;  ///< all coordinates are integers times this power of two
    bool isCubic_;        ///< index space without the matrix, with numbers a third as long
    mpz_class unit_;
    ExactVec origin_;
    std::array<ExactVec, 3> rows_;
    std::vector<ExactVec> nodes_;  ///< empty: each is computed when it is asked for
    std::vector<Vec3d> indexNodes_;
};

}  // namespace tessera
