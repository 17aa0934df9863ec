#pragma once

#include <array>
#include <vector>

#include "render/effect.h"
#include "tessera/mesh.h"

namespace tessera {

/// Edges of a mesh's surface, as lines.
struct Outline {
    double widthPixels = 1;
    MarkColor color{0.25, 0.25, 0.25};
    /// Only where the surface bends by as much, or ends; 0: all edges of the elements' faces.
    double leastDegrees = 30;
};
/// @param edges ends of each, world units.
Effect outlineEffect(const std::vector<std::array<Vec3d, 2>>& edges, const Outline& outline);
Effect outlineEffect(const TetMesh& mesh, const Outline& outline);

}  // namespace tessera
