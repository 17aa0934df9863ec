#pragma once

#include <algorithm>
#include <array>
#include <limits>

#include "tessera/vec.h"

namespace tessera {

/// A place on a triangle, by weights of its corners, and its distance from a point.
struct TrianglePlace {
    double distance2 = std::numeric_limits<double>::infinity();  ///< squared, world units
    std::array<double, 3> weights{};
};

/// Nearest place on the edge i-j, which may have no length.
inline void offerEdge(const std::array<Vec3d, 3>& corners, std::size_t i, std::size_t j, const Vec3d& point,
                      TrianglePlace& best) {
    const Vec3d edge = corners[j] - corners[i];
    const Vec3d toPoint = point - corners[i];
    const double length2 = glm::dot(edge, edge);
    const double along = glm::dot(toPoint, edge);
    double t = 0;
    if (along > 0) t = along < length2 ? along / length2 : 1;
    const Vec3d offset = t == 1 ? point - corners[j] : toPoint - t * edge;
    const double distance2 = glm::dot(offset, offset);
    if (!(distance2 < best.distance2)) return;
    best.distance2 = distance2;
    best.weights = {};
    best.weights[i] = 1 - t;
    best.weights[j] = t;
}

/// Nearest place on a triangle that may be a segment or a point. Every candidate is a true place of the
/// triangle with its own distance, so rounding can cost a little distance on a needle but never gives a wrong
/// place.
inline TrianglePlace nearestOnTriangle(const std::array<Vec3d, 3>& corners, const Vec3d& point) {
    const Vec3d u = corners[1] - corners[0];
    const Vec3d v = corners[2] - corners[0];
    const Vec3d w = point - corners[0];
    const Vec3d normal = glm::cross(u, v);
    const double normal2 = glm::dot(normal, normal);
    TrianglePlace best;
    if (normal2 > 0) {
        const double t1 = glm::dot(glm::cross(w, v), normal) / normal2;
        const double t2 = glm::dot(glm::cross(u, w), normal) / normal2;
        const double t0 = 1 - t1 - t2;
        if (t0 > 0 && t1 > 0 && t2 > 0) {
            const Vec3d offset = w - (t1 * u + t2 * v);
            best = {glm::dot(offset, offset), {t0, t1, t2}};
            // Away from the rim, and when the triangle is no needle, no edge can be nearer.
            const double longest2 = std::max(glm::dot(u, u), glm::dot(v, v));
            if (std::min({t0, t1, t2}) > 1e-6 && normal2 > 1e-8 * longest2 * longest2) return best;
        }
    }
    offerEdge(corners, 0, 1, point, best);
    offerEdge(corners, 0, 2, point, best);
    offerEdge(corners, 1, 2, point, best);
    return best;
}

}  // namespace tessera
