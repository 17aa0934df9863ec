#include "surface/exact_normal.h"

#include <cmath>

#include "mesh/geometry.h"

namespace tessera {

namespace {

/// The difference as a double, and whether that is exact. Based on: D. E. Knuth, The Art of Computer
/// Programming 2, section 4.2.2, theorem B.
struct Difference {
    Difference(double from, double to) : value(to - from) {
        const double fromRounded = to - value, toRounded = value + fromRounded;
        exact = (fromRounded - from) + (to - toRounded) == 0;
    }
    double value;
    bool exact = false;
};

/// Whether the product and its rounding error are doubles.
bool splitsExactly(double product, double factor, double other) {
    const double size = std::fabs(product);
    return (size > 0x1p-900 && size < 0x1p1000) || factor == 0 || other == 0;
}

int signOf(double value) {
    return (value > 0) - (value < 0);
}

}  // namespace

int normalSign(int axis, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double left = (b[u] - a[u]) * (c[v] - a[v]), right = (b[v] - a[v]) * (c[u] - a[u]);
    const double sign = left - right;
    // Each product passes three roundings and their difference one; 6 times 2^-53 leaves room for the
    // rounding of the bound. What underflows loses far less than the second term. Overflow makes both
    // comparisons false.
    const double bound = 6 * 0x1p-53 * (std::fabs(left) + std::fabs(right)) + 0x1p-1000;
    if (sign > bound) return 1;
    if (sign < -bound) return -1;

    // On regular grids points lie on one line often, and differences are exact. Rounding is monotonic, so
    // products that differ decide, and else what their rounding left.
    const Difference bu(a[u], b[u]), bv(a[v], b[v]), cu(a[u], c[u]), cv(a[v], c[v]);
    if (bu.exact && bv.exact && cu.exact && cv.exact && splitsExactly(left, bu.value, cv.value) &&
        splitsExactly(right, bv.value, cu.value)) {
        if (left != right) return left > right ? 1 : -1;
        return signOf(std::fma(bu.value, cv.value, -left) - std::fma(bv.value, cu.value, -right));
    }
    // The volume of the tetrahedron over the projected triangle with its top straight above.
    return volumeSign({a[u], a[v], 0}, {b[u], b[v], 0}, {c[u], c[v], 0}, {a[u], a[v], 1});
}

int mainAxis(const TriangleCorners& corners) {
    const auto& [a, b, c] = corners;
    const Vec3d normal = glm::abs(glm::cross(b - a, c - a));
    // Any of them where the normal is no number, by overflow.
    const int largest = normal.x >= normal.y && normal.x >= normal.z ? 0 : normal.y >= normal.z ? 1 : 2;
    for (int k = 0; k < 3; ++k) {
        const int axis = (largest + k) % 3;
        if (normalSign(axis, a, b, c) != 0) return axis;
    }
    return -1;
}

}  // namespace tessera
