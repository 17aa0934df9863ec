// The scanline walk of Weiler and Ertl 2001, section 4, for eight elements and a vector of scanlines at a
// time.
//
// Each face of an element is solved for the scan axis, s >= A + B t + C r or s <= A + B t + C r, so a
// scanline's ends are a maximum and a minimum of at most three such planes. Planes are moved outwards by a
// bound on all rounding, so no point of the element is lost; elements for which that bound would let a point
// outside be covered go to scanElementExactly. Every operation is a single IEEE operation in a fixed order,
// so every instruction set gives the same bits.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "base/vector_targets.h"
#include "software/scan_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "software/scan_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef TESSERA_SCAN_KERNEL_COMMON
#define TESSERA_SCAN_KERNEL_COMMON
namespace tessera::scan_kernel {

inline constexpr int kBatch = 8;
/// So many rows of elements are solved before their runs are written.
inline constexpr int kMostRows = 256;
/// Vectors are stored whole.
inline constexpr int kRowsRoom = kMostRows + 8;
inline constexpr double kUnit = 0x1p-53;
/// Nodes of a mesh that take less than this are near at hand without being fetched ahead.
inline constexpr std::size_t kCacheBytes = std::size_t(1) << 19;
/// An axis other than x is scanned when the element is this many times longer along it: rows along x are
/// contiguous in memory.
inline constexpr double kAxisGain = 4.0;
/// Below this a step from voxel to voxel may be denormal; beyond that many steps a count isn't exact in
/// float.
inline constexpr float kDenormalSteps = 0x1p-96f;
inline constexpr double kMostFloatSteps = 0x1p22;
/// From one voxel to the next a value changes by no more than the range of the element's nodes; beyond this a
/// step may overflow.
inline constexpr double kWidestFloatRange = 0x1p127;
/// The least number that isn't finite in float.
inline constexpr double kRoundsToInfinity = 0x1.ffffffp127;
/// Larger elements would overflow the offsets, which are computed in double.
inline constexpr double kLargestElement = 0x1p28;
/// A scanline's first or last voxel may lie this far outside the element, in voxels.
inline constexpr double kEndTolerance = 0x1p-26;
/// Stands for the reciprocal of zero: the face is parallel to the scan axis and bounds it nowhere or
/// everywhere.
inline constexpr double kParallel = 1e200;

/// How far double precision reaches for an element.
inline constexpr double kThin = 0;  // values can't be trusted
inline constexpr double kDoubtful =
    1;  // values can, but a scanline whose end comes close to a voxel needs a second look
inline constexpr double kEasy = 2;

/// Setup of eight elements, lane by lane.
struct alignas(64) Batch {
    double planeA[4][kBatch], planeB[4][kBatch], planeC[4][kBatch];
    double lower[kBatch];               // sum of 2^i over the faces i that bound s from below
    double base[3][kBatch];             // first voxel, x y z
    double axis[kBatch];                // scan axis
    double minS[kBatch], maxS[kBatch];  // widened bounds
    double grade[kBatch];               // kThin, kDoubtful or kEasy
    double shrink[4][kBatch];  // added to planeA: the face moved inwards by as much as it was moved outwards
    double gradient[4][3][kBatch], constant[4][kBatch];  // barycentrics: constant + gradient . (s, t, r)
    // The part of the element's box that lies in the region, relative to the element's first voxel:
    double fromT[kBatch], fromR[kBatch];          // its first row
    double rowsT[kBatch], inverseT[kBatch];       // rows along t, and one over that
    std::int32_t countT[kBatch], countR[kBatch];  // rows; 0 where no voxel lies in the part
    std::int32_t fromS[kBatch], lastS[kBatch];    // its first and last voxel along s
    std::int32_t origin[kBatch];                  // offset of its first voxel in the block
    std::int32_t strideS[kBatch], strideT[kBatch], strideR[kBatch];  // in the block
};

/// A channel of eight elements: value = constant + s, t, r times the gradient, limited to [low, high].
struct alignas(64) BatchChannel {
    double node[4][kBatch];
    double constant[kBatch], gradientS[kBatch], gradientT[kBatch], gradientR[kBatch];
    float low[kBatch], high[kBatch];
    float step[kBatch];              // difference from voxel to voxel along the scan axis
    unsigned finiteBits, floatBits;  // elements whose values are finite, and whose runs come out right in
                                     // float, too: no denormal steps, nor too many, nor overflowing ones
    alignas(64) double first[kRowsRoom];  // value at the first voxel of the run, of the rows at work

    bool isFinite(int lane) const { return finiteBits >> lane & 1; }
    bool isInFloat(int lane) const { return floatBits >> lane & 1; }
};

/// Rows of the batch's elements that have a run in the region.
struct alignas(64) FoundRows {
    /// Numbers along t and r from the region's first row on, and the element's lane: t + 2^14 r + 2^28 lane.
    std::int32_t place[kRowsRoom];
    std::int32_t begin[kRowsRoom], last[kRowsRoom];  // first voxel of the run, and the last one in the region
    int count = 0;
};
inline constexpr int kRowShift = 14, kLaneShift = 28;

/// Their runs: where each starts in the block, how long it is there, how many of its voxels lie before the
/// region, and the element's lane.
struct alignas(64) Runs {
    std::int32_t offset[kRowsRoom], length[kRowsRoom], skipped[kRowsRoom], lane[kRowsRoom];
};

/// Of a short run: the first point starts it.
alignas(16) constexpr std::uint8_t kRunMarks[16] = {
    kStartsRun,    kFollowsInRun, kFollowsInRun, kFollowsInRun, kFollowsInRun, kFollowsInRun,
    kFollowsInRun, kFollowsInRun, kFollowsInRun, kFollowsInRun, kFollowsInRun, kFollowsInRun,
    kFollowsInRun, kFollowsInRun, kFollowsInRun, kFollowsInRun};

/// The faces of an element, those first that bound s from below, by a bit for each that does.
struct FaceOrder {
    std::uint8_t face[4], lower;
};
constexpr auto kFaceOrder = [] {
    std::array<FaceOrder, 16> table{};
    for (unsigned bits = 0; bits < 16; ++bits) {
        std::uint8_t upper = 4;
        for (std::uint8_t k = 0; k < 4; ++k)
            table[bits].face[bits >> k & 1 ? table[bits].lower++ : --upper] = k;
    }
    return table;
}();

struct Scratch {
    Batch batch;
    std::vector<BatchChannel> channels;  // one at least, which nothing is read of where there is none
    FoundRows found;
    Runs runs;
    // Of the batch's elements:
    std::int32_t element[kBatch];
    std::int64_t stride[kBatch];  // along the scan axis
    int longest[kBatch];          // runs up to this length are written without a loop
    unsigned floatBits;           // elements whose runs come out right in float in all channels
};

}  // namespace tessera::scan_kernel
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::scan_kernel::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, kBatch>;
using V = hn::VFromD<D>;
using M = decltype(hn::Eq(V(), V()));
/// Runs of up to so many voxels along x are written without a loop: by one masked vector or by two that may
/// overlap. 0 where there are no vectors.
#if HWY_TARGET <= HWY_AVX3
constexpr int kShortRun = 16;
#else
constexpr int kShortRun = HWY_TARGET == HWY_SCALAR ? 0 : 8;
#endif

HWY_INLINE V abs3(V a, V b, V c) {
    return hn::Add(hn::Add(hn::Abs(a), hn::Abs(b)), hn::Abs(c));
}
HWY_INLINE unsigned bitsOf(M mask) {
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(D(), mask, bits);
    return bits[0];
}
HWY_INLINE V dot3(V a0, V a1, V a2, V b0, V b1, V b2) {
    return hn::Add(hn::Add(hn::Mul(a0, b0), hn::Mul(a1, b1)), hn::Mul(a2, b2));
}
HWY_INLINE V cross1(V a, V b, V c, V d) {
    return hn::Sub(hn::Mul(a, b), hn::Mul(c, d));
}

// What is scanned, into what.
struct Walk {
    const ScanInput& input;
    const ScanOutput& output;
    Scratch& scratch;
    ScanCounts& counts;
    double regionMin[3], regionLast[3], blockMin[3], stride[3];  // of the output, x y z
    std::optional<ElementDepth> depth;
    std::int32_t depthOf = -1;
};

// Two neighbouring numbers of each of as many nodes as there are lanes.
#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void loadPairs(const double* const* at, std::size_t offset, V& first, V& second) {
    first = hn::Set(D(), at[0][offset]);
    second = hn::Set(D(), at[0][offset + 1]);
}
#else
template <class Numbers>
HWY_INLINE hn::VFromD<Numbers> everySecondPair(Numbers numbers, const double* const* at, std::size_t offset) {
    constexpr std::size_t kLanes = hn::MaxLanes(Numbers());
    if constexpr (kLanes == 2) {
        return hn::LoadU(numbers, *at + offset);
    } else {
        const hn::Half<Numbers> half;
        return hn::Combine(numbers, everySecondPair(half, at + kLanes / 2, offset),
                           everySecondPair(half, at, offset));
    }
}
HWY_INLINE void loadPairs(const double* const* at, std::size_t offset, V& first, V& second) {
    const V even = everySecondPair(D(), at, offset), odd = everySecondPair(D(), at + 1, offset);
    first = hn::InterleaveLower(D(), even, odd);
    second = hn::InterleaveUpper(D(), even, odd);
}
#endif

HWY_INLINE V least4(const V (&v)[4][3], int axis) {
    return hn::Min(hn::Min(v[0][axis], v[1][axis]), hn::Min(v[2][axis], v[3][axis]));
}
HWY_INLINE V most4(const V (&v)[4][3], int axis) {
    return hn::Max(hn::Max(v[0][axis], v[1][axis]), hn::Max(v[2][axis], v[3][axis]));
}

// Planes, bounds and gradients of the lanes from `lane` on, and their parts in the region.
void setUpLanes(const Walk& walk, const double* const (&nodes)[4][kBatch], std::size_t lane) {
    const D d;
    Batch& batch = walk.scratch.batch;
    V v[4][3], part[4][3], base[3], low[3], high[3];
    static_assert(offsetof(NodeFrame::Node, part) == 3 * sizeof(double) &&
                  offsetof(NodeFrame::Node, value) == 6 * sizeof(double));
    const int values = walk.input.frame.valueCount;
    BatchChannel* const channels = walk.scratch.channels.data();
    for (int k = 0; k < 4; ++k) {
        V value0, value1;
        if (values > 0) {
            loadPairs(&nodes[k][lane], 6, value0, value1);
            hn::Store(value0, d, &channels[0].node[k][lane]);
        }
        if (values > 1) hn::Store(value1, d, &channels[1].node[k][lane]);
        loadPairs(&nodes[k][lane], 0, v[k][0], v[k][1]);
        loadPairs(&nodes[k][lane], 2, v[k][2], part[k][0]);
        loadPairs(&nodes[k][lane], 4, part[k][1], part[k][2]);
    }
    for (int a = 0; a < 3; ++a) {
        base[a] = least4(v, a);
        hn::Store(base[a], d, &batch.base[a][lane]);
        for (int k = 0; k < 4; ++k) v[k][a] = hn::Add(hn::Sub(v[k][a], base[a]), part[k][a]);
        low[a] = least4(v, a);
        high[a] = most4(v, a);
    }

    // The scan axis, and the element turned so that s is along it: x: (x, y, z), y: (y, x, z), z: (z, x, y).
    const V extentX = hn::Sub(high[0], low[0]), extentY = hn::Sub(high[1], low[1]),
            extentZ = hn::Sub(high[2], low[2]);
    const V needed = hn::Mul(hn::Set(d, kAxisGain), hn::Add(extentX, hn::Set(d, 1.0)));
    const auto alongY = hn::And(hn::Gt(extentY, needed), hn::Ge(extentY, extentZ));
    const auto alongZ = hn::And(hn::Gt(extentZ, needed), hn::Gt(extentZ, extentY));
    const auto alongX = hn::Not(hn::Or(alongY, alongZ));
    hn::Store(hn::IfThenElse(alongZ, hn::Set(d, 2.0), hn::IfThenElseZero(alongY, hn::Set(d, 1.0))), d,
              &batch.axis[lane]);
    const auto turn = [&](V(&of)[3]) {
        const V s = hn::IfThenElse(alongZ, of[2], hn::IfThenElse(alongY, of[1], of[0]));
        const V t = hn::IfThenElse(alongX, of[1], of[0]);
        of[2] = hn::IfThenElse(alongZ, of[1], of[2]);
        of[0] = s;
        of[1] = t;
    };
    V from[3], to[3], stride[3];
    for (int a = 0; a < 3; ++a) {
        from[a] = hn::Sub(hn::Set(d, walk.regionMin[a]), base[a]);
        to[a] = hn::Sub(hn::Set(d, walk.regionLast[a]), base[a]);
        base[a] = hn::Sub(base[a], hn::Set(d, walk.blockMin[a]));
        stride[a] = hn::Set(d, walk.stride[a]);
    }
    if (!hn::AllTrue(d, alongX)) {
        for (V(&node)[3] : v) turn(node);
        for (V(*of)[3] : {&low, &high, &from, &to, &base, &stride}) turn(*of);
    }
    const V slack = hn::Set(d, kBoxSlack), one = hn::Set(d, 1.0);
    auto isSome = hn::Eq(one, one);
    for (int i = 0; i < 3; ++i) {
        const V least = hn::Sub(low[i], slack), most = hn::Add(high[i], slack);
        if (i == 0) {
            hn::Store(least, d, &batch.minS[lane]);
            hn::Store(most, d, &batch.maxS[lane]);
        }
        const V first = hn::Max(from[i], hn::Ceil(least)), last = hn::Min(to[i], hn::Floor(most));
        isSome = hn::And(isSome, hn::Le(first, last));
        if (i > 0) {
            from[i] = first;
            to[i] = last;
        }
    }
    const hn::Rebind<std::int32_t, D> di;
    const auto storeWhole = [&](V value, std::int32_t(&list)[kBatch]) {
        hn::Store(hn::DemoteTo(di, value), di, &list[lane]);
    };
    storeWhole(hn::Add(hn::Add(hn::Mul(hn::Add(from[0], base[0]), stride[0]),
                               hn::Mul(hn::Add(from[1], base[1]), stride[1])),
                       hn::Mul(hn::Add(from[2], base[2]), stride[2])),
               batch.origin);
    storeWhole(stride[0], batch.strideS);
    storeWhole(stride[1], batch.strideT);
    storeWhole(stride[2], batch.strideR);
    storeWhole(from[0], batch.fromS);
    storeWhole(to[0], batch.lastS);
    hn::Store(from[1], d, &batch.fromT[lane]);
    hn::Store(from[2], d, &batch.fromR[lane]);
    const V rowsT = hn::IfThenElseZero(isSome, hn::Add(hn::Sub(to[1], from[1]), one)),
            rowsR = hn::IfThenElseZero(isSome, hn::Add(hn::Sub(to[2], from[2]), one));
    hn::Store(rowsT, d, &batch.rowsT[lane]);
    hn::Store(hn::Div(one, rowsT), d, &batch.inverseT[lane]);
    storeWhole(rowsT, batch.countT);
    storeWhole(rowsR, batch.countR);

    // Barycentric gradients: cross products of two edges over six times the volume.
    V e[3][3];
    for (int k = 0; k < 3; ++k)
        for (int a = 0; a < 3; ++a) e[k][a] = hn::Sub(v[k + 1][a], v[0][a]);
    V n[3][3];
    for (int k = 0; k < 3; ++k) {
        const V* p = e[(k + 1) % 3];
        const V* q = e[(k + 2) % 3];
        n[k][0] = cross1(p[1], q[2], p[2], q[1]);
        n[k][1] = cross1(p[2], q[0], p[0], q[2]);
        n[k][2] = cross1(p[0], q[1], p[1], q[0]);
    }
    const V det = dot3(e[0][0], e[0][1], e[0][2], n[0][0], n[0][1], n[0][2]);
    const V inverse = hn::Div(one, det);
    V g[4][3], c[4];
    for (int k = 1; k < 4; ++k) {
        for (int a = 0; a < 3; ++a) g[k][a] = hn::Mul(n[k - 1][a], inverse);
        c[k] = hn::Neg(dot3(g[k][0], g[k][1], g[k][2], v[0][0], v[0][1], v[0][2]));
    }
    for (int a = 0; a < 3; ++a) g[0][a] = hn::Neg(hn::Add(hn::Add(g[1][a], g[2][a]), g[3][a]));
    c[0] = hn::Sub(one, hn::Add(hn::Add(c[1], c[2]), c[3]));

    // The bound T on the rounding of a barycentric coordinate anywhere in the bounding box.
    const V size0 = hn::Sub(high[0], low[0]), size1 = hn::Sub(high[1], low[1]),
            size2 = hn::Sub(high[2], low[2]);
    V steepest = hn::Zero(d);
    for (int k = 0; k < 4; ++k) steepest = hn::Max(steepest, abs3(g[k][0], g[k][1], g[k][2]));
    const V boxVolume = hn::Mul(hn::Mul(size0, size1), size2);
    const V longest = hn::Max(hn::Max(size0, size1), size2);
    const V fromDet = hn::Mul(hn::Set(d, 256.0), hn::Abs(hn::Mul(boxVolume, inverse)));
    const V fromPlace = hn::Mul(hn::Mul(hn::Set(d, 128.0), steepest), hn::Add(longest, hn::Set(d, 2.0)));
    const V dilation = hn::Mul(hn::Set(d, kUnit), hn::Add(fromDet, fromPlace));
    const V spread = hn::Mul(dilation, hn::Add(hn::Add(size0, size1), size2));
    const auto valued =
        hn::And(hn::Le(dilation, hn::Set(d, kLargestSlack)), hn::Le(longest, hn::Set(d, kLargestElement)));
    const auto easy = hn::And(valued, hn::Le(spread, hn::Set(d, kLargestSlackTimesSize)));
    hn::Store(hn::IfThenElse(easy, hn::Set(d, kEasy), hn::IfThenElseZero(valued, hn::Set(d, kDoubtful))), d,
              &batch.grade[lane]);

    const V tiny = hn::Set(d, 1.0 / kParallel);
    V lower = hn::Zero(d);
    for (int k = 0; k < 4; ++k) {
        const V s = g[k][0];
        const V reciprocal = hn::IfThenElse(hn::Lt(hn::Abs(s), tiny), hn::Set(d, kParallel), hn::Div(one, s));
        hn::Store(hn::Neg(hn::Mul(hn::Add(dilation, c[k]), reciprocal)), d, &batch.planeA[k][lane]);
        hn::Store(hn::Mul(hn::Add(dilation, dilation), reciprocal), d, &batch.shrink[k][lane]);
        hn::Store(hn::Neg(hn::Mul(g[k][1], reciprocal)), d, &batch.planeB[k][lane]);
        hn::Store(hn::Neg(hn::Mul(g[k][2], reciprocal)), d, &batch.planeC[k][lane]);
        lower =
            hn::Add(lower, hn::IfThenElseZero(hn::Gt(reciprocal, hn::Zero(d)), hn::Set(d, double(1 << k))));
        hn::Store(c[k], d, &batch.constant[k][lane]);
        for (int a = 0; a < 3; ++a) hn::Store(g[k][a], d, &batch.gradient[k][a][lane]);
    }
    hn::Store(lower, d, &batch.lower[lane]);
}

void loadBatch(const Walk& walk, const std::int32_t* elements, int count) {
    const double* nodes[4][kBatch];
    for (int lane = 0; lane < kBatch; ++lane) {
        const auto& tet = walk.input.mesh.tets[std::size_t(elements[lane < count ? lane : 0])];
        for (std::size_t k = 0; k < 4; ++k)
            nodes[k][lane] = walk.input.frame.nodes[std::size_t(tet[k])].whole;
    }
    for (std::size_t lane = 0; lane < kBatch; lane += hn::Lanes(D())) setUpLanes(walk, nodes, lane);
}

// value = f0 + sum over i of (fi - f0) b_i; what the values are limited to, and how runs come out right.
void setUpChannelLanes(const Batch& batch, BatchChannel& channel, std::size_t lane) {
    const D d;
    const hn::Rebind<float, D> df;
    constexpr double kMost = std::numeric_limits<float>::max();
    const V infinity = hn::Set(d, std::numeric_limits<double>::infinity());
    V f[4], low = infinity, high = hn::Neg(infinity);
    auto isFinite = hn::Eq(low, low);
    for (int k = 0; k < 4; ++k) {
        f[k] = hn::Load(d, &channel.node[k][lane]);
        const V rounded = hn::PromoteTo(d, hn::DemoteTo(df, f[k]));
        isFinite = hn::And(isFinite, hn::Lt(hn::Abs(f[k]), hn::Set(d, kRoundsToInfinity)));
        low = hn::IfThenElse(hn::Lt(rounded, low), rounded, low);
        high = hn::IfThenElse(hn::Gt(rounded, high), rounded, high);
    }
    const V steps = hn::Sub(hn::Load(d, &batch.maxS[lane]), hn::Load(d, &batch.minS[lane]));
    const auto isInFloat =
        hn::And(hn::And(isFinite, hn::Ge(hn::Max(hn::Abs(low), hn::Abs(high)), hn::Set(d, kDenormalSteps))),
                hn::And(hn::Le(steps, hn::Set(d, kMostFloatSteps)),
                        hn::Lt(hn::Sub(high, low), hn::Set(d, kWidestFloatRange))));
    channel.finiteBits |= bitsOf(isFinite) << lane;
    channel.floatBits |= bitsOf(isInFloat) << lane;
    hn::Store(hn::DemoteTo(df, low), df, &channel.low[lane]);
    hn::Store(hn::DemoteTo(df, high), df, &channel.high[lane]);
    for (V& value : f) value = hn::IfThenElseZero(isFinite, value);
    V sum[4] = {f[0], hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    for (int k = 1; k < 4; ++k) {
        const V difference = hn::Sub(f[k], f[0]);
        sum[0] = hn::Add(sum[0], hn::Mul(difference, hn::Load(d, &batch.constant[k][lane])));
        for (int a = 0; a < 3; ++a)
            sum[a + 1] = hn::Add(sum[a + 1], hn::Mul(difference, hn::Load(d, &batch.gradient[k][a][lane])));
    }
    hn::Store(sum[0], d, &channel.constant[lane]);
    hn::Store(sum[1], d, &channel.gradientS[lane]);
    hn::Store(sum[2], d, &channel.gradientT[lane]);
    hn::Store(sum[3], d, &channel.gradientR[lane]);
    const V step = hn::Min(hn::Max(sum[1], hn::Set(d, -kMost)), hn::Set(d, kMost));
    hn::Store(hn::DemoteTo(df, step), df, &channel.step[lane]);
}

// @param hasNodes the nodes' values came with their places.
void loadChannel(const ScanInput& input, const ScanChannel& source, const std::int32_t* elements, int count,
                 const Batch& batch, bool hasNodes, BatchChannel& channel) {
    for (int lane = 0; lane < kBatch && !hasNodes; ++lane) {
        const std::int32_t element = elements[lane < count ? lane : 0];
        const auto& tet = input.mesh.tets[std::size_t(element)];
        for (std::size_t k = 0; k < 4; ++k) channel.node[k][lane] = source.at(source.cell ? element : tet[k]);
    }
    channel.finiteBits = channel.floatBits = 0;
    for (std::size_t lane = 0; lane < kBatch; lane += hn::Lanes(D())) setUpChannelLanes(batch, channel, lane);
}

HWY_INLINE float limited(float value, float low, float high) {
    value = value < low ? low : value;
    return value > high ? high : value;
}

float valueAt(const BatchChannel& channel, int lane, int row, double number) {
    if (!channel.isFinite(lane)) return std::numeric_limits<float>::quiet_NaN();
    const float value = channel.isInFloat(lane)
                            ? float(channel.first[row]) + float(number) * channel.step[lane]
                            : float(channel.first[row] + number * channel.gradientS[lane]);
    return limited(value, channel.low[lane], channel.high[lane]);
}

// The element's rank at a point it covers. On a face, where conforming meshes are contested, it is zero, and
// a look at the barycentrics tells: one that is worth less than 2^-15 voxel, which leaves the errors of both
// ways of computing it inside the step of 2^-13.
double rankOf(Walk& walk, int lane, std::int64_t offset) {
    const Batch& batch = walk.scratch.batch;
    const Vec3i point = walk.output.pointAt(offset);
    if (batch.grade[lane] == kEasy) {
        const int axis = int(batch.axis[lane]);
        const int axes[3] = {axis, axis == 0 ? 1 : 0, axis == 2 ? 1 : 2};
        double local[3];
        for (int i = 0; i < 3; ++i) local[i] = point[axes[i]] - batch.base[axes[i]][lane];
        for (int k = 0; k < 4; ++k) {
            const double gs = batch.gradient[k][0][lane], gt = batch.gradient[k][1][lane],
                         gr = batch.gradient[k][2][lane];
            const double b = batch.constant[k][lane] + gs * local[0] + gt * local[1] + gr * local[2];
            if (b < 0x1p-15 * std::max({std::fabs(gs), std::fabs(gt), std::fabs(gr)})) return 0.0;
        }
    }
    const std::int32_t element = walk.scratch.element[lane];
    if (walk.depthOf != element) walk.depth.emplace(walk.input.mesh, walk.input.frame, element);
    walk.depthOf = element;
    return walk.depth->rank(point);
}

// Points of the run that another element covers already: the deeper one owns them.
HWY_NOINLINE void writeContestedRun(Walk& walk, int lane, int row) {
    const Scratch& scratch = walk.scratch;
    const Runs& runs = scratch.runs;
    const std::int32_t element = scratch.element[lane];
    std::int64_t offset = runs.offset[row];
    for (int k = 0; k < runs.length[row]; ++k, offset += scratch.stride[lane]) {
        std::uint8_t& mark = walk.output.marks[offset];
        if (mark == kNotCovered) {
            mark = kStartsRun;
            walk.output.owner[offset] = element;
        } else {
            ++walk.counts.contested;
            if (!contestPoint(walk.input, walk.output, element, rankOf(walk, lane, offset), offset)) continue;
        }
        const double number = double(runs.skipped[row]) + k;
        for (std::size_t c = 0; c < walk.input.channels.size(); ++c)
            walk.output.values[c][offset] = valueAt(scratch.channels[c], lane, row, number);
    }
}

// Values of voxels of a run by their numbers in it.
template <class Floats>
HWY_INLINE hn::VFromD<Floats> valuesAt(Floats df, const BatchChannel& channel, int lane, int row,
                                       float number) {
    const auto first = hn::Set(df, float(channel.first[row])), step = hn::Set(df, channel.step[lane]);
    const auto v = hn::Add(first, hn::Mul(hn::Iota(df, number), step));
    return hn::Min(hn::Set(df, channel.high[lane]), hn::Max(hn::Set(df, channel.low[lane]), v));
}

// Marks a run that starts here and goes along x, or its points one by one where it goes another way. False
// where another element covers one of them.
HWY_INLINE bool markRun(std::uint8_t* marks, int length, std::int64_t stride) {
    std::uint64_t present = 0;
    int k = 0;
    for (; stride == 1 && k + 8 <= length; k += 8) {
        std::uint64_t eight;
        std::memcpy(&eight, marks + k, sizeof eight);
        present |= eight;
    }
    for (; k < length; ++k) present |= marks[k * stride];
    if (present != 0) return false;
    if (stride == 1) std::memset(marks, kFollowsInRun, std::size_t(length));
    marks[0] = kStartsRun;
    for (k = 1; stride != 1 && k < length; ++k) marks[k * stride] = kStartsRun;
    return true;
}

// Writes a run of any length along any axis.
HWY_NOINLINE void writeRun(Walk& walk, int lane, int row) {
    const hn::ScalableTag<float> df;
    const int lanes = int(hn::Lanes(df));
    const Scratch& scratch = walk.scratch;
    const int length = scratch.runs.length[row], skipped = scratch.runs.skipped[row];
    const std::int64_t offset = scratch.runs.offset[row], stride = scratch.stride[lane];
    if (!markRun(walk.output.marks + offset, length, stride)) return writeContestedRun(walk, lane, row);
    for (int k = 0; k < (stride == 1 ? 1 : length); ++k)
        walk.output.owner[offset + k * stride] = scratch.element[lane];
    const int whole = stride == 1 ? length - length % lanes : 0;  // voxels in whole vectors
    for (std::size_t c = 0; c < walk.input.channels.size(); ++c) {
        const BatchChannel& channel = scratch.channels[c];
        float* const out = walk.output.values[c] + offset;
        const int vectors = channel.isInFloat(lane) ? whole : 0;
        for (int k = 0; k < vectors; k += lanes)
            hn::StoreU(valuesAt(df, channel, lane, row, float(skipped + k)), df, out + k);
        for (int k = vectors; k < length; ++k)
            out[k * stride] = valueAt(channel, lane, row, double(skipped) + k);
    }
}

// Where short runs go: the block's marks and owners, and the values of its channels.
struct ShortRuns {
    const Scratch& scratch;
    std::uint8_t* marks;
    std::int32_t* owners;
    float* const* values;
    std::size_t channels;
};

// Writes a run along x of up to kShortRun voxels whose values come out right in float. False where a voxel is
// covered already. No run's length can be foreseen: few branches depend on it.
#if HWY_TARGET <= HWY_AVX3
HWY_INLINE bool writeShortRun(const ShortRuns& to, int lane, int row) {
    const hn::FixedTag<float, kShortRun> df;
    const hn::FixedTag<std::uint8_t, kShortRun> db;
    const std::size_t length = std::size_t(to.scratch.runs.length[row]);
    const std::int64_t offset = to.scratch.runs.offset[row];
    const auto isInRun = hn::FirstN(db, length);
    const auto present = hn::MaskedLoad(isInRun, db, to.marks + offset);
    if (!hn::AllTrue(db, hn::Eq(present, hn::Zero(db)))) return false;
    hn::BlendedStore(hn::Load(db, kRunMarks), isInRun, db, to.marks + offset);
    to.owners[offset] = to.scratch.element[lane];
    const float skipped = float(to.scratch.runs.skipped[row]);
    for (std::size_t c = 0; c < to.channels; ++c)
        hn::BlendedStore(valuesAt(df, to.scratch.channels[c], lane, row, skipped), hn::FirstN(df, length), df,
                         to.values[c] + offset);
    return true;
}
#elif HWY_TARGET != HWY_SCALAR
HWY_INLINE bool writeShortRun(const ShortRuns& to, int lane, int row) {
    const hn::FixedTag<float, 4> df;
    const int length = to.scratch.runs.length[row];
    const std::int64_t offset = to.scratch.runs.offset[row];
    std::uint8_t* const marks = to.marks + offset;
    const float skipped = float(to.scratch.runs.skipped[row]);
    // The front of a run is marked last: its back may overlap it.
    if (length >= 4) {
        const int last = length - 4;
        std::uint32_t front, back;
        std::memcpy(&front, marks, sizeof front);
        std::memcpy(&back, marks + last, sizeof back);
        if ((front | back) != 0) return false;
        std::memcpy(marks + last, kRunMarks + 1, sizeof back);
        std::memcpy(marks, kRunMarks, sizeof front);
        to.owners[offset] = to.scratch.element[lane];
        for (std::size_t c = 0; c < to.channels; ++c) {
            float* const out = to.values[c] + offset;
            const BatchChannel& channel = to.scratch.channels[c];
            hn::StoreU(valuesAt(df, channel, lane, row, skipped), df, out);
            hn::StoreU(valuesAt(df, channel, lane, row, skipped + float(last)), df, out + last);
        }
        return true;
    }
    const int middle = length / 2, last = length - 1;
    if ((marks[0] | marks[middle] | marks[last]) != 0) return false;
    marks[last] = marks[middle] = kFollowsInRun;
    marks[0] = kStartsRun;
    to.owners[offset] = to.scratch.element[lane];
    for (std::size_t c = 0; c < to.channels; ++c) {
        float* const out = to.values[c] + offset;
        alignas(16) float v[4];
        hn::Store(valuesAt(df, to.scratch.channels[c], lane, row, skipped), df, v);
        out[0] = v[0];
        out[middle] = v[middle];
        out[last] = v[last];
    }
    return true;
}
#else
bool writeShortRun(const ShortRuns&, int, int) {
    return false;
}
#endif

HWY_INLINE void writeRuns(Walk& walk, const ShortRuns& to) {
    const Runs& runs = walk.scratch.runs;
    const int count = walk.scratch.found.count;
    for (int row = 0; row < count; ++row) {
        const int lane = runs.lane[row];
        if (HWY_UNLIKELY(runs.length[row] > walk.scratch.longest[lane]))
            writeRun(walk, lane, row);
        else if (HWY_UNLIKELY(!writeShortRun(to, lane, row)))
            writeContestedRun(walk, lane, row);
    }
}

/// Lambdas that hold an inner loop: as one function of its own it would keep its vectors in memory.
#define TESSERA_INLINE __attribute__((always_inline))

// Numbers of the elements of these lanes.
template <class Tag, class T>
HWY_INLINE hn::VFromD<Tag> ofLanes(Tag tag, const T (&table)[kBatch],
                                   hn::VFromD<hn::RebindToSigned<Tag>> lanes) {
    if constexpr (int(hn::MaxLanes(Tag())) == kBatch)
        return hn::TableLookupLanes(hn::Load(tag, table), hn::IndicesFromVec(tag, lanes));
    else
        return hn::GatherIndex(tag, table, lanes);
}

// Makes runs of the rows found: their places in the block and the values that they begin with.
void startRuns(Walk& walk) {
    constexpr int kLanes = int(hn::MaxLanes(D()));
    const D d;
    const hn::Rebind<std::int32_t, D> di;
    const hn::Rebind<std::int64_t, D> dl;
    Scratch& scratch = walk.scratch;
    const Batch& batch = scratch.batch;
    const FoundRows& found = scratch.found;
    Runs& runs = scratch.runs;
    BatchChannel* const channels = scratch.channels.data();
    const std::size_t channelCount = walk.input.channels.size();
    const auto rowMask = hn::Set(di, (1 << kRowShift) - 1), one = hn::Set(di, 1);
    for (int i = 0; i < found.count; i += kLanes) {
        const auto place = hn::Load(di, found.place + i), begin = hn::Load(di, found.begin + i);
        const auto lane = hn::ShiftRight<kLaneShift>(place);
        const auto inT = hn::And(place, rowMask), inR = hn::And(hn::ShiftRight<kRowShift>(place), rowMask);
        const auto whole = [&](const std::int32_t(&of)[kBatch])
                               TESSERA_INLINE { return ofLanes(di, of, lane); };
        const auto fromS = whole(batch.fromS), first = hn::Max(begin, fromS);
        const auto inRows = hn::Add(hn::Mul(inT, whole(batch.strideT)), hn::Mul(inR, whole(batch.strideR)));
        const auto inRow = hn::Mul(hn::Sub(first, fromS), whole(batch.strideS));
        hn::Store(hn::Add(hn::Add(whole(batch.origin), inRows), inRow), di, runs.offset + i);
        hn::Store(hn::Add(hn::Sub(hn::Load(di, found.last + i), first), one), di, runs.length + i);
        hn::Store(hn::Sub(first, begin), di, runs.skipped + i);
        hn::Store(lane, di, runs.lane + i);
        const auto longLane = hn::PromoteTo(dl, lane);
        const auto real = [&](const double(&of)[kBatch]) TESSERA_INLINE { return ofLanes(d, of, longLane); };
        const V t = hn::Add(real(batch.fromT), hn::PromoteTo(d, inT)),
                r = hn::Add(real(batch.fromR), hn::PromoteTo(d, inR)), s = hn::PromoteTo(d, begin);
        for (std::size_t c = 0; c < channelCount; ++c) {
            BatchChannel& channel = channels[c];
            const V ofT = hn::Add(real(channel.constant), hn::Mul(real(channel.gradientT), t));
            hn::Store(hn::Add(hn::Add(ofT, hn::Mul(real(channel.gradientR), r)),
                              hn::Mul(real(channel.gradientS), s)),
                      d, channel.first + i);
        }
    }
}

// Writes the runs of the rows found. Most are short, and most meshes' fields sampled one by one.
void writeFound(Walk& walk) {
    startRuns(walk);
    Scratch& scratch = walk.scratch;
    float* const* const values = walk.output.values.data();
    const std::size_t channels = walk.input.channels.size();
    if (channels == 1) {
        float* const only = values[0];
        writeRuns(walk, {scratch, walk.output.marks, walk.output.owner, &only, 1});
    } else {
        writeRuns(walk, {scratch, walk.output.marks, walk.output.owner, values, channels});
    }
    scratch.found.count = 0;
}

// Where faces leave scanlines room: s from the greatest bound of the first `lower` faces to the least of the
// others. Of an element that isn't degenerate, the first is always a lower one and the last an upper one.
struct Room {
    V low, high;
};
template <bool IsAnyOrder>
HWY_INLINE Room narrow(Room room, const V (&bounds)[4], const M (&isLower)[4]) {
    for (int i = 0; i < 4; ++i) {
        const V low = hn::Max(room.low, bounds[i]), high = hn::Min(room.high, bounds[i]);
        if (IsAnyOrder || i == 1 || i == 2) {
            room.low = hn::IfThenElse(isLower[i], low, room.low);
            room.high = hn::IfThenElse(isLower[i], room.high, high);
        } else {
            (i == 0 ? room.low : room.high) = i == 0 ? low : high;
        }
    }
    return room;
}

// True for scanlines between whose ends, and those when the faces are moved inwards instead of outwards, low
// and high, lies a voxel.
HWY_INLINE M doubtfulEnds(V low, V high, V begin, V end) {
    const D d;
    // Where the scanline surely meets the element, an end within the tolerance of it is as good as exact.
    const V tolerance = hn::Set(d, kEndTolerance);
    const auto lowDiffers = hn::And(hn::Ne(hn::Ceil(low), begin), hn::Gt(hn::Sub(low, begin), tolerance));
    const auto highDiffers = hn::And(hn::Ne(hn::Floor(high), end), hn::Gt(hn::Sub(end, high), tolerance));
    return hn::And(hn::Le(begin, end), hn::Or(hn::Gt(low, high), hn::Or(lowDiffers, highDiffers)));
}

// Replaces the ends of the scanlines that double precision can't decide.
HWY_NOINLINE void decideEnds(const ExactScanlines& exact, unsigned doubtful, V t, V r, V& begin, V& end) {
    const D d;
    alignas(64) double ts[kBatch], rs[kBatch], begins[kBatch], ends[kBatch];
    hn::Store(t, d, ts);
    hn::Store(r, d, rs);
    hn::Store(begin, d, begins);
    hn::Store(end, d, ends);
    for (std::size_t i = 0; i < hn::Lanes(d); ++i)
        if ((doubtful >> i) & 1) exact.ends(ts[i], rs[i], begins[i], ends[i]);
    begin = hn::Load(d, begins);
    end = hn::Load(d, ends);
}

/// How the rows of an element are put into vectors.
enum class RowOrder {
    packed,   ///< side by side, whatever their number along t
    aligned,  ///< a vector along t goes through all r: less work for each, if most of its lanes have a row
    careful,  ///< packed, with faces in any order, and double precision may not decide the scanlines
};

// Solves the rows of one element.
template <RowOrder kOrder>
HWY_NOINLINE void solveRows(Walk& walk, int lane) {
    constexpr bool kIsCareful = kOrder == RowOrder::careful, kIsAligned = kOrder == RowOrder::aligned;
    constexpr int kLanes = int(hn::MaxLanes(D()));
    const D d;
    const hn::Rebind<std::int32_t, D> di;
    using Whole = hn::VFromD<decltype(di)>;
    Scratch& scratch = walk.scratch;
    const Batch& batch = scratch.batch;
    FoundRows& found = scratch.found;
    const auto ofLane = [&](const double(&of)[kBatch]) { return hn::Set(d, of[lane]); };
    const FaceOrder& order = kFaceOrder[std::size_t(batch.lower[lane])];
    M isLower[4];
    V planeA[4], planeB[4], planeC[4];
    for (int i = 0; i < 4; ++i) {
        const int face = order.face[i];
        isLower[i] = hn::Lt(hn::Set(d, double(i)), hn::Set(d, double(order.lower)));
        planeA[i] = ofLane(batch.planeA[face]);
        planeB[i] = ofLane(batch.planeB[face]);
        planeC[i] = ofLane(batch.planeC[face]);
    }
    const Room whole{ofLane(batch.minS), ofLane(batch.maxS)};
    const V fromT = ofLane(batch.fromT), fromR = ofLane(batch.fromR), one = hn::Set(d, 1.0);
    const Whole fromS = hn::Set(di, batch.fromS[lane]), lastS = hn::Set(di, batch.lastS[lane]);
    std::optional<ExactScanlines> exact;
    const int countT = batch.countT[lane], countR = batch.countR[lane], count = countT * countR;
    walk.counts.scanlines += count;

    // What t decides of the rows of a vector: it is the same for all r where they are aligned.
    struct AlongT {
        V t, bounds[4];
        Whole place;
    } along;
    const auto goAlongT = [&](V inT) TESSERA_INLINE {
        along.t = hn::Add(fromT, inT);
        along.place = hn::Add(hn::DemoteTo(di, inT), hn::Set(di, lane << kLaneShift));
        for (int i = 0; i < 4; ++i) along.bounds[i] = hn::Add(planeA[i], hn::Mul(planeB[i], along.t));
    };
    const auto solve = [&](V inR, Whole placeR, auto used, int& some) TESSERA_INLINE {
        const V r = hn::Add(fromR, inR);
        V bounds[4];
        for (int i = 0; i < 4; ++i) bounds[i] = hn::Add(along.bounds[i], hn::Mul(planeC[i], r));
        const Room room = narrow<kIsCareful>(whole, bounds, isLower);
        V begin = hn::Ceil(room.low), last = hn::Floor(room.high);
        if constexpr (kIsCareful) {
            for (int i = 0; i < 4; ++i) {
                const V inner = hn::Add(planeA[i], ofLane(batch.shrink[order.face[i]]));
                bounds[i] = hn::Add(hn::Add(inner, hn::Mul(planeB[i], along.t)), hn::Mul(planeC[i], r));
            }
            const Room inner = narrow<kIsCareful>(whole, bounds, isLower);
            const unsigned doubtful = bitsOf(doubtfulEnds(inner.low, inner.high, begin, last));
            if (batch.grade[lane] == kDoubtful && doubtful != 0) {
                if (!exact) exact.emplace(walk.input, scratch.element[lane], int(batch.axis[lane]));
                decideEnds(*exact, doubtful, along.t, r, begin, last);
            }
        }
        const Whole from = hn::DemoteTo(di, begin), to = hn::Min(hn::DemoteTo(di, last), lastS);
        const auto hit = hn::AndNot(hn::Gt(hn::Max(from, fromS), to), used);
        const auto keep = [&](Whole v, std::int32_t* list) {
            hn::StoreU(hn::Compress(v, hit), di, list + some);
        };
        keep(hn::Add(along.place, placeR), found.place);
        keep(from, found.begin);
        keep(to, found.last);
        some += int(hn::CountTrue(di, hit));
    };
    // Calls work(step, found rows) for so many vectors of rows.
    const auto forVectors = [&](int vectors, const auto& work) TESSERA_INLINE {
        for (int done = 0; done < vectors;) {
            if (found.count > kMostRows - kLanes) writeFound(walk);
            int some = found.count;
            for (const int end = std::min(vectors, done + (kMostRows - some) / kLanes); done < end; ++done)
                work(done, some);
            found.count = some;
        }
    };
    if constexpr (kIsAligned) {
        for (int done = 0; done < countT; done += kLanes) {
            goAlongT(hn::Iota(d, double(done)));
            const auto used = hn::FirstN(di, std::size_t(countT - done));
            V inR = hn::Zero(d);
            forVectors(countR, [&](int step, int& some) TESSERA_INLINE {
                solve(inR, hn::Set(di, step << kRowShift), used, some);
                inR = hn::Add(inR, one);
            });
        }
    } else {
        const V rowsT = ofLane(batch.rowsT), inverseT = ofLane(batch.inverseT), half = hn::Set(d, 0.5);
        forVectors((count + kLanes - 1) / kLanes, [&](int step, int& some) TESSERA_INLINE {
            const V number = hn::Iota(d, double(step * kLanes));
            const V inR = hn::Floor(hn::Mul(hn::Add(number, half), inverseT));
            goAlongT(hn::Sub(number, hn::Mul(inR, rowsT)));
            solve(inR, hn::ShiftLeft<kRowShift>(hn::DemoteTo(di, inR)),
                  hn::FirstN(di, std::size_t(count - step * kLanes)), some);
        });
    }
}

/// True where at least three of four lanes of vectors along t have a row.
bool fillsVectors(int countT) {
    constexpr int kLanes = int(hn::MaxLanes(D()));
    return (countT + kLanes - 1) / kLanes * kLanes * 3 <= countT * 4;
}

void walkElement(Walk& walk, int lane) {
    Scratch& scratch = walk.scratch;
    const Batch& batch = scratch.batch;
    if (batch.countT[lane] * batch.countR[lane] == 0) return;
    if (batch.grade[lane] == kThin) {
        scanElementExactly(walk.input, walk.output, scratch.element[lane], walk.counts);
        return;
    }
    const int axis = int(batch.axis[lane]);
    scratch.stride[lane] = walk.output.stride[axis];
    scratch.longest[lane] = axis == 0 && (scratch.floatBits >> lane & 1) ? kShortRun : 0;
    const int lower = kFaceOrder[std::size_t(batch.lower[lane])].lower;
    if (HWY_UNLIKELY(batch.grade[lane] != kEasy || lower == 0 || lower == 4))
        solveRows<RowOrder::careful>(walk, lane);
    else if (fillsVectors(batch.countT[lane]))
        solveRows<RowOrder::aligned>(walk, lane);
    else
        solveRows<RowOrder::packed>(walk, lane);
}

// Elements reach for their nodes in no order: fetch those of the next batch while this one is worked, and the
// elements after that.
void prefetch(const ScanInput& input, std::span<const std::int32_t> elements, std::size_t begin) {
    const std::size_t end = std::min(begin + kBatch, elements.size());
    for (std::size_t i = begin; i < end; ++i)
        for (const std::int32_t node : input.mesh.tets[std::size_t(elements[i])])
            __builtin_prefetch(&input.frame.nodes[std::size_t(node)]);
    for (std::size_t c = std::size_t(input.frame.valueCount); c < input.channels.size(); ++c) {
        const ScanChannel& channel = input.channels[c];
        if (channel.cell || (channel.component != 0 && c != std::size_t(input.frame.valueCount))) continue;
        for (std::size_t i = begin; i < end; ++i)
            for (const std::int32_t node : input.mesh.tets[std::size_t(elements[i])])
                __builtin_prefetch(channel.values + std::int64_t(node) * channel.components);
    }
    for (std::size_t i = end; i < std::min(end + kBatch, elements.size()); ++i)
        __builtin_prefetch(&input.mesh.tets[std::size_t(elements[i])]);
}

void scan(const ScanInput& input, const ScanOutput& output, std::span<const std::int32_t> elements,
          ScanCounts& counts) {
    static thread_local Scratch scratch;
    scratch.channels.resize(std::max<std::size_t>(1, input.channels.size()));
    scratch.found.count = 0;  // an exception may have left some
    Walk walk{input, output, scratch, counts, {}, {}, {}, {}, {}};
    for (int a = 0; a < 3; ++a) {
        walk.regionMin[a] = output.region.min[a];
        walk.regionLast[a] = output.region.max[a] - 1;
        walk.blockMin[a] = output.blockBox.min[a];
        walk.stride[a] = double(output.stride[a]);
    }
    const bool isLarge = input.frame.nodes.size() * sizeof(NodeFrame::Node) > kCacheBytes;
    for (std::size_t begin = 0; begin < elements.size(); begin += kBatch) {
        const int count = int(std::min<std::size_t>(kBatch, elements.size() - begin));
        const std::int32_t* batchElements = elements.data() + begin;
        if (isLarge) prefetch(input, elements, begin + kBatch);
        loadBatch(walk, batchElements, count);
        scratch.floatBits = ~0u;
        for (std::size_t c = 0; c < input.channels.size(); ++c) {
            BatchChannel& channel = scratch.channels[c];
            loadChannel(input, input.channels[c], batchElements, count, scratch.batch,
                        int(c) < input.frame.valueCount, channel);
            scratch.floatBits &= channel.floatBits;
        }
        std::copy_n(batchElements, count, scratch.element);
        for (int lane = 0; lane < count; ++lane) walkElement(walk, lane);
        writeFound(walk);
    }
}

}  // namespace tessera::scan_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera {

const std::vector<ScanTarget>& scanTargets() {
    static const std::vector<ScanTarget> targets = [] {
        std::vector<ScanTarget> found;
        [[maybe_unused]] const auto supported = hwy::SupportedTargets();
#if HWY_TARGETS & HWY_AVX3
        if (supported & HWY_AVX3) found.push_back({"AVX3", &scan_kernel::N_AVX3::scan});
#endif
#if HWY_TARGETS & HWY_AVX2
        if (supported & HWY_AVX2) found.push_back({"AVX2", &scan_kernel::N_AVX2::scan});
#endif
#if HWY_TARGETS & HWY_SSE4
        if (supported & HWY_SSE4) found.push_back({"SSE4", &scan_kernel::N_SSE4::scan});
#endif
        found.push_back({"baseline", &scan_kernel::HWY_NAMESPACE::scan});
        return found;
    }();
    return targets;
}

}  // namespace tessera
#endif
