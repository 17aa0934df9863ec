#pragma once

#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace tessera {

using Vec3d = glm::dvec3;
using Vec3i = glm::ivec3;

/// Axis-parallel box of points; empty when min > max on any axis.
struct Box3d {
    Vec3d min{std::numeric_limits<double>::infinity()};
    Vec3d max{-std::numeric_limits<double>::infinity()};

    bool empty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
    void include(const Vec3d& p) {
        min = glm::min(min, p);
        max = glm::max(max, p);
    }
    void include(const Box3d& b) {
        min = glm::min(min, b.min);
        max = glm::max(max, b.max);
    }
    Vec3d size() const { return max - min; }
};

/// Box of lattice points, half-open: min <= index < max on every axis.
struct IndexBox {
    Vec3i min{0};
    Vec3i max{0};

    bool empty() const { return max.x <= min.x || max.y <= min.y || max.z <= min.z; }
    Vec3i size() const { return max - min; }
    /// Number of lattice points.
    std::int64_t count() const {
        return empty() ? 0 : std::int64_t(max.x - min.x) * (max.y - min.y) * (max.z - min.z);
    }
    bool contains(const Vec3i& p) const {
        return p.x >= min.x && p.y >= min.y && p.z >= min.z && p.x < max.x && p.y < max.y && p.z < max.z;
    }
    friend bool operator==(const IndexBox&, const IndexBox&) = default;
};

inline IndexBox intersect(const IndexBox& a, const IndexBox& b) {
    return {glm::max(a.min, b.min), glm::min(a.max, b.max)};
}

/// Floor division by a positive divisor.
inline int floorDiv(int a, int b) {
    return a >= 0 ? a / b : -((-a + b - 1) / b);
}
inline Vec3i floorDiv(const Vec3i& a, int b) {
    return {floorDiv(a.x, b), floorDiv(a.y, b), floorDiv(a.z, b)};
}

}  // namespace tessera
