#include "mesh/element_class.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/parallel.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

constexpr std::int64_t kClassChunk = 1 << 14;
/// Below this share of the longest edge squared a face's normal is mostly rounding.
constexpr double kNoNormal = 1e-13;

constexpr std::array<std::array<std::uint8_t, 2>, 6> kEdges{{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

/// Edges from corner 0, and twice the outward area vectors of the faces opposite to the corners (of a
/// positively oriented element; all inward for the other orientation).
struct Faces {
    Vec3d u, v, w;
    std::array<Vec3d, 4> normals;
    double longest2 = 0;

    explicit Faces(const Corners& c) : u(c[1] - c[0]), v(c[2] - c[0]), w(c[3] - c[0]) {
        const Vec3d uv = v - u, uw = w - u, vw = w - v;
        normals = {glm::cross(uv, uw), glm::cross(w, v), glm::cross(u, w), glm::cross(v, u)};
        for (const Vec3d& edge : {u, v, w, uv, uw, vw}) longest2 = std::max(longest2, glm::dot(edge, edge));
    }
    double aspect() const {
        double largest2 = 0;
        for (const Vec3d& n : normals) largest2 = std::max(largest2, glm::dot(n, n));
        if (!(largest2 > 0)) return 0;
        return std::fabs(glm::dot(normals[3], w)) / std::sqrt(largest2 * longest2);
    }
};

/// Squares and products of lengths whose squares are in this range neither overflow nor vanish.
bool isOrdinary(double length2) {
    return length2 > 1e-80 && length2 < 1e80;
}

/// The same element, scaled by a power of two to a size about 1.
Corners scaledToOne(const Corners& c) {
    double largest = 0;
    for (const auto& [i, j] : kEdges)
        for (int k = 0; k < 3; ++k) largest = std::max(largest, std::fabs(0.25 * c[i][k] - 0.25 * c[j][k]));
    if (!(largest > 0)) return {};
    const int power = -std::ilogb(largest) - 2;
    Corners scaled{};
    // Differences first: a large offset must not swallow them. A quarter keeps them from overflowing.
    for (std::size_t i = 1; i < 4; ++i)
        for (int k = 0; k < 3; ++k) {
            const double whole = c[i][k] - c[0][k];
            scaled[i][k] = std::isfinite(whole) ? std::ldexp(whole, power)
                                                : std::ldexp(0.25 * c[i][k] - 0.25 * c[0][k], power + 2);
        }
    return scaled;
}

Faces facesOf(const Corners& corners) {
    const Faces faces(corners);
    return isOrdinary(faces.longest2) ? faces : Faces(scaledToOne(corners));
}

/// Completes the order from its first two corners.
std::array<std::uint8_t, 4> orderFrom(std::uint8_t first, std::uint8_t second) {
    std::array<std::uint8_t, 4> order{first, second};
    std::size_t count = 2;
    for (std::uint8_t i = 0; i < 4; ++i)
        if (i != first && i != second) order[count++] = i;
    return order;
}

std::size_t shortestEdge(const Faces& faces) {
    const std::array<Vec3d, 4> at{Vec3d(0), faces.u, faces.v, faces.w};
    std::size_t shortest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t e = 0; e < 6; ++e) {
        const Vec3d edge = at[kEdges[e][1]] - at[kEdges[e][0]];
        const double length2 = glm::dot(edge, edge);
        if (length2 < least) least = length2, shortest = e;
    }
    return shortest;
}

/// The corner at most of the given edges; the lowest of equals.
std::uint8_t commonCorner(const std::vector<std::size_t>& edges) {
    std::array<int, 4> uses{};
    for (const std::size_t e : edges)
        for (const std::uint8_t i : kEdges[e]) ++uses[i];
    return std::uint8_t(std::max_element(uses.begin(), uses.end()) - uses.begin());
}

}  // namespace

const char* nameOf(ElementClass elementClass) {
    constexpr std::array<const char*, kElementClasses> kNames{"good",   "needle", "spindle",
                                                              "sliver", "cap",    "flat"};
    return kNames[std::size_t(elementClass)];
}

Corners cornersOf(const TetMesh& mesh, std::int64_t element) {
    const auto& tet = mesh.tets[std::size_t(element)];
    Corners corners;
    for (std::size_t i = 0; i < 4; ++i) corners[i] = mesh.points[std::size_t(tet[i])];
    return corners;
}

double aspectOf(const Corners& corners) {
    return facesOf(corners).aspect();
}

ThinShape thinShapeOf(const Corners& corners, const ClassLimits& limits) {
    const Faces faces = facesOf(corners);
    // The angle at an edge is large when the outward normals of its two faces nearly agree.
    const double agree = std::cos(std::numbers::pi * (1 - limits.maxDihedralDegrees / 180));
    std::vector<std::size_t> large;
    for (std::size_t e = 0; e < 6; ++e) {
        const auto [k, l] = kEdges[5 - e];  // the faces at edge e are opposite to the corners it hasn't
        const Vec3d &m = faces.normals[k], &n = faces.normals[l];
        const double lengthM = glm::length(m), lengthN = glm::length(n);
        if (std::min(lengthM, lengthN) < kNoNormal * faces.longest2) continue;
        if (glm::dot(m, n) > agree * lengthM * lengthN) large.push_back(e);
    }
    if (large.empty()) {
        const auto [a, b] = kEdges[shortestEdge(faces)];
        return {ElementClass::needle, orderFrom(a, b)};
    }
    const auto [a, b] = kEdges[large[0]];
    if (large.size() == 1) return {ElementClass::spindle, orderFrom(a, b)};
    if (large.size() == 2 && large[0] + large[1] == 5) return {ElementClass::sliver, orderFrom(a, b)};
    const std::uint8_t apex = commonCorner(large);
    return {ElementClass::cap, orderFrom(apex, apex == 0 ? 1 : 0)};
}

ElementClass classOf(const Corners& c, const ClassLimits& limits) {
    // "Not thicker" and not "thinner", so that a NaN isn't taken for good.
    if (aspectOf(c) >= limits.minAspect) return ElementClass::good;
    if (volumeSign(c[0], c[1], c[2], c[3]) == 0) return ElementClass::flat;
    return thinShapeOf(c, limits).shape;
}

std::int64_t ClassCounts::degenerate() const {
    std::int64_t sum = 0;
    for (std::size_t c = 1; c < kElementClasses; ++c) sum += of[c];
    return sum;
}

ClassCounts countClasses(const TetMesh& mesh, const ClassLimits& limits, const Execution& execution,
                         std::vector<std::int32_t>* degenerate) {
    struct Part {
        ClassCounts counts;
        std::vector<std::int32_t> degenerate;
    };
    const std::int64_t chunks = (mesh.elementCount() + kClassChunk - 1) / kClassChunk;
    std::vector<Part> parts{std::size_t(chunks)};
    parallelFor(execution, chunks, [&](std::int64_t chunk) {
        Part& part = parts[std::size_t(chunk)];
        const std::int64_t end = std::min(mesh.elementCount(), (chunk + 1) * kClassChunk);
        for (std::int64_t e = chunk * kClassChunk; e < end; ++e) {
            const ElementClass found = classOf(cornersOf(mesh, e), limits);
            ++part.counts.of[std::size_t(found)];
            if (found != ElementClass::good) part.degenerate.push_back(std::int32_t(e));
        }
    });
    ClassCounts all;
    for (const Part& part : parts) {
        for (std::size_t c = 0; c < kElementClasses; ++c) all.of[c] += part.counts.of[c];
        if (degenerate) degenerate->insert(degenerate->end(), part.degenerate.begin(), part.degenerate.end());
    }
    return all;
}

}  // namespace tessera
