#include "index_space/node_kernel.h"

#include <cmath>
#include <cstddef>

#include "base/vector_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "index_space/node_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::node_kernel::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, 8>;
using V = hn::VFromD<D>;

// a - b c, rounded once.
HWY_INLINE V fusedDifference(V a, V b, V c) {
#if HWY_NATIVE_FMA
    return hn::NegMulAdd(b, c, a);
#else
    const D d;
    double of[3][8];
    hn::StoreU(a, d, of[0]);
    hn::StoreU(b, d, of[1]);
    hn::StoreU(c, d, of[2]);
    for (std::size_t i = 0; i < hn::Lanes(d); ++i) of[0][i] = std::fma(-of[1][i], of[2][i], of[0][i]);
    return hn::LoadU(d, of[0]);
#endif
}

// x = o + (whole + part) h, with x where whole shall be. The difference x - o is split without error into t +
// tail, and the fused multiply-add (a correctly rounded operation, so the same on every processor) gives the
// remainder after whole spacings.
void split(std::size_t count, const double* origins, const double* spacings, SplitPlaces& split) {
    const D d;
    const std::size_t lanes = hn::Lanes(d);
    for (std::size_t i = 0; i < count; i += lanes) {
        // The axes come round after three vectors.
        const std::size_t turn = i % (3 * lanes);
        const V o = hn::LoadU(d, origins + turn), h = hn::LoadU(d, spacings + turn);
        const V place = hn::Load(d, split.whole + i);
        const V t = hn::Sub(place, o);
        const V back = hn::Sub(t, place);
        const V tail = hn::Sub(hn::Sub(place, hn::Sub(t, back)), hn::Add(o, back));
        const V whole = hn::Floor(hn::Div(t, h));
        hn::Store(whole, d, split.whole + i);
        hn::Store(hn::Div(hn::Add(fusedDifference(t, whole, h), tail), h), d, split.part + i);
    }
}

}  // namespace tessera::node_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

namespace node_kernel {
HWY_EXPORT(split);
void run(std::size_t count, const double* origins, const double* spacings, SplitPlaces& places) {
    HWY_DYNAMIC_DISPATCH(split)(count, origins, spacings, places);
}
}  // namespace node_kernel

void splitPlaces(std::span<const Vec3d> placesWorld, const Vec3d& originWorld, const Vec3d& spacingWorld,
                 SplitPlaces& split) {
    double origins[24], spacings[24];
    for (int i = 0; i < 24; ++i) {
        origins[i] = originWorld[i % 3];
        spacings[i] = spacingWorld[i % 3];
    }
    for (std::size_t i = 0; i < placesWorld.size(); ++i)
        for (int a = 0; a < 3; ++a) split.whole[3 * i + std::size_t(a)] = placesWorld[i][a];
    node_kernel::run(3 * placesWorld.size(), origins, spacings, split);
}

}  // namespace tessera
#endif
