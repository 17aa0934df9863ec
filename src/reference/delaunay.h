#pragma once

#include <span>

#include "tessera/mesh.h"

namespace tessera {

/// Delaunay tetrahedralisation (incremental, Bowyer and Watson 1981; exact predicates). Tets with a node of
/// the enclosing tetrahedron are left out, so the hull isn't quite convex. @param points no duplicates,
/// within 100 of the origin, not cospherical.
TetMesh delaunayMesh(std::span<const Vec3d> points);

}  // namespace tessera
