#include "index_space/near_kernel.h"

#include "base/vector_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "index_space/near_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef TESSERA_NEAR_KERNEL_COMMON
#define TESSERA_NEAR_KERNEL_COMMON
namespace tessera::near_kernel {

/// Nodes may lie anywhere; what is beyond every lattice index is cut to just beyond it, so that it fits an
/// int.
inline constexpr float kFarthest = 0x1p30f + 2048.0f;
/// Elements longer than this (voxels) may overflow; they are kept.
inline constexpr float kLongest = 64.0f;

/// The places of a batch's nodes, side by side.
struct alignas(64) NodePlaces {
    NodeFrame::Rough node[4][kNearBatch];
};

struct Request {
    std::int32_t first;
    int count;
    const NearGrid& grid;
    const NearTest& test;
};

}  // namespace tessera::near_kernel
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::near_kernel::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;
using V = hn::VFromD<D>;
using Ints = hn::RebindToSigned<D>;
using I = hn::VFromD<Ints>;

HWY_INLINE V set(float value) {
    return hn::Set(D(), value);
}

struct Place {
    V axis[3];
};
HWY_INLINE Place operator-(const Place& a, const Place& b) {
    return {hn::Sub(a.axis[0], b.axis[0]), hn::Sub(a.axis[1], b.axis[1]), hn::Sub(a.axis[2], b.axis[2])};
}
HWY_INLINE V dot(const Place& a, const Place& b) {
    return hn::Add(hn::Add(hn::Mul(a.axis[0], b.axis[0]), hn::Mul(a.axis[1], b.axis[1])),
                   hn::Mul(a.axis[2], b.axis[2]));
}
HWY_INLINE Place cross(const Place& a, const Place& b) {
    const auto minor = [&](int i, int j) {
        return hn::Sub(hn::Mul(a.axis[i], b.axis[j]), hn::Mul(a.axis[j], b.axis[i]));
    };
    return {minor(1, 2), minor(2, 0), minor(0, 1)};
}

// True for the lanes whose elements surely hold none of the eight lattice points that follow the first.
//
// The element's barycentrics times its sixfold volume are computed relative to the first point. With places
// off by e = u |place|, an element of extent X and u = 2^-24 they are off by less than 216 e X^2 + 660 u X^3
// where the point lies in the bounding box, which is what has to hold; and a point that the scan takes as
// covered is no further than 2^-26 voxel outside the element, 14 X^2 2^-26 here.
HWY_INLINE auto liesBetween(const Place (&node)[4], const I (&first)[3], V extent, V farthest) {
    const D d;
    const Place origin{hn::ConvertTo(d, first[0]), hn::ConvertTo(d, first[1]), hn::ConvertTo(d, first[2])};
    const Place toFirst = origin - node[0];
    const Place a = node[1] - node[0], b = node[2] - node[0], c = node[3] - node[0];
    Place normal[4] = {Place(), cross(b, c), cross(c, a), cross(a, b)};
    const V volume = dot(a, normal[1]);
    const V error =
        hn::Mul(hn::Mul(extent, extent),
                hn::Add(hn::Mul(set(0x1p-16f), hn::Add(farthest, set(2))), hn::Mul(set(0x1p-14f), extent)));
    const V sign = hn::CopySign(set(1), volume);
    V share[4];
    for (int k = 1; k < 4; ++k) {
        for (V& n : normal[k].axis) n = hn::Mul(n, sign);
        share[k] = dot(normal[k], toFirst);
    }
    for (int i = 0; i < 3; ++i)
        normal[0].axis[i] =
            hn::Neg(hn::Add(hn::Add(normal[1].axis[i], normal[2].axis[i]), normal[3].axis[i]));
    share[0] = hn::Sub(hn::Abs(volume), hn::Add(hn::Add(share[1], share[2]), share[3]));
    V least[8];
    for (int k = 0; k < 4; ++k)
        for (int z = 0; z < 2; ++z) {
            const V atZ = z == 0 ? share[k] : hn::Add(share[k], normal[k].axis[2]);
            for (int y = 0; y < 2; ++y) {
                const V atY = y == 0 ? atZ : hn::Add(atZ, normal[k].axis[1]);
                for (int x = 0; x < 2; ++x) {
                    const V at = x == 0 ? atY : hn::Add(atY, normal[k].axis[0]);
                    V& ofPoint = least[4 * z + 2 * y + x];
                    ofPoint = k == 0 ? at : hn::Min(ofPoint, at);
                }
            }
        }
    V most = least[0];
    for (int p = 1; p < 8; ++p) most = hn::Max(most, least[p]);
    return hn::And(hn::And(hn::Lt(most, hn::Neg(error)), hn::Gt(hn::Abs(volume), error)),
                   hn::Le(extent, set(kLongest)));
}

void findNear(const Request& request, const NodePlaces& places, NearElements& near) {
    const D d;
    const Ints di;
    const int lanes = int(hn::Lanes(d));
    near.count = 0;
    for (int at = 0; at < request.count; at += lanes) {
        Place node[4];
        for (int k = 0; k < 4; ++k) {
            V unused;
            hn::LoadInterleaved4(d, places.node[k][at].index, node[k].axis[0], node[k].axis[1],
                                 node[k].axis[2], unused);
        }
        auto some = hn::FirstN(di, std::size_t(request.count - at));
        auto isSmall = hn::Eq(hn::Zero(di), hn::Zero(di)), isInCell = isSmall;
        I low[3], high[3], cell[3];
        V extent = hn::Zero(d), farthest = hn::Zero(d);
        for (int a = 0; a < 3; ++a) {
            const V n0 = node[0].axis[a], n1 = node[1].axis[a], n2 = node[2].axis[a], n3 = node[3].axis[a];
            const V least = hn::Min(hn::Min(n0, n1), hn::Min(n2, n3));
            const V most = hn::Max(hn::Max(n0, n1), hn::Max(n2, n3));
            const auto slack = [&](V x) {
                return hn::Add(hn::Mul(hn::Abs(x), set(0x1p-22f)), set(0x1p-26f + request.test.marginVoxels));
            };
            const auto cut = [](V x) { return hn::Max(hn::Min(x, set(kFarthest)), set(-kFarthest)); };
            const I from = hn::ConvertTo(di, hn::Ceil(cut(hn::Sub(least, slack(least)))));
            const I to = hn::ConvertTo(di, hn::Floor(cut(hn::Add(most, slack(most)))));
            low[a] = hn::Max(from, hn::Set(di, request.grid.box.min[a]));
            high[a] = hn::Min(to, hn::Set(di, request.grid.box.max[a] - 1));
            some = hn::AndNot(hn::Gt(low[a], high[a]), some);
            isSmall = hn::AndNot(hn::Gt(high[a], hn::Add(low[a], hn::Set(di, 1))), isSmall);
            const auto cellOf = [&](I v) {
                return hn::ShiftRightSame(hn::Sub(v, hn::Set(di, request.grid.box.min[a])),
                                          request.grid.shift[a]);
            };
            cell[a] = cellOf(low[a]);
            isInCell = hn::And(isInCell, hn::Eq(cell[a], cellOf(high[a])));
            extent = hn::Max(extent, hn::Sub(most, least));
            farthest = hn::Max(farthest, hn::Max(hn::Abs(least), hn::Abs(most)));
        }
        if (request.test.dropsBetween) {
            isSmall = hn::And(isSmall, some);
            if (!hn::AllFalse(di, isSmall))
                some = hn::AndNot(
                    hn::And(isSmall, hn::RebindMask(di, liesBetween(node, low, extent, farthest))), some);
        }
        const auto keep = [&](I v, std::int32_t* list) {
            hn::StoreU(hn::Compress(v, some), di, list + near.count);
        };
        for (int a = 0; a < 3; ++a) {
            keep(low[a], near.low[a]);
            keep(high[a], near.high[a]);
        }
        const I row = hn::Add(hn::Mul(cell[2], hn::Set(di, request.grid.cells.y)), cell[1]);
        const I index = hn::Add(hn::Mul(row, hn::Set(di, request.grid.cells.x)), cell[0]);
        keep(hn::IfThenElse(isInCell, index, hn::Set(di, -1)), near.cell);
        keep(hn::Iota(di, request.first + at), near.element);
        near.count += int(hn::CountTrue(di, some));
    }
}

}  // namespace tessera::near_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::near_kernel {

HWY_EXPORT(findNear);

void run(const Request& request, const NodePlaces& places, NearElements& near) {
    HWY_DYNAMIC_DISPATCH(findNear)(request, places, near);
}

}  // namespace tessera::near_kernel

namespace tessera {

void findNear(const TetMesh& mesh, std::span<const NodeFrame::Rough> rough, std::int64_t first, int count,
              const NearGrid& grid, const NearTest& test, NearElements& near) {
    near_kernel::NodePlaces places;
    for (int i = 0; i < count; ++i) {
        const std::array<std::int32_t, 4>& tet = mesh.tets[std::size_t(first + i)];
        for (std::size_t k = 0; k < 4; ++k) places.node[k][i] = rough[std::size_t(tet[k])];
    }
    near_kernel::run({std::int32_t(first), count, grid, test}, places, near);
}

}  // namespace tessera
#endif
