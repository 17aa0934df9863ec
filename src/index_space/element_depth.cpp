#include "index_space/element_depth.h"

#include <algorithm>
#include <cmath>

namespace tessera {

namespace {

constexpr double kDouble = 0x1p-53;
constexpr double kQuad = 0x1p-112;
constexpr double kDepthAccuracy = 0x1p-16;

double magnitude(double x) {
    return std::fabs(x);
}
Quad magnitude(Quad x) {
    return x < 0 ? -x : x;
}

// Face planes from nodes relative to the first voxel. False when rounding could move a plane by more than
// kDepthAccuracy.
template <class Real>
bool facePlanes(const Real (&v)[4][3], double unit, double (&normal)[4][3], double (&offset)[4]) {
    double size = 0;
    for (int a = 0; a < 3; ++a) {
        Real low = v[0][a], high = v[0][a];
        for (int k = 1; k < 4; ++k) {
            if (v[k][a] < low) low = v[k][a];
            if (v[k][a] > high) high = v[k][a];
        }
        size = std::max(size, double(high - low));
    }
    for (int face = 0; face < 4; ++face) {
        const Real(&a)[3] = v[(face + 1) & 3];
        const Real(&b)[3] = v[(face + 2) & 3];
        const Real(&c)[3] = v[(face + 3) & 3];
        Real p[3], q[3], n[3];
        for (int i = 0; i < 3; ++i) {
            p[i] = b[i] - a[i];
            q[i] = c[i] - a[i];
        }
        for (int i = 0; i < 3; ++i) n[i] = p[(i + 1) % 3] * q[(i + 2) % 3] - p[(i + 2) % 3] * q[(i + 1) % 3];
        // Scale first: the squares of a tiny normal would underflow in double.
        const Real largest = std::max({magnitude(n[0]), magnitude(n[1]), magnitude(n[2])});
        if (!(double(largest) > 0)) return false;
        double unitNormal[3];
        for (int i = 0; i < 3; ++i) unitNormal[i] = double(n[i] / largest);
        const double length = std::sqrt(unitNormal[0] * unitNormal[0] + unitNormal[1] * unitNormal[1] +
                                        unitNormal[2] * unitNormal[2]);
        const double error = 64.0 * unit * size * size * (size + 1) / (double(largest) * length);
        if (!(error <= kDepthAccuracy)) return false;
        // The plane passes through node a; the opposite node lies on the inner side.
        Real inner = 0;
        for (int i = 0; i < 3; ++i) inner += n[i] * (v[face][i] - a[i]);
        const double sign = inner < 0 ? -1.0 : 1.0;
        double at = 0;
        for (int i = 0; i < 3; ++i) {
            normal[face][i] = sign * unitNormal[i] / length;
            at += normal[face][i] * double(a[i]);
        }
        offset[face] = -at;
    }
    return true;
}

}  // namespace

ElementDepth::ElementDepth(const TetMesh& mesh, const NodeFrame& frame, std::int32_t element) {
    const auto& tet = mesh.tets[std::size_t(element)];
    for (int a = 0; a < 3; ++a) {
        base_[a] = frame.nodes[std::size_t(tet[0])].whole[a];
        for (std::size_t k = 1; k < 4; ++k)
            base_[a] = std::min(base_[a], frame.nodes[std::size_t(tet[k])].whole[a]);
    }
    double v[4][3];
    for (std::size_t k = 0; k < 4; ++k) {
        const NodeFrame::Node& node = frame.nodes[std::size_t(tet[k])];
        for (int a = 0; a < 3; ++a) v[k][a] = (node.whole[a] - base_[a]) + node.part[a];
    }
    if (facePlanes(v, kDouble, normal_, offset_)) return;
    Quad q[4][3];
    for (std::size_t k = 0; k < 4; ++k) {
        const auto index = quadIndexFromWorld(frame.lattice, mesh.points[std::size_t(tet[k])]);
        for (std::size_t a = 0; a < 3; ++a) q[k][a] = index[a] - Quad(base_[a]);
    }
    thin_ = !facePlanes(q, kQuad, normal_, offset_);
}

double ElementDepth::at(const Vec3i& point) const {
    if (thin_) return 0.0;
    const double x = point.x - base_[0], y = point.y - base_[1], z = point.z - base_[2];
    double depth = INFINITY;
    for (int face = 0; face < 4; ++face) {
        const double d =
            ((normal_[face][0] * x + normal_[face][1] * y) + normal_[face][2] * z) + offset_[face];
        if (d < depth) depth = d;
    }
    return depth;
}

double ElementDepth::rank(const Vec3i& point) const {
    return std::floor(at(point) * 0x1p13 + 0.5);
}

}  // namespace tessera
