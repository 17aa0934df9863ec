#pragma once

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace tessera {

/// Three doubles: a place or a direction.
using Vec3d = glm::dvec3;
/// Three ints: the index of a lattice point, or a number of points along each axis.
using Vec3i = glm::ivec3;

/// Axis-parallel box of places, both ends included; empty when min > max on any axis, as it begins.
struct Box3d {
    Vec3d min{std::numeric_limits<double>::infinity()};
    Vec3d max{-std::numeric_limits<double>::infinity()};

    bool empty() const { return !(min.x <= max.x && min.y <= max.y && min.z <= max.z); }
    /// Grows to hold a place too.
    void include(const Vec3d& p) {
        min = glm::min(min, p);
        max = glm::max(max, p);
    }
    /// Grows to hold another box too.
    void include(const Box3d& b) {
        min = glm::min(min, b.min);
        max = glm::max(max, b.max);
    }
    Vec3d size() const { return max - min; }
};

}  // namespace tessera
