#include "mesh/shell_edges.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mesh/geometry.h"

namespace tessera {

namespace {

struct FaceAtEdge {
    ShellEdge edge;
    Vec3d normal;  // out of the mesh, of length 1; 0 of a face without an area

    friend bool operator<(const FaceAtEdge& a, const FaceAtEdge& b) { return a.edge < b.edge; }
};

Vec3d outwardNormal(const TetMesh& mesh, const BoundaryFace& face) {
    const auto node = [&](int n) { return mesh.points[std::size_t(face.nodes[std::size_t(n)])]; };
    Vec3d normal = glm::cross(node(1) - node(0), node(2) - node(0));
    for (const std::int32_t other : mesh.tets[std::size_t(face.element)])
        if (std::find(face.nodes.begin(), face.nodes.end(), other) == face.nodes.end() &&
            glm::dot(normal, mesh.points[std::size_t(other)] - node(0)) > 0)
            normal = -normal;
    const double length = glm::length(normal);
    return length > 0 ? normal / length : Vec3d(0);
}

}  // namespace

std::vector<ShellEdge> shellEdges(const TetMesh& mesh, double leastDegrees, int threads) {
    std::vector<FaceAtEdge> sides;
    for (const BoundaryFace& face : boundaryFaces(mesh, threads)) {
        const Vec3d normal = outwardNormal(mesh, face);
        for (std::size_t n = 0; n < 3; ++n) {
            const std::int32_t a = face.nodes[n], b = face.nodes[(n + 1) % 3];
            sides.push_back({{std::min(a, b), std::max(a, b)}, normal});
        }
    }
    std::stable_sort(sides.begin(), sides.end());
    std::vector<ShellEdge> edges;
    const double most = std::cos(leastDegrees * std::numbers::pi / 180);
    for (std::size_t first = 0; first < sides.size();) {
        std::size_t end = first + 1;
        while (end < sides.size() && sides[end].edge == sides[first].edge) ++end;
        const bool isPair = end - first == 2;
        if (leastDegrees <= 0 || !isPair || glm::dot(sides[first].normal, sides[first + 1].normal) <= most)
            edges.push_back(sides[first].edge);
        first = end;
    }
    return edges;
}

}  // namespace tessera
