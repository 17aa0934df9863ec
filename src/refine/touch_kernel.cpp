#include "refine/touch_kernel.h"

#include "base/vector_targets.h"
#include "brick/overlap.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "refine/touch_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::touch::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, 8>;
using V = hn::VFromD<D>;
using M = hn::Mask<D>;

/// An element and a box around the origin, in every lane.
struct Pair {
    V corner[4][3], half[3], reach;
};

/// Whether the shadows on an axis lie apart, as areApartOn; the axis has `Count` components that aren't 0,
/// those of `at`. Adding zeros would change nothing.
template <std::size_t Count>
HWY_INLINE M areApartOn(const Pair& pair, const V (&axis)[Count], const std::size_t (&at)[Count]) {
    const auto dot = [&](const V(&v)[3]) {
        V sum = hn::Mul(axis[0], v[at[0]]);
        for (std::size_t a = 1; a < Count; ++a) sum = hn::Add(sum, hn::Mul(axis[a], v[at[a]]));
        return sum;
    };
    V low = dot(pair.corner[0]), high = low, largest = hn::Abs(low);
    for (std::size_t i = 1; i < 4; ++i) {
        const V d = dot(pair.corner[i]);
        low = hn::Min(d, low);
        high = hn::Max(d, high);
        largest = hn::Max(hn::Abs(d), largest);
    }
    V size = hn::Abs(axis[0]), radius = hn::Mul(size, pair.half[at[0]]);
    for (std::size_t a = 1; a < Count; ++a) {
        radius = hn::Add(radius, hn::Mul(hn::Abs(axis[a]), pair.half[at[a]]));
        size = hn::Add(size, hn::Abs(axis[a]));
    }
    const V scale = hn::Max(hn::Mul(size, pair.reach), hn::Max(radius, largest));
    const V tolerance = hn::Mul(hn::Set(D(), kShadowTolerance), scale);
    return hn::Or(hn::Gt(low, hn::Add(radius, tolerance)), hn::Lt(high, hn::Sub(hn::Neg(radius), tolerance)));
}

HWY_INLINE void difference(const V (&b)[3], const V (&a)[3], V (&result)[3]) {
    for (std::size_t i = 0; i < 3; ++i) result[i] = hn::Sub(b[i], a[i]);
}

HWY_INLINE M isFaceApart(const Pair& pair, std::size_t a, std::size_t b, std::size_t c) {
    V u[3], v[3], normal[3];
    difference(pair.corner[b], pair.corner[a], u);
    difference(pair.corner[c], pair.corner[a], v);
    for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
        normal[i] = hn::Sub(hn::Mul(u[j], v[k]), hn::Mul(v[j], u[k]));
    }
    return areApartOn(pair, normal, {0, 1, 2});
}

HWY_INLINE M isEdgeApart(const Pair& pair, std::size_t a, std::size_t b) {
    V edge[3];
    difference(pair.corner[b], pair.corner[a], edge);
    const V ofX[2] = {hn::Neg(edge[2]), edge[1]}, ofY[2] = {edge[2], hn::Neg(edge[0])},
            ofZ[2] = {hn::Neg(edge[1]), edge[0]};
    return hn::Or(hn::Or(areApartOn(pair, ofX, {1, 2}), areApartOn(pair, ofY, {0, 2})),
                  areApartOn(pair, ofZ, {0, 1}));
}

std::uint64_t touching(const TouchBatch& batch) {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < batch.count; i += hn::Lanes(D())) {
        Pair pair;
        for (std::size_t a = 0; a < 3; ++a) pair.half[a] = hn::Load(D(), batch.half[a] + i);
        M isInside = hn::Lt(hn::Zero(D()), hn::Zero(D()));  // a node well inside settles it
        for (std::size_t k = 0; k < 4; ++k) {
            M isOwn = hn::Eq(hn::Zero(D()), hn::Zero(D()));
            for (std::size_t a = 0; a < 3; ++a) {
                pair.corner[k][a] = hn::Load(D(), batch.corner[k][a] + i);
                isOwn = hn::And(isOwn, hn::Lt(hn::Abs(pair.corner[k][a]), pair.half[a]));
            }
            isInside = hn::Or(isInside, isOwn);
        }
        const V(&c)[3] = pair.corner[0];
        pair.reach =
            hn::Sqrt(hn::Add(hn::Add(hn::Mul(c[0], c[0]), hn::Mul(c[1], c[1])), hn::Mul(c[2], c[2])));
        M isApart = hn::Or(hn::Or(isFaceApart(pair, 0, 1, 2), isFaceApart(pair, 0, 1, 3)),
                           hn::Or(isFaceApart(pair, 0, 2, 3), isFaceApart(pair, 1, 2, 3)));
        for (std::size_t a = 0; a < 4; ++a)
            for (std::size_t b = a + 1; b < 4; ++b) {
                if (hn::AllTrue(D(), hn::Or(isInside, isApart))) break;
                isApart = hn::Or(isApart, isEdgeApart(pair, a, b));
            }
        std::uint8_t bytes[8] = {};
        hn::StoreMaskBits(D(), hn::Or(isInside, hn::Not(isApart)), bytes);
        bits |= std::uint64_t(bytes[0]) << i;
    }
    return bits & (~std::uint64_t(0) >> (kTouchLanes - batch.count));
}

}  // namespace tessera::touch::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

namespace touch {
HWY_EXPORT(touching);
}

void TouchBatch::add(const std::array<Vec3d, 4>& nodes, const Box3d& box) {
    const Vec3d centre = 0.5 * (box.min + box.max), halfSize = 0.5 * (box.max - box.min);
    for (int a = 0; a < 3; ++a) {
        for (std::size_t k = 0; k < 4; ++k) corner[k][a][count] = nodes[k][a] - centre[a];
        half[a][count] = halfSize[a];
    }
    ++count;
}

std::uint64_t touching(const TouchBatch& batch) {
    if (batch.count == 0) return 0;
    return HWY_DYNAMIC_DISPATCH(touch::touching)(batch);
}

}  // namespace tessera
#endif
