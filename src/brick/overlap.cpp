#include "brick/overlap.h"

#include <algorithm>
#include <cmath>

namespace tessera {

ElementOverlap::ElementOverlap(const std::array<Vec3d, 4>& nodes) : nodes_(nodes) {
    for (const Vec3d& node : nodes) bounds_.include(node);
}

namespace {

constexpr int kFaces[4][3] = {{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};

double sumOf(const Vec3d& size) {
    return std::abs(size.x) + std::abs(size.y) + std::abs(size.z);
}

// Whether the shadows on an axis lie apart, of corners that are given relative to the box's centre and a box
// of half size `half`. The tolerance covers the rounding of the axis and of the projections; `reach` is how
// far the corners are.
bool areApartOn(const Vec3d& axis, const std::array<Vec3d, 4>& corners, const Vec3d& half, double reach) {
    double low = glm::dot(axis, corners[0]), high = low;
    double largest = std::abs(low);
    for (int i = 1; i < 4; ++i) {
        const double d = glm::dot(axis, corners[std::size_t(i)]);
        low = std::min(low, d);
        high = std::max(high, d);
        largest = std::max(largest, std::abs(d));
    }
    const double radius = glm::dot(glm::abs(axis), half);
    const double scale = std::max({largest, radius, sumOf(axis) * reach});
    const double tolerance = kShadowTolerance * scale;
    return low > radius + tolerance || high < -radius - tolerance;
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
    const auto separates = [&](const Vec3d& axis) { return areApartOn(axis, corners, half, reach); };
    for (const auto& f : kFaces) {
        const Vec3d &a = corners[std::size_t(f[0])], &b = corners[std::size_t(f[1])],
                    &c = corners[std::size_t(f[2])];
        if (separates(glm::cross(b - a, c - a))) return false;
    }
    if (holds(centre)) return true;
    for (std::size_t a = 0; a < 4; ++a)
        for (std::size_t b = a + 1; b < 4; ++b) {
            const Vec3d edge = corners[b] - corners[a];
            if (separates({0, -edge.z, edge.y}) || separates({edge.z, 0, -edge.x}) ||
                separates({-edge.y, edge.x, 0}))
                return false;
        }
    return true;
}

bool ElementOverlap::holds(const Vec3d& point) const {
    // What lies on either side of a face by less may have been rounded there; of numbers so small or large
    // that bounds vanish or products overflow nothing is sure.
    constexpr double kRounding = 1e-14, kLeast = 1e-250, kMost = 1e250;
    const auto isSure = [&](double side, double bound) {
        return bound > kLeast && std::abs(side) > bound && std::abs(side) < kMost;
    };
    if (glm::any(glm::lessThan(point, bounds_.min)) || glm::any(glm::greaterThan(point, bounds_.max)))
        return false;
    for (std::size_t f = 0; f < 4; ++f) {
        const Vec3d& from = nodes_[std::size_t(kFaces[f][0])];
        const Vec3d a = nodes_[std::size_t(kFaces[f][1])] - from,
                    b = nodes_[std::size_t(kFaces[f][2])] - from;
        const Vec3d fourth = nodes_[3 - f] - from, own = point - from;
        const Vec3d normal = glm::cross(a, b);
        const double rounding = kRounding * sumOf(a) * sumOf(b);
        const double inner = glm::dot(normal, fourth), side = glm::dot(normal, own);
        if (!isSure(inner, rounding * sumOf(fourth)) || !isSure(side, rounding * sumOf(own)) ||
            (inner > 0) != (side > 0))
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
