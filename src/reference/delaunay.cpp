#include "reference/delaunay.h"

// Based on: A. Bowyer, Computing Dirichlet tessellations, and D. F. Watson, Computing the n-dimensional
// Delaunay tessellation with application to Voronoi polytopes, both The Computer Journal 24(2), 1981.
// Predicates are filtered: double with a bound after J. R. Shewchuk, Adaptive Precision Floating-Point
// Arithmetic and Fast Robust Geometric Predicates, 1997, else GMP.

#include <gmpxx.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/check.h"
#include "mesh/geometry.h"
#include "reference/generators.h"

namespace tessera {

namespace {

using Tet = std::array<std::int32_t, 4>;
using Face = std::array<std::int32_t, 3>;

template <class Number>
Number inSphereDeterminant(const std::array<std::array<Number, 3>, 4>& r) {
    const auto minor = [&](std::size_t i, std::size_t j, std::size_t k) {
        return Number(r[i][0] * (r[j][1] * r[k][2] - r[j][2] * r[k][1]) +
                      r[i][1] * (r[j][2] * r[k][0] - r[j][0] * r[k][2]) +
                      r[i][2] * (r[j][0] * r[k][1] - r[j][1] * r[k][0]));
    };
    const auto square = [&](std::size_t i) {
        return Number(r[i][0] * r[i][0] + r[i][1] * r[i][1] + r[i][2] * r[i][2]);
    };
    return square(0) * minor(1, 2, 3) - square(1) * minor(0, 2, 3) + square(2) * minor(0, 1, 3) -
           square(3) * minor(0, 1, 2);
}

/// p lies strictly inside the sphere through the nodes of a positive tet.
bool isInSphere(const std::array<Vec3d, 4>& at, const Vec3d& p) {
    std::array<std::array<double, 3>, 4> r;
    double square = 0, length = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const Vec3d d = at[i] - p;
        r[i] = {d.x, d.y, d.z};
        square = std::max(square, dot(d, d));
        length = std::max({length, std::abs(d.x), std::abs(d.y), std::abs(d.z)});
    }
    // 24 products of five factors, each below this size.
    const double bound = 24 * square * length * length * length * 1e-14;
    const double value = inSphereDeterminant(r);
    if (std::abs(value) > bound) return value > 0;
    std::array<std::array<mpq_class, 3>, 4> exact;
    for (std::size_t i = 0; i < 4; ++i)
        for (int a = 0; a < 3; ++a) exact[i][std::size_t(a)] = mpq_class(at[i][a]) - mpq_class(p[a]);
    return inSphereDeterminant(exact) > 0;
}

class Delaunay {
  public:
    explicit Delaunay(std::span<const Vec3d> points) : points_(points.begin(), points.end()) {
        const auto n = std::int32_t(points_.size());
        for (const Vec3d& p : points_)
            TESSERA_CHECK(glm::length(p) <= 100, "Delaunay points lie within 100 of the origin");
        constexpr double kFar = 1e4;
        points_.insert(
            points_.end(),
            {{kFar, kFar, kFar}, {kFar, -kFar, -kFar}, {-kFar, kFar, -kFar}, {-kFar, -kFar, kFar}});
        add({n, n + 1, n + 2, n + 3});
        for (std::int32_t p = 0; p < n; ++p) insert(p);
    }

    TetMesh mesh() const {
        TetMesh result;
        const auto n = std::int32_t(points_.size()) - 4;
        result.points.assign(points_.begin(), points_.end() - 4);
        for (const Tet& t : tets_)
            if (std::all_of(t.begin(), t.end(), [&](std::int32_t node) { return node < n; }))
                result.tets.push_back(t);
        return result;
    }

  private:
    const Vec3d& at(std::int32_t node) const { return points_[std::size_t(node)]; }

    void add(Tet tet) {
        const int sign = volumeSign(at(tet[0]), at(tet[1]), at(tet[2]), at(tet[3]));
        TESSERA_CHECK(sign != 0, "Delaunay points in general position make no flat tets");
        if (sign < 0) std::swap(tet[2], tet[3]);
        tets_.push_back(tet);
    }

    /// Replaces the tets whose spheres hold the point by a fan from the point to the cavity's faces.
    void insert(std::int32_t point) {
        std::map<Face, int> faces;
        std::size_t kept = 0;
        for (const Tet& t : tets_) {
            if (!isInSphere({at(t[0]), at(t[1]), at(t[2]), at(t[3])}, at(point))) {
                tets_[kept++] = t;
                continue;
            }
            for (std::size_t i = 0; i < 4; ++i) {
                Face face{t[(i + 1) % 4], t[(i + 2) % 4], t[(i + 3) % 4]};
                std::sort(face.begin(), face.end());
                ++faces[face];
            }
        }
        TESSERA_CHECK(kept < tets_.size(), "a Delaunay point lies in some sphere");
        tets_.resize(kept);
        for (const auto& [face, count] : faces)
            if (count == 1) add({face[0], face[1], face[2], point});
    }

    std::vector<Vec3d> points_;
    std::vector<Tet> tets_;
};

}  // namespace

TetMesh delaunayMesh(std::span<const Vec3d> points) {
    return Delaunay(points).mesh();
}

}  // namespace tessera
