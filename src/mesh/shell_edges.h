#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tessera/mesh.h"

namespace tessera {

/// An edge of boundary faces, by its nodes, the smaller number first.
using ShellEdge = std::array<std::int32_t, 2>;

/// The edges of the mesh's boundary, ascending, where it has a bend of at least an angle: the angle between
/// the normals of the two faces there, in degrees. Where not two faces meet it is taken as 180. @param
/// leastDegrees 0: all edges.
std::vector<ShellEdge> shellEdges(const TetMesh& mesh, double leastDegrees, int threads = 0);

}  // namespace tessera
