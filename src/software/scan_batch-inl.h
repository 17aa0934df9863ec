// Part of the scan that every instruction set compiles for itself: what is known of eight elements before
// their rows are walked.

#include <hwy/highway.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "software/scan_kernel.h"

#ifndef TESSERA_SCAN_BATCH_COMMON
#define TESSERA_SCAN_BATCH_COMMON
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

/// Lambdas that hold an inner loop: as one function of its own it would keep its vectors in memory.
#define TESSERA_INLINE __attribute__((always_inline))

#endif

#if defined(TESSERA_SCAN_BATCH_TOGGLE) == defined(HWY_TARGET_TOGGLE)
#ifdef TESSERA_SCAN_BATCH_TOGGLE
#undef TESSERA_SCAN_BATCH_TOGGLE
#else
#define TESSERA_SCAN_BATCH_TOGGLE
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

}  // namespace tessera::scan_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
