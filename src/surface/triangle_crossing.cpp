#include "surface/triangle_crossing.h"

#include <algorithm>
#include <span>

#include "mesh/geometry.h"
#include "surface/exact_normal.h"

// Which side of a plane or a line points lie on decides everything, as in P. Guigue and O. Devillers, Fast
// and Robust Triangle-Triangle Overlap Test Using Orientation Predicates, Journal of Graphics Tools 8, 2003.

namespace tessera {

namespace {

/// As volumeSign where double is enough, else 0.
int quickSide(const TriangleCorners& t, const Vec3d& point) {
    const SixfoldVolume sixfold = sixfoldVolume(t[0], t[1], t[2], point);
    return (sixfold.value > sixfold.errorBound) - (sixfold.value < -sixfold.errorBound);
}

/// Whether all points lie strictly on one side of a triangle's plane, as far as double can tell.
bool onOneSide(const TriangleCorners& t, std::span<const Vec3d> points) {
    const int side = quickSide(t, points[0]);
    if (side == 0) return false;
    for (const Vec3d& point : points.subspan(1))
        if (quickSide(t, point) != side) return false;
    return true;
}

/// Whether, seen along an axis, one edge of the triangle has all the points strictly on its far side.
bool edgeSeparates(int axis, const TriangleCorners& t, std::span<const Vec3d> points) {
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3d &from = t[k], &to = t[(k + 1) % 3];
        const int inner = normalSign(axis, from, to, t[(k + 2) % 3]);
        if (inner == 0) return false;
        bool outside = true;
        for (const Vec3d& point : points) outside = outside && normalSign(axis, from, to, point) == -inner;
        if (outside) return true;
    }
    return false;
}

/// Whether two angles with the same tip have, seen along an axis, only that in common because a line along a
/// side of the first parts them.
bool sideParts(int axis, const Vec3d& tip, const std::array<Vec3d, 2>& first,
               const std::array<Vec3d, 2>& second) {
    for (std::size_t k = 0; k < 2; ++k) {
        const int inner = normalSign(axis, tip, first[k], first[1 - k]);
        if (inner == 0) return false;
        const int c = normalSign(axis, tip, first[k], second[0]);
        const int d = normalSign(axis, tip, first[k], second[1]);
        if (c == inner || d == inner || (c == 0 && d == 0)) continue;
        if (c != 0 && d != 0) return true;
        // One lies on the line: the angles have but the tip in common when it is behind that.
        const Vec3d& onLine = c == 0 ? second[0] : second[1];
        for (const int u : {(axis + 1) % 3, (axis + 2) % 3})
            if (first[k][u] != tip[u] && onLine[u] != tip[u] &&
                (first[k][u] > tip[u]) != (onLine[u] > tip[u]))
                return true;
    }
    return false;
}

/// Whether two segments in one plane meet, both with their ends; seen along an axis that isn't in the plane.
bool segmentsMeet(int axis, const Vec3d& p, const Vec3d& q, const Vec3d& a, const Vec3d& b) {
    const int sa = normalSign(axis, p, q, a), sb = normalSign(axis, p, q, b);
    if (sa * sb > 0) return false;
    if (sa == 0 && sb == 0) {  // on one line: when their boxes meet
        for (const int u : {(axis + 1) % 3, (axis + 2) % 3})
            if (std::max(p[u], q[u]) < std::min(a[u], b[u]) || std::max(a[u], b[u]) < std::min(p[u], q[u]))
                return false;
        return true;
    }
    return normalSign(axis, a, b, p) * normalSign(axis, a, b, q) <= 0;
}

/// Whether a segment in the triangle's plane meets it.
bool segmentMeetsInPlane(const Vec3d& p, const Vec3d& q, const TriangleCorners& t) {
    const int axis = mainAxis(t);
    const int way = normalSign(axis, t[0], t[1], t[2]);
    bool holdsP = true;
    for (std::size_t k = 0; k < 3; ++k) {
        const Vec3d &from = t[k], &to = t[(k + 1) % 3];
        if (segmentsMeet(axis, p, q, from, to)) return true;
        holdsP = holdsP && normalSign(axis, from, to, p) == way;
    }
    return holdsP;
}

/// Whether a segment meets a triangle, both with their borders.
bool segmentMeets(const Vec3d& p, const Vec3d& q, const TriangleCorners& t) {
    const int sp = volumeSign(t[0], t[1], t[2], p), sq = volumeSign(t[0], t[1], t[2], q);
    if (sp * sq > 0) return false;
    if (sp == 0 && sq == 0) return segmentMeetsInPlane(p, q, t);
    // The segment's line passes through the plane at one point, which is in the triangle when the edges run
    // one way around it.
    int least = 1, most = -1;
    for (std::size_t k = 0; k < 3; ++k) {
        const int way = volumeSign(p, q, t[k], t[(k + 1) % 3]);
        least = std::min(least, way);
        most = std::max(most, way);
        if (least < 0 && most > 0) return false;
    }
    return true;
}

bool crossApart(const TriangleCorners& t, const TriangleCorners& o) {
    if (onOneSide(t, o) || onOneSide(o, t)) return false;
    const int axis = mainAxis(t);
    if (edgeSeparates(axis, t, o) || edgeSeparates(axis, o, t)) return false;
    // An end of what they have in common lies on an edge of one of them.
    for (std::size_t k = 0; k < 3; ++k)
        if (segmentMeets(t[k], t[(k + 1) % 3], o) || segmentMeets(o[k], o[(k + 1) % 3], t)) return true;
    return false;
}

bool crossAtCorner(const Vec3d& tip, const std::array<Vec3d, 2>& ends, const std::array<Vec3d, 2>& others) {
    const TriangleCorners t{tip, ends[0], ends[1]}, o{tip, others[0], others[1]};
    if (onOneSide(t, others) || onOneSide(o, ends)) return false;
    const int axis = mainAxis(t);
    if (sideParts(axis, tip, ends, others) || sideParts(axis, tip, others, ends)) return false;
    // A ray from the tip through another point in common leaves the first of them that it leaves through the
    // edge opposite to the tip.
    return segmentMeets(ends[0], ends[1], o) || segmentMeets(others[0], others[1], t);
}

/// Two triangles p, q, a and p, q, b cross when they lie in one plane on the same side of the edge p, q.
bool crossAtEdge(const Vec3d& p, const Vec3d& q, const Vec3d& a, const Vec3d& b) {
    const TriangleCorners t{p, q, a};
    if (quickSide(t, b) != 0) return false;
    const int axis = mainAxis(t);
    return normalSign(axis, p, q, a) == normalSign(axis, p, q, b) && volumeSign(p, q, a, b) == 0;
}

}  // namespace

bool trianglesCross(const Surface& surface, std::int64_t first, std::int64_t second) {
    const auto& t = surface.triangles[std::size_t(first)];
    const auto& o = surface.triangles[std::size_t(second)];
    const TriangleCorners a = cornersOf(surface, first), b = cornersOf(surface, second);
    std::size_t shared = 0, at = 0, otherAt = 0;
    std::array<bool, 3> isShared{}, isOtherShared{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            if (t[i] == o[j]) {
                isShared[i] = isOtherShared[j] = true;
                at = i, otherAt = j;
                ++shared;
            }
    if (shared == 0) return crossApart(a, b);
    if (shared == 1)
        return crossAtCorner(a[at], {a[(at + 1) % 3], a[(at + 2) % 3]},
                             {b[(otherAt + 1) % 3], b[(otherAt + 2) % 3]});
    if (shared == 3) return false;
    std::size_t lone = 0, otherLone = 0;
    while (isShared[lone]) ++lone;
    while (isOtherShared[otherLone]) ++otherLone;
    return crossAtEdge(a[(lone + 1) % 3], a[(lone + 2) % 3], a[lone], b[otherLone]);
}

}  // namespace tessera
