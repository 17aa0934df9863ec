#include "index_space/node_frame.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/large_pages.h"
#include "base/parallel.h"

namespace tessera {

namespace {

// x = o + (whole + part) h along one axis. The difference x - o is split without error into t + tail, and the
// fused multiply-add (a correctly rounded operation, so the same on every processor) gives the remainder
// after whole spacings.
void splitAxis(double x, double o, double h, double& whole, double& part) {
    const double t = x - o;
    const double back = t - x;
    const double tail = (x - (t - back)) - (o + back);
    whole = std::floor(t / h);
    part = (std::fma(-whole, h, t) + tail) / h;
}

template <class Real>
std::array<Real, 3> cross(const std::array<Real, 3>& a, const std::array<Real, 3>& b) {
    return {Real(a[1] * b[2] - a[2] * b[1]), Real(a[2] * b[0] - a[0] * b[2]),
            Real(a[0] * b[1] - a[1] * b[0])};
}

template <class Real>
Real dot(const std::array<Real, 3>& a, const std::array<Real, 3>& b) {
    return Real(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

template <class Real>
std::array<Real, 3> convert(const Vec3d& v) {
    return {Real(v.x), Real(v.y), Real(v.z)};
}

template <class Real>
std::array<Real, 3> indexFromWorld(const Lattice& lattice, const Vec3d& pointWorld) {
    const auto x = convert<Real>(pointWorld), o = convert<Real>(lattice.originWorld);
    const std::array<Real, 3> t{Real(x[0] - o[0]), Real(x[1] - o[1]), Real(x[2] - o[2])};
    const auto u = convert<Real>(lattice.uWorld), v = convert<Real>(lattice.vWorld),
               w = convert<Real>(lattice.wWorld);
    if (lattice.isAxisParallel()) return {Real(t[0] / u[0]), Real(t[1] / v[1]), Real(t[2] / w[2])};
    const auto vw = cross(v, w), wu = cross(w, u), uv = cross(u, v);
    const Real det = dot(u, vw);
    return {Real(dot(t, vw) / det), Real(dot(t, wu) / det), Real(dot(t, uv) / det)};
}

Quad floorOf(Quad x) {
    // Index coordinates stay far below 2^62.
    const Quad whole = Quad(static_cast<long long>(x));
    return whole > x ? whole - 1 : whole;
}

}  // namespace

std::array<Quad, 3> quadIndexFromWorld(const Lattice& lattice, const Vec3d& pointWorld) {
    return indexFromWorld<Quad>(lattice, pointWorld);
}

std::array<mpq_class, 3> exactIndexFromWorld(const Lattice& lattice, const Vec3d& pointWorld) {
    return indexFromWorld<mpq_class>(lattice, pointWorld);
}

NodeFrame frameNodes(const TetMesh& mesh, const Lattice& lattice, const Execution& execution,
                     std::span<const ScanChannel> channels) {
    NodeFrame frame;
    while (frame.valueCount < int(std::min(channels.size(), std::size(NodeFrame::Node{}.value))) &&
           !channels[std::size_t(frame.valueCount)].cell)
        ++frame.valueCount;
    frame.lattice = lattice;
    resizeLarge(frame.nodes, mesh.points.size());
    resizeLarge(frame.rough, mesh.points.size());
    const bool axisParallel = lattice.isAxisParallel();
    const double spacing[3] = {lattice.uWorld.x, lattice.vWorld.y, lattice.wWorld.z};
    parallelForChunks(execution, mesh.nodeCount(), 16384, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t n = begin; n < end; ++n) {
            const Vec3d& x = mesh.points[std::size_t(n)];
            NodeFrame::Node& node = frame.nodes[std::size_t(n)];
            if (axisParallel) {
                for (int a = 0; a < 3; ++a)
                    splitAxis(x[a], lattice.originWorld[a], spacing[a], node.whole[a], node.part[a]);
            } else {
                const std::array<Quad, 3> index = quadIndexFromWorld(lattice, x);
                for (std::size_t a = 0; a < 3; ++a) {
                    const Quad whole = floorOf(index[a]);
                    node.whole[a] = double(whole);
                    node.part[a] = double(index[a] - whole);
                }
            }
            for (int c = 0; c < frame.valueCount; ++c)
                node.value[c] = channels[std::size_t(c)].at(std::int32_t(n));
            NodeFrame::Rough& rough = frame.rough[std::size_t(n)];
            for (int a = 0; a < 3; ++a) rough.index[a] = float(node.whole[a] + node.part[a]);
            rough.index[3] = 0;
        }
    });
    return frame;
}

}  // namespace tessera
