#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <utility>

#include "surface/surface.h"

/// Surfaces for tests. All but those that say so are closed, and their triangles look outwards.
namespace tessera::test {

/// The point of the `box`th box of a surface of boxes, by the coordinates 0 or 1 of a corner.
inline std::int32_t cornerOfBox(int box, const Vec3i& corner) {
    return 8 * box + corner.x + 2 * corner.y + 4 * corner.z;
}

inline void turn(Surface& surface, std::size_t triangle) {
    std::swap(surface.triangles[triangle][1], surface.triangles[triangle][2]);
}
/// Those from `first` on.
inline void turnAll(Surface& surface, std::size_t first) {
    for (std::size_t t = first; t < surface.triangles.size(); ++t) turn(surface, t);
}

inline void appendBox(Surface& surface, const Vec3d& min, const Vec3d& max) {
    const auto first = std::int32_t(surface.points.size());
    for (int c = 0; c < 8; ++c)
        surface.points.push_back({c & 1 ? max.x : min.x, c & 2 ? max.y : min.y, c & 4 ? max.z : min.z});
    const std::int32_t quads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                      {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    for (const auto& q : quads) {
        surface.triangles.push_back({first + q[0], first + q[1], first + q[2]});
        surface.triangles.push_back({first + q[0], first + q[2], first + q[3]});
    }
}

/// @param d on the side from which a, b, c run clockwise.
inline void appendTetrahedron(Surface& surface, const Vec3d& a, const Vec3d& b, const Vec3d& c,
                              const Vec3d& d) {
    const auto first = std::int32_t(surface.points.size());
    surface.points.insert(surface.points.end(), {a, b, c, d});
    const std::size_t begin = surface.triangles.size();
    for (const auto& f : {std::array<std::int32_t, 3>{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}})
        surface.triangles.push_back({first + f[0], first + f[1], first + f[2]});
    if (glm::dot(glm::cross(b - a, c - a), d - a) > 0) turnAll(surface, begin);
}

/// |x| + |y| + |z| = radius.
inline void appendOctahedron(Surface& surface, double radius) {
    const auto first = std::int32_t(surface.points.size());
    for (int k = 0; k < 3; ++k)
        for (const double sign : {-1.0, 1.0}) {
            surface.points.emplace_back(0);
            surface.points.back()[k] = sign * radius;
        }
    for (int octant = 0; octant < 8; ++octant) {
        const int x = octant & 1, y = octant >> 1 & 1, z = octant >> 2;
        surface.triangles.push_back({first + x, first + 2 + y, first + 4 + z});
        if ((x + y + z) % 2 == 0) turn(surface, surface.triangles.size() - 1);
    }
}

/// A grid of points on a sphere: `bands` rows of triangles from pole to pole, twice as many around.
inline void appendSphere(Surface& surface, const Vec3d& centre, double radius, int bands) {
    const auto first = std::int32_t(surface.points.size());
    const int around = 2 * bands;
    surface.points.push_back(centre - Vec3d(0, 0, radius));
    for (int b = 1; b < bands; ++b)
        for (int a = 0; a < around; ++a) {
            const double polar = std::numbers::pi * b / bands, turned = 2 * std::numbers::pi * a / around;
            surface.points.push_back(centre + radius * Vec3d(std::sin(polar) * std::cos(turned),
                                                             std::sin(polar) * std::sin(turned),
                                                             -std::cos(polar)));
        }
    surface.points.push_back(centre + Vec3d(0, 0, radius));
    const auto at = [&](int band, int a) -> std::int32_t {
        if (band == 0) return first;
        if (band == bands) return first + 1 + (bands - 1) * around;
        return first + 1 + (band - 1) * around + a % around;
    };
    for (int b = 0; b < bands; ++b)
        for (int a = 0; a < around; ++a) {
            if (b > 0) surface.triangles.push_back({at(b, a), at(b, a + 1), at(b + 1, a)});
            if (b + 1 < bands) surface.triangles.push_back({at(b, a + 1), at(b + 1, a + 1), at(b + 1, a)});
        }
}

/// A grid of `m` by `n` quads that is closed in both directions. @param pointOf (i, j). @param mirrored the
/// row behind the last is the first one the other way round.
inline void appendClosedGrid(Surface& surface, int m, int n, const std::function<Vec3d(int, int)>& pointOf,
                             bool mirrored) {
    const auto first = std::int32_t(surface.points.size());
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) surface.points.push_back(pointOf(i, j));
    const auto at = [&](int i, int j) {
        if (i == m && mirrored) j = n - j;
        return first + i % m * n + (j + n) % n;
    };
    for (int i = 0; i < m; ++i)
        for (int j = 0; j < n; ++j) {
            surface.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            surface.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
}

/// Around the z axis.
inline void appendTorus(Surface& surface, const Vec3d& centre, double ringRadius, double tubeRadius, int m,
                        int n) {
    appendClosedGrid(
        surface, m, n,
        [&](int i, int j) {
            const double u = 2 * std::numbers::pi * i / m, v = 2 * std::numbers::pi * j / n;
            const double r = ringRadius + tubeRadius * std::cos(v);
            return centre + Vec3d(r * std::cos(u), r * std::sin(u), tubeRadius * std::sin(v));
        },
        false);
}

/// The figure-8 immersion: closed, with one side, and it crosses itself. @param n even.
inline Surface kleinBottle(int m, int n) {
    Surface surface;
    appendClosedGrid(
        surface, m, n,
        [&](int i, int j) {
            const double u = 2 * std::numbers::pi * i / m, v = 2 * std::numbers::pi * j / n;
            const double r =
                2 + std::cos(u / 2) * std::sin(v + 0.1) - std::sin(u / 2) * std::sin(2 * v + 0.2);
            return Vec3d(r * std::cos(u), r * std::sin(u),
                         std::sin(u / 2) * std::sin(v + 0.1) + std::cos(u / 2) * std::sin(2 * v + 0.2));
        },
        true);
    return surface;
}

/// A strip of `n` quads, turned by half a turn: open, with one side.
inline Surface moebiusStrip(int n) {
    Surface surface;
    for (int i = 0; i < n; ++i)
        for (const double side : {-0.3, 0.3}) {
            const double u = 2 * std::numbers::pi * i / n;
            const double r = 1 + side * std::cos(u / 2);
            surface.points.push_back({r * std::cos(u), r * std::sin(u), side * std::sin(u / 2)});
        }
    const auto at = [&](int i, int side) { return i == n ? 1 - side : 2 * i + side; };
    for (int i = 0; i < n; ++i) {
        surface.triangles.push_back({at(i, 0), at(i + 1, 0), at(i + 1, 1)});
        surface.triangles.push_back({at(i, 0), at(i + 1, 1), at(i, 1)});
    }
    return surface;
}

/// The same triangles, each with points of its own.
inline Surface asSoup(const Surface& surface) {
    Surface soup;
    for (const auto& triangle : surface.triangles) {
        const auto first = std::int32_t(soup.points.size());
        for (const std::int32_t point : triangle) soup.points.push_back(surface.points[std::size_t(point)]);
        soup.triangles.push_back({first, first + 1, first + 2});
    }
    return soup;
}

}  // namespace tessera::test
