#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "tessera/mesh.h"

namespace tessera {

/// Six times the signed volume of a tetrahedron in double, and how far rounding can have moved it (infinite
/// or NaN when a product overflowed).
struct SixfoldVolume {
    double value;
    double errorBound;
};
inline SixfoldVolume sixfoldVolume(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    const Vec3d u = b - a, v = c - a, w = d - a;
    const double yz = u.y * v.z, zy = u.z * v.y;
    const double zx = u.z * v.x, xz = u.x * v.z;
    const double xy = u.x * v.y, yx = u.y * v.x;
    const double volume = w.x * (yz - zy) + w.y * (zx - xz) + w.z * (xy - yx);
    const double wx = std::fabs(w.x), wy = std::fabs(w.y), wz = std::fabs(w.z);
    const double sum = wx * (std::fabs(yz) + std::fabs(zy)) + wy * (std::fabs(zx) + std::fabs(xz)) +
                       wz * (std::fabs(xy) + std::fabs(yx));
    // Each of the six monomials passes at most 8 roundings (3 differences, 2 products, 3 sums), and so does
    // `sum`, so the error is at most
    // ((1 + e)^8 - 1) / (1 - e)^8 < 9 e times `sum`, e = 2^-53; 10 e leaves room for the rounding of the
    // bound itself. A product that underflows loses at most 2^-1075: the second term, far larger because
    // processors are slow with constants that are subnormal themselves.
    return {volume, 10 * 0x1p-53 * sum + 0x1p-1000 * (wx + wy + wz + 1)};
}

/// Sign of the exact volume where double can't decide it: rational arithmetic.
int exactVolumeSign(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d);

/// Sign of the exact volume of the tetrahedron a, b, c, d: that of ((b - a) x (c - a)) . (d - a), which is
/// positive in VTK files; 0 when the four are exactly coplanar. Exact for all finite doubles: a
/// floating-point filter, then rational arithmetic.
inline int volumeSign(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    const SixfoldVolume sixfold = sixfoldVolume(a, b, c, d);
    // Overflow makes both comparisons false and ends in the exact path.
    if (sixfold.value > sixfold.errorBound) return 1;
    if (sixfold.value < -sixfold.errorBound) return -1;
    return exactVolumeSign(a, b, c, d);
}

/// Signed volume in world units cubed, in double (not exact).
double signedVolume(const TetMesh& mesh, std::int64_t element);

/// Six edge lengths' mean, world units.
double meanEdgeLength(const TetMesh& mesh, std::int64_t element);

/// One side of an element that no other element shares: the mesh boundary and the sides of non-conforming
/// faces.
struct BoundaryFace {
    std::int32_t element;
    std::array<std::int32_t, 3> nodes;
};

/// Faces that exactly one element of non-zero volume uses (compared by node indices), ascending by element.
std::vector<BoundaryFace> boundaryFaces(const TetMesh& mesh, int threads = 0);

}  // namespace tessera
