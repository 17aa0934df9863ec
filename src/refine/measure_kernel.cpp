#include "refine/measure_kernel.h"

#include <algorithm>
#include <cstring>
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
template <class Tag>
HWY_INLINE auto maskOf(Tag tag, LaneBits bits, std::size_t i) {
    const LaneBits ofVector = bits >> i;
    std::uint8_t bytes[sizeof ofVector];
    std::memcpy(bytes, &ofVector, sizeof ofVector);
    return hn::LoadMaskBits(tag, bytes);
}
template <class Tag, class Mask>
HWY_INLINE LaneBits bitsOf(Tag tag, Mask mask, std::size_t i) {
    std::uint8_t bytes[sizeof(LaneBits)] = {};
    hn::StoreMaskBits(tag, mask, bytes);
    return LaneBits(bytes[0]) << i;
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

HWY_INLINE void load(const FourDoubles* quads, std::size_t i, V (&v)[4]) {
    hn::LoadInterleaved4(D(), quads[i].number.data(), v[0], v[1], v[2], v[3]);
}

void gatherNodes(MeasureBatch& batch, const FourDoubles* nodes) {
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i)
        for (std::size_t k = 0; k < 4; ++k) batch.node[k][i] = nodes[batch.tet[i][k]];
}

void placeNodes(MeasureBatch& batch, const Vec3d& originWorld, LaneDoubles& values) {
    forVectors(batch, [&](std::size_t i) {
        V p[4];
        load(batch.node[0], i, p);
        for (std::size_t a = 0; a < 3; ++a) store(hn::Sub(p[a], set(originWorld[int(a)])), batch.place[a], i);
        store(p[3], values, i);
    });
}

// As sixfoldVolume, SampledMesh::centroidWorld and SampledMesh::exactValue.
ElementSigns placeElements(MeasureBatch& batch, const Vec3d& reference, const Vec3d& originWorld,
                           LaneDoubles& values) {
    ElementSigns signs{0, 0};
    forVectors(batch, [&](std::size_t i) {
        V node[4][4], u[3], v[3], w[3];
        for (std::size_t k = 0; k < 4; ++k) load(batch.node[k], i, node[k]);
        for (std::size_t a = 0; a < 3; ++a) {
            const V p0 = node[0][a], p1 = node[1][a], p2 = node[2][a], p3 = node[3][a];
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
        // Not a number isn't certain either.
        signs.uncertain |= bitsOf(D(), hn::Not(hn::Gt(hn::Abs(volume), bound)), i);
        signs.negative |= bitsOf(D(), hn::Lt(volume, hn::Zero(D())), i);
        const V size = hn::Div(hn::Abs(volume), set(6));
        const V least = set(std::numeric_limits<double>::denorm_min());
        store(hn::IfThenElse(hn::Lt(size, least), least, size), batch.volume, i);
        store(hn::Mul(set(0.25), hn::Add(hn::Add(hn::Add(node[0][3], node[1][3]), node[2][3]), node[3][3])),
              values, i);
    });
    signs.uncertain &= batch.lanes();
    signs.negative &= batch.lanes() & ~signs.uncertain;
    return signs;
}

LaneBits findLeaves(MeasureBatch& batch, const BrickTree::Walk& walk, double inverseSpacing0,
                    const Box3d& bounds) {
    using I = hn::VFromD<Ints>;
    const Ints ints;
    const I zero = hn::Zero(ints), absent = hn::Set(ints, BrickTree::Walk::kAbsent);
    const V limit = set(BrickTree::Walk::kLimit);
    LaneBits found = 0;
    forVectors(batch, [&](std::size_t i) {
        I point[3], root = zero;
        auto isInside = hn::Eq(limit, limit);
        auto isRoot = hn::Eq(zero, zero);
        for (std::size_t a = 3; a-- > 0;) {
            const V place = load(batch.place[a], i), index0 = hn::Mul(place, set(inverseSpacing0));
            isInside = hn::And(isInside, hn::And(hn::Ge(place, set(bounds.min[int(a)])),
                                                 hn::Le(place, set(bounds.max[int(a)]))));
            // What is no number, or too large, has no integer either.
            const auto isNear = hn::Lt(hn::Abs(index0), limit);
            isInside = hn::And(isInside, isNear);
            point[a] = hn::DemoteTo(ints, hn::Floor(hn::IfThenElseZero(isNear, index0)));
            const I size = hn::Set(ints, walk.rootSize[int(a)]);
            const I ofRoot = hn::Sub(hn::ShiftRightSame(point[a], std::min(walk.rootShift, 31)),
                                     hn::Set(ints, walk.rootMin[int(a)]));
            isRoot = hn::And(isRoot, hn::And(hn::Gt(ofRoot, hn::Set(ints, -1)), hn::Lt(ofRoot, size)));
            root = hn::Add(hn::Mul(root, size), ofRoot);
        }
        I entry = hn::IfThenElse(isRoot, hn::GatherIndex(ints, walk.roots, hn::IfThenElseZero(isRoot, root)),
                                 absent);
        for (int shift = walk.rootShift - 1;; --shift) {
            const auto isInner = hn::Lt(entry, absent);
            if (hn::AllFalse(ints, isInner)) break;
            I child = hn::ShiftLeft<3>(hn::Sub(hn::Set(ints, BrickTree::Walk::kFirstInner), entry));
            for (int a = 0; a < 3; ++a)
                child = hn::Add(
                    child,
                    hn::ShiftLeftSame(
                        hn::And(hn::ShiftRightSame(point[a], std::min(shift, 31)), hn::Set(ints, 1)), a));
            entry = hn::IfThenElse(
                isInner, hn::GatherIndex(ints, walk.children, hn::IfThenElseZero(isInner, child)), entry);
        }
        hn::Store(entry, ints, batch.leaf.lane + i);
        found |= bitsOf(D(), isInside, i) & bitsOf(ints, hn::Gt(entry, absent), i);
    });
    return found & batch.lanes();
}

void locateCells(MeasureBatch& batch, int brickCells, int tilesPerEdge) {
    const V last = set(brickCells - 1), edge = set(tilesPerEdge), eight = set(8);
    forVectors(batch, [&](std::size_t i) {
        V tile = hn::Zero(D()), offset = hn::Zero(D()), beyond = hn::Zero(D()), least = last, frame[4];
        load(batch.frame, i, frame);
        for (std::size_t a = 0; a < 3; ++a) {
            const V local = hn::Sub(hn::Mul(load(batch.place[a], i), frame[3]), frame[a]);
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

LaneBits findCorners(MeasureBatch& batch, LaneBits lanes, const std::int64_t* tiles, int tilesPerLeaf) {
    const Ints ints;
    const hn::Rebind<std::int64_t, D> words;
    LaneBits found = 0;
    forVectors(batch, [&](std::size_t i) {
        const auto ofLeaf = hn::Mul(hn::Load(ints, batch.leaf.lane + i), hn::Set(ints, tilesPerLeaf));
        const auto at =
            hn::IfThenElseZero(maskOf(ints, lanes, i), hn::Add(ofLeaf, hn::Load(ints, batch.tile.lane + i)));
        const auto tile = hn::GatherIndex(words, tiles, hn::PromoteTo(words, at));
        const auto offset = hn::PromoteTo(words, hn::Load(ints, batch.offset.lane + i));
        hn::Store(hn::Add(tile, hn::ShiftLeft<2>(offset)), words, batch.corner.lane + i);
        const auto isSingle = hn::Eq(hn::Load(ints, batch.beyond.lane + i), hn::Zero(ints));
        const auto isPlain = hn::Eq(hn::And(tile, hn::Set(words, 1)), hn::Zero(words));
        found |= bitsOf(ints, isSingle, i) & bitsOf(words, isPlain, i);
    });
    return found & lanes;
}

void addDifference(const MeasureBatch& batch, const LaneCorners& corners, const LaneDoubles& exact,
                   bool isSquared, LaneDoubles& sum) {
    const V one = set(1);
    forVectors(batch, [&](std::size_t i) {
        V weight[3][2];
        hn::VFromD<Floats> corner[8];
        for (std::size_t row = 0; row < 4; ++row)
            hn::LoadInterleaved2(Floats(), corners.row[row].data() + 2 * i, corner[row], corner[row + 4]);
        for (std::size_t a = 0; a < 3; ++a) {
            weight[a][1] = load(batch.fraction[a], i);
            weight[a][0] = hn::Sub(one, weight[a][1]);
        }
        V value = hn::Zero(D());
        for (std::size_t c = 0; c < 8; ++c) {
            const V w = hn::Mul(hn::Mul(weight[0][c & 1], weight[1][c >> 1 & 1]), weight[2][c >> 2]);
            value = hn::Add(value, hn::Mul(w, hn::PromoteTo(D(), corner[c])));
        }
        const V difference = hn::Sub(value, load(exact, i));
        const V part = isSquared ? hn::Mul(difference, difference) : hn::Abs(difference);
        store(hn::Add(load(sum, i), part), sum, i);
    });
}

void finishErrors(MeasureBatch& batch, bool isSquared, LaneDoubles& sum) {
    LaneBits finite = 0;
    forVectors(batch, [&](std::size_t i) {
        const V error = isSquared ? hn::Sqrt(load(sum, i)) : load(sum, i);
        store(error, sum, i);
        finite |= bitsOf(D(), isFinite(error), i);
    });
    batch.kept &= finite;
}

double listErrors(const MeasureBatch& batch, const LaneDoubles& errors, double unit, LaneFloats& listed) {
    V largest = set(-1);
    forVectors(batch, [&](std::size_t i) {
        const auto isKept = maskOf(D(), batch.kept, i);
        const V error = hn::IfThenElse(isKept, load(errors, i), set(-1));
        largest = hn::Max(largest, error);
        const V share = hn::IfThenElse(isKept, hn::Div(error, set(unit)), set(-1));
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

void addNodeSquares(const MeasureBatch& batch, const float* listed, double share, SquareSums& sums) {
    const V zero = hn::Zero(D()), one = set(1);
    forVectors(batch, [&](std::size_t i) {
        hn::VFromD<Ints> node[4];
        hn::LoadInterleaved4(Ints(), batch.tet[i].data(), node[0], node[1], node[2], node[3]);
        V square = zero, number = zero;
        for (const auto& ofNode : node) {
            const V error = hn::PromoteTo(D(), hn::GatherIndex(Floats(), listed, ofNode));
            const auto isMeasured = hn::Ge(error, zero);
            square = hn::Add(square, hn::IfThenElseZero(isMeasured, hn::Mul(error, error)));
            number = hn::Add(number, hn::IfThenElseZero(isMeasured, one));
        }
        const V weight = hn::Mul(set(share), load(batch.volume, i));
        const auto counts = hn::And(hn::Gt(weight, zero), hn::Gt(number, zero));
        add(hn::IfThenElseZero(counts, hn::Mul(weight, square)), sums.squares, i);
        add(hn::IfThenElseZero(counts, hn::Mul(weight, number)), sums.weights, i);
    });
}

void addIntegral(const MeasureBatch& batch, const LaneDoubles& values, LaneSums& sums) {
    forVectors(batch, [&](std::size_t i) {
        const V value = load(values, i);
        add(hn::IfThenElseZero(isFinite(value), hn::Mul(load(batch.volume, i), value)), sums, i);
    });
}

void addValues(const float* values, std::size_t count, LaneSums& sums) {
    constexpr std::size_t kVectors = kSumLanes / hn::MaxLanes(D());
    V sum[kVectors];
    for (std::size_t n = 0; n < kVectors; ++n)
        sum[n] = hn::Load(D(), sums.lane.data() + n * hn::MaxLanes(D()));
    for (std::size_t i = 0; i < count; i += kSumLanes)
        for (std::size_t n = 0; n < kVectors; ++n)
            sum[n] =
                hn::Add(sum[n], hn::PromoteTo(D(), hn::LoadU(Floats(), values + i + n * hn::MaxLanes(D()))));
    for (std::size_t n = 0; n < kVectors; ++n)
        hn::Store(sum[n], D(), sums.lane.data() + n * hn::MaxLanes(D()));
}

}  // namespace tessera::measure::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::measure {

HWY_EXPORT(gatherNodes);
HWY_EXPORT(placeNodes);
HWY_EXPORT(placeElements);
HWY_EXPORT(findLeaves);
HWY_EXPORT(locateCells);
HWY_EXPORT(findCorners);
HWY_EXPORT(addDifference);
HWY_EXPORT(finishErrors);
HWY_EXPORT(listErrors);
HWY_EXPORT(addSquares);
HWY_EXPORT(addNodeSquares);
HWY_EXPORT(addIntegral);
HWY_EXPORT(addValues);

void gatherNodes(MeasureBatch& batch, const FourDoubles* nodes) {
    HWY_DYNAMIC_DISPATCH(gatherNodes)(batch, nodes);
}
void placeNodes(MeasureBatch& batch, const Vec3d& originWorld, LaneDoubles& values) {
    HWY_DYNAMIC_DISPATCH(placeNodes)(batch, originWorld, values);
}
ElementSigns placeElements(MeasureBatch& batch, const Vec3d& reference, const Vec3d& originWorld,
                           LaneDoubles& values) {
    return HWY_DYNAMIC_DISPATCH(placeElements)(batch, reference, originWorld, values);
}
LaneBits findLeaves(MeasureBatch& batch, const BrickTree::Walk& walk, double inverseSpacing0,
                    const Box3d& bounds) {
    return HWY_DYNAMIC_DISPATCH(findLeaves)(batch, walk, inverseSpacing0, bounds);
}
void locateCells(MeasureBatch& batch, int brickCells, int tilesPerEdge) {
    HWY_DYNAMIC_DISPATCH(locateCells)(batch, brickCells, tilesPerEdge);
}
LaneBits findCorners(MeasureBatch& batch, LaneBits lanes, const std::int64_t* tiles, int tilesPerLeaf) {
    return HWY_DYNAMIC_DISPATCH(findCorners)(batch, lanes, tiles, tilesPerLeaf);
}
void addDifference(const MeasureBatch& batch, const LaneCorners& corners, const LaneDoubles& exact,
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
void addNodeSquares(const MeasureBatch& batch, const float* listed, double share, SquareSums& sums) {
    HWY_DYNAMIC_DISPATCH(addNodeSquares)(batch, listed, share, sums);
}
void addIntegral(const MeasureBatch& batch, const LaneDoubles& values, LaneSums& sums) {
    HWY_DYNAMIC_DISPATCH(addIntegral)(batch, values, sums);
}
void addValues(const float* values, std::size_t count, LaneSums& sums) {
    HWY_DYNAMIC_DISPATCH(addValues)(values, count, sums);
}

}  // namespace tessera::measure
#endif
