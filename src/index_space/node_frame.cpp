#include "index_space/node_frame.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/large_pages.h"
#include "base/parallel.h"
#include "index_space/node_kernel.h"

namespace tessera {

namespace {

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

// The same of a lattice that isn't parallel to the axes.
void splitTurned(std::span<const Vec3d> placesWorld, const Lattice& lattice, SplitPlaces& split) {
    for (std::size_t i = 0; i < placesWorld.size(); ++i) {
        const std::array<Quad, 3> index = quadIndexFromWorld(lattice, placesWorld[i]);
        for (std::size_t a = 0; a < 3; ++a) {
            const Quad whole = floorOf(index[a]);
            split.whole[3 * i + a] = double(whole);
            split.part[3 * i + a] = double(index[a] - whole);
        }
    }
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
    const Vec3d spacingWorld{lattice.uWorld.x, lattice.vWorld.y, lattice.wWorld.z};
    const std::span<const Vec3d> points(mesh.points);
    parallelForChunks(execution, mesh.nodeCount(), 16384, [&](std::int64_t begin, std::int64_t end) {
        SplitPlaces split;
        for (std::int64_t first = begin; first < end; first += kNodeBatch) {
            const auto batch = points.subspan(std::size_t(first),
                                              std::size_t(std::min<std::int64_t>(kNodeBatch, end - first)));
            if (lattice.isAxisParallel())
                splitPlaces(batch, lattice.originWorld, spacingWorld, split);
            else
                splitTurned(batch, lattice, split);
            for (std::size_t i = 0; i < batch.size(); ++i) {
                const std::size_t n = std::size_t(first) + i;
                NodeFrame::Node& node = frame.nodes[n];
                NodeFrame::Rough& rough = frame.rough[n];
                for (std::size_t a = 0; a < 3; ++a) {
                    node.whole[a] = split.whole[3 * i + a];
                    node.part[a] = split.part[3 * i + a];
                    rough.index[a] = float(node.whole[a] + node.part[a]);
                }
                rough.index[3] = 0;
                for (int c = 0; c < frame.valueCount; ++c)
                    node.value[c] = channels[std::size_t(c)].at(std::int32_t(n));
            }
        }
    });
    return frame;
}

}  // namespace tessera
