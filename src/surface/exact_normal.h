#pragma once

#include <array>

#include "surface/surface.h"

namespace tessera {

/// The corners of a triangle, world units.
using TriangleCorners = std::array<Vec3d, 3>;

inline TriangleCorners cornersOf(const Surface& surface, std::int64_t triangle) {
    const auto& t = surface.triangles[std::size_t(triangle)];
    return {surface.points[std::size_t(t[0])], surface.points[std::size_t(t[1])],
            surface.points[std::size_t(t[2])]};
}

/// Middle of a triangle and of two places, world units; without overflow.
inline Vec3d middleOf(const TriangleCorners& corners) {
    return corners[0] / 3.0 + corners[1] / 3.0 + corners[2] / 3.0;
}
inline Vec3d middleOf(const Vec3d& a, const Vec3d& b) {
    return 0.5 * a + 0.5 * b;
}

/// Sign of the exact component along an axis of the normal (b - a) x (c - a): which way round the three run
/// in the projection along that axis, 0 when they lie on one line there. Exact for all finite doubles: a
/// floating-point filter, products without rounding, then rational arithmetic.
int normalSign(int axis, const Vec3d& a, const Vec3d& b, const Vec3d& c);

/// An axis along which the normal's component isn't 0, about the largest; -1 when the three corners lie
/// exactly on one line.
int mainAxis(const TriangleCorners& corners);

}  // namespace tessera
