#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "mesh/tet_mesh.h"

namespace tessera {

/// Sign of the exact volume of the tetrahedron a, b, c, d: that of ((b - a) x (c - a)) . (d - a), which is
/// positive in VTK files; 0 when the four are exactly coplanar. Exact for all finite doubles: a
/// floating-point filter, then rational arithmetic.
int volumeSign(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d);

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
