#include "brick/overlap.h"

#include <algorithm>
#include <cmath>

namespace tessera {

ElementOverlap::ElementOverlap(const std::array<Vec3d, 4>& nodes) : nodes_(nodes) {
    for (const Vec3d& node : nodes) bounds_.include(node);
}

namespace {

/// How an element and a box lie along one axis.
struct Shadows {
    bool areApart;
    bool holdCentre;  ///< the box's centre lies well within the element's shadow
};

// Of corners that are given relative to the box's centre and a box of half size `half`. The tolerance covers
// the rounding of the axis and of the projections; `reach` is how far the corners are.
Shadows shadowsOn(const Vec3d& axis, const std::array<Vec3d, 4>& corners, const Vec3d& half, double reach) {
    double low = glm::dot(axis, corners[0]), high = low;
    double largest = std::abs(low);
    for (int i = 1; i < 4; ++i) {
        const double d = glm::dot(axis, corners[std::size_t(i)]);
        low = std::min(low, d);
        high = std::max(high, d);
        largest = std::max(largest, std::abs(d));
    }
    const Vec3d size = glm::abs(axis);
    const double radius = glm::dot(size, half);
    const double scale = std::max({largest, radius, (size.x + size.y + size.z) * reach});
    const double tolerance = 1e-12 * scale;
    return {low > radius + tolerance || high < -radius - tolerance, low < -tolerance && high > tolerance};
}

}  // namespace

bool ElementOverlap::touches(const Box3d& box) const {
    if (!boundsTouch(box)) return false;
    const Vec3d centre = 0.5 * (box.min + box.max);
    const Vec3d half = 0.5 * (box.max - box.min);
    std::array<Vec3d, 4> corners;
    for (std::size_t i = 0; i < 4; ++i) corners[i] = nodes_[i] - centre;
    // A node well inside settles it.
    for (const Vec3d& c : corners)
        if (std::abs(c.x) < half.x && std::abs(c.y) < half.y && std::abs(c.z) < half.z) return true;
    const double reach = glm::length(corners[0]);
    constexpr int kFaces[4][3] = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
    // Of corners in one line normals are rounding alone, and say nothing of what the element holds.
    constexpr double kLeastSine = 1e-10;
    bool holdsCentre = true;
    for (const auto& f : kFaces) {
        const Vec3d a = corners[std::size_t(f[1])] - corners[std::size_t(f[0])];
        const Vec3d b = corners[std::size_t(f[2])] - corners[std::size_t(f[0])];
        const Vec3d normal = glm::cross(a, b);
        const Shadows shadows = shadowsOn(normal, corners, half, reach);
        if (shadows.areApart) return false;
        holdsCentre = holdsCentre && shadows.holdCentre &&
                      glm::length(normal) > kLeastSine * glm::length(a) * glm::length(b);
    }
    if (holdsCentre) return true;
    const auto separates = [&](const Vec3d& axis) { return shadowsOn(axis, corners, half, reach).areApart; };
    for (std::size_t a = 0; a < 4; ++a)
        for (std::size_t b = a + 1; b < 4; ++b) {
            const Vec3d edge = corners[b] - corners[a];
            if (separates({0, -edge.z, edge.y}) || separates({edge.z, 0, -edge.x}) ||
                separates({-edge.y, edge.x, 0}))
                return false;
        }
    return true;
}

std::array<Vec3d, 4> elementInIndexSpace(const TetMesh& mesh, std::int64_t element, const Vec3d& originWorld,
                                         double spacingWorld) {
    const double inverse = 1.0 / spacingWorld;
    std::array<Vec3d, 4> nodes;
    const auto& tet = mesh.tets[std::size_t(element)];
    for (std::size_t i = 0; i < 4; ++i) nodes[i] = (mesh.points[std::size_t(tet[i])] - originWorld) * inverse;
    return nodes;
}

}  // namespace tessera
