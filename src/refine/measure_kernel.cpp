#include "refine/measure_kernel.h"

#include <limits>

#include "base/vector_targets.h"
#include "brick/seams.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "refine/measure_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::measure::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, kSumLanes>;
using V = hn::VFromD<D>;
using Floats = hn::Rebind<float, D>;
using Ints = hn::Rebind<std::int32_t, D>;

HWY_INLINE V load(const LaneDoubles& lanes, std::size_t i) {
    return hn::Load(D(), lanes.lane + i);
}
HWY_INLINE void store(V v, LaneDoubles& lanes, std::size_t i) {
    hn::Store(v, D(), lanes.lane + i);
}
HWY_INLINE void store(V v, LaneInts& lanes, std::size_t i) {
    hn::Store(hn::DemoteTo(Ints(), v), Ints(), lanes.lane + i);
}
HWY_INLINE V set(double value) {
    return hn::Set(D(), value);
}
HWY_INLINE auto isKept(const MeasureBatch& batch, std::size_t i) {
    return hn::Gt(load(batch.isKept, i), hn::Zero(D()));
}
HWY_INLINE auto isFinite(V v) {
    return hn::Le(hn::Abs(v), set(std::numeric_limits<double>::max()));
}
/// Calls body(i) for the first lane of every vector that holds a sample.
template <class Body>
HWY_INLINE void forVectors(const MeasureBatch& batch, const Body& body) {
    for (std::size_t i = 0; i < std::size_t(batch.count); i += hn::Lanes(D())) body(i);
}
HWY_INLINE void add(V v, LaneSums& sums, std::size_t i) {
    double* const lanes = sums.lane.data() + i % kSumLanes;
    hn::Store(hn::Add(hn::Load(D(), lanes), v), D(), lanes);
}

// As sixfoldVolume and SampledMesh::centroidWorld.
void placeElements(MeasureBatch& batch, const Vec3d& reference, const Vec3d& originWorld) {
    forVectors(batch, [&](std::size_t i) {
        V u[3], v[3], w[3];
        for (std::size_t a = 0; a < 3; ++a) {
            const V p0 = load(batch.nodeWorld[0][a], i), p1 = load(batch.nodeWorld[1][a], i),
                    p2 = load(batch.nodeWorld[2][a], i), p3 = load(batch.nodeWorld[3][a], i);
            u[a] = hn::Sub(p1, p0);
            v[a] = hn::Sub(p2, p0);
            w[a] = hn::Sub(p3, p0);
            const V from = set(reference[int(a)]);
            const V sum = hn::Add(hn::Add(hn::Sub(p0, from), hn::Sub(p1, from)),
                                  hn::Add(hn::Sub(p2, from), hn::Sub(p3, from)));
            store(hn::Add(hn::Mul(set(0.25), sum), set(reference[int(a)] - originWorld[int(a)])),
                  batch.place[a], i);
        }
        const V yz = hn::Mul(u[1], v[2]), zy = hn::Mul(u[2], v[1]), zx = hn::Mul(u[2], v[0]),
                xz = hn::Mul(u[0], v[2]), xy = hn::Mul(u[0], v[1]), yx = hn::Mul(u[1], v[0]);
        const V volume = hn::Add(hn::Add(hn::Mul(w[0], hn::Sub(yz, zy)), hn::Mul(w[1], hn::Sub(zx, xz))),
                                 hn::Mul(w[2], hn::Sub(xy, yx)));
        const V wx = hn::Abs(w[0]), wy = hn::Abs(w[1]), wz = hn::Abs(w[2]);
        const V sum = hn::Add(hn::Add(hn::Mul(wx, hn::Add(hn::Abs(yz), hn::Abs(zy))),
                                      hn::Mul(wy, hn::Add(hn::Abs(zx), hn::Abs(xz)))),
                              hn::Mul(wz, hn::Add(hn::Abs(xy), hn::Abs(yx))));
        const V bound = hn::Add(hn::Mul(set(10 * 0x1p-53), sum),
                                hn::Mul(set(0x1p-1000), hn::Add(hn::Add(hn::Add(wx, wy), wz), set(1))));
        store(volume, batch.sixfold, i);
        store(hn::IfThenElseZero(hn::Gt(hn::Abs(volume), bound), set(1)), batch.isCertain, i);
        const V size = hn::Div(hn::Abs(volume), set(6));
        const V least = set(std::numeric_limits<double>::denorm_min());
        store(hn::IfThenElse(hn::Lt(size, least), least, size), batch.volume, i);
    });
}

void locateCells(MeasureBatch& batch, int brickCells, int tilesPerEdge) {
    const V last = set(brickCells - 1), edge = set(tilesPerEdge), eight = set(8);
    forVectors(batch, [&](std::size_t i) {
        V tile = hn::Zero(D()), offset = hn::Zero(D()), beyond = hn::Zero(D()), least = last;
        for (std::size_t a = 0; a < 3; ++a) {
            const V local = load(batch.local[a], i);
            const V cell = hn::Floor(hn::Min(hn::Max(local, hn::Zero(D())), last));
            const V t = hn::Sub(local, cell);
            store(hn::IfThenElse(hn::Gt(t, set(1 - kOnLatticePlane)), set(1),
                                 hn::IfThenZeroElse(hn::Lt(t, set(kOnLatticePlane)), t)),
                  batch.fraction[a], i);
            const V ofTile = hn::Floor(hn::Mul(cell, set(0.125)));
            const V in = hn::Sub(cell, hn::Mul(ofTile, eight));
            tile = hn::Add(hn::Mul(tile, edge), ofTile);
            offset = hn::Add(hn::Mul(offset, eight), in);
            beyond = hn::Add(beyond, hn::IfThenElseZero(hn::Eq(in, set(7)), set(double(1 << a))));
            least = hn::Min(least, cell);
        }
        store(tile, batch.tile, i);
        store(offset, batch.offset, i);
        store(beyond, batch.beyond, i);
        store(least, batch.leastCell, i);
    });
}

void addDifference(const MeasureBatch& batch, const LaneFloats (&corners)[8], const LaneDoubles& exact,
                   bool isSquared, LaneDoubles& sum) {
    const V one = set(1);
    forVectors(batch, [&](std::size_t i) {
        V weight[3][2];
        for (std::size_t a = 0; a < 3; ++a) {
            weight[a][1] = load(batch.fraction[a], i);
            weight[a][0] = hn::Sub(one, weight[a][1]);
        }
        V value = hn::Zero(D());
        for (std::size_t c = 0; c < 8; ++c) {
            const V w = hn::Mul(hn::Mul(weight[0][c & 1], weight[1][c >> 1 & 1]), weight[2][c >> 2]);
            const V corner = hn::PromoteTo(D(), hn::Load(Floats(), corners[c].lane + i));
            value = hn::Add(value, hn::Mul(w, corner));
        }
        const V difference = hn::Sub(value, load(exact, i));
        const V part = isSquared ? hn::Mul(difference, difference) : hn::Abs(difference);
        store(hn::Add(load(sum, i), part), sum, i);
    });
}

void finishErrors(MeasureBatch& batch, bool isSquared, LaneDoubles& sum) {
    forVectors(batch, [&](std::size_t i) {
        const V error = isSquared ? hn::Sqrt(load(sum, i)) : load(sum, i);
        store(error, sum, i);
        store(hn::IfThenElseZero(isFinite(error), load(batch.isKept, i)), batch.isKept, i);
    });
}

double listErrors(const MeasureBatch& batch, const LaneDoubles& errors, double unit, LaneFloats& listed) {
    V largest = set(-1);
    forVectors(batch, [&](std::size_t i) {
        const V error = hn::IfThenElse(isKept(batch, i), load(errors, i), set(-1));
        largest = hn::Max(largest, error);
        const V share = hn::IfThenElse(isKept(batch, i), hn::Div(error, set(unit)), set(-1));
        hn::Store(hn::DemoteTo(Floats(), share), Floats(), listed.lane + i);
    });
    return hn::GetLane(hn::MaxOfLanes(D(), largest));
}

void addSquares(const MeasureBatch& batch, const LaneFloats& listed, double share, SquareSums& sums) {
    forVectors(batch, [&](std::size_t i) {
        const V error = hn::PromoteTo(D(), hn::Load(Floats(), listed.lane + i));
        const V ofLane = hn::Mul(set(share), load(batch.volume, i));
        const auto isMeasured = hn::And(hn::Ge(error, hn::Zero(D())), hn::Gt(ofLane, hn::Zero(D())));
        const V weight = hn::IfThenElseZero(isMeasured, ofLane), size = hn::IfThenElseZero(isMeasured, error);
        add(hn::Mul(hn::Mul(weight, size), size), sums.squares, i);
        add(weight, sums.weights, i);
    });
}

void addIntegral(const MeasureBatch& batch, const LaneDoubles& values, LaneSums& sums) {
    forVectors(batch, [&](std::size_t i) {
        const V value = load(values, i);
        add(hn::IfThenElseZero(isFinite(value), hn::Mul(load(batch.volume, i), value)), sums, i);
    });
}

}  // namespace tessera::measure::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::measure {

HWY_EXPORT(placeElements);
HWY_EXPORT(locateCells);
HWY_EXPORT(addDifference);
HWY_EXPORT(finishErrors);
HWY_EXPORT(listErrors);
HWY_EXPORT(addSquares);
HWY_EXPORT(addIntegral);

void placeElements(MeasureBatch& batch, const Vec3d& reference, const Vec3d& originWorld) {
    HWY_DYNAMIC_DISPATCH(placeElements)(batch, reference, originWorld);
}
void locateCells(MeasureBatch& batch, int brickCells, int tilesPerEdge) {
    HWY_DYNAMIC_DISPATCH(locateCells)(batch, brickCells, tilesPerEdge);
}
void addDifference(const MeasureBatch& batch, const LaneFloats (&corners)[8], const LaneDoubles& exact,
                   bool isSquared, LaneDoubles& sum) {
    HWY_DYNAMIC_DISPATCH(addDifference)(batch, corners, exact, isSquared, sum);
}
void finishErrors(MeasureBatch& batch, bool isSquared, LaneDoubles& sum) {
    HWY_DYNAMIC_DISPATCH(finishErrors)(batch, isSquared, sum);
}
double listErrors(const MeasureBatch& batch, const LaneDoubles& errors, double unit, LaneFloats& listed) {
    return HWY_DYNAMIC_DISPATCH(listErrors)(batch, errors, unit, listed);
}
void addSquares(const MeasureBatch& batch, const LaneFloats& listed, double share, SquareSums& sums) {
    HWY_DYNAMIC_DISPATCH(addSquares)(batch, listed, share, sums);
}
void addIntegral(const MeasureBatch& batch, const LaneDoubles& values, LaneSums& sums) {
    HWY_DYNAMIC_DISPATCH(addIntegral)(batch, values, sums);
}

}  // namespace tessera::measure
#endif
