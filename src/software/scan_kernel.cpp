// The scanline walk of Weiler and Ertl 2001, section 4, for eight elements and eight scanlines at a time.
//
// Each face of an element is solved for the scan axis, s >= A + B t + C r or s <= A + B t + C r, so a
// scanline's ends are a maximum and a minimum of at most three such planes. Planes are moved outwards by a
// bound on all rounding, so no point of the element is lost; elements for which that bound would let a point
// outside be covered go to scanElementExactly. Every operation is a single IEEE operation in a fixed order,
// so every instruction set gives the same bits.

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "software/scan_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "software/scan_kernel.cpp"
// Each costs its compile time; under a sanitizer two have to do.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3 | HWY_AVX3_DL)
#else
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#endif
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef TESSERA_SCAN_KERNEL_COMMON
#define TESSERA_SCAN_KERNEL_COMMON
namespace tessera::scan_kernel {

inline constexpr int kBatch = 8;
/// Runs of at least this many voxels along x are filled a vector at a time.
inline constexpr int kLongRun = 8;
inline constexpr double kUnit = 0x1p-53;
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
    double whole[4][3][kBatch], part[4][3][kBatch];  // node places
    double planeA[4][kBatch], planeB[4][kBatch], planeC[4][kBatch];
    double lower[4][kBatch];                                        // 1 when face i bounds s from below
    double base[3][kBatch];                                         // first voxel, x y z
    double axis[kBatch];                                            // scan axis
    double minS[kBatch], maxS[kBatch];                              // widened bounds
    double minT[kBatch], maxT[kBatch], minR[kBatch], maxR[kBatch];  // whole numbers
    double grade[kBatch];                                           // kThin, kDoubtful or kEasy
    double shrink[4][kBatch];  // added to planeA: the face moved inwards by as much as it was moved outwards
    double gradient[4][3][kBatch], constant[4][kBatch];  // barycentrics: constant + gradient . (s, t, r)
};

/// A channel of eight elements: value = constant + s, t, r times the gradient, limited to [low, high].
struct alignas(64) BatchChannel {
    double node[4][kBatch];
    double constant[kBatch], gradientS[kBatch], gradientT[kBatch], gradientR[kBatch];
    float low[kBatch], high[kBatch];
    bool finite[kBatch];
    bool inDouble[kBatch];  // a run's values don't come out right in float: denormal steps, too many of them,
                            // or steps that overflow
    // Of the element and group of scanlines at work:
    alignas(64) double first[kBatch];  // value at the first voxel of each scanline's run
    float step;                        // difference from voxel to voxel
};

struct Scratch {
    Batch batch;
    std::vector<BatchChannel> channels;
};

}  // namespace tessera::scan_kernel
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::scan_kernel::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<double, kBatch>;
using V = hn::VFromD<D>;
using M = decltype(hn::Eq(V(), V()));

HWY_INLINE V abs3(V a, V b, V c) {
    return hn::Add(hn::Add(hn::Abs(a), hn::Abs(b)), hn::Abs(c));
}
HWY_INLINE V dot3(V a0, V a1, V a2, V b0, V b1, V b2) {
    return hn::Add(hn::Add(hn::Mul(a0, b0), hn::Mul(a1, b1)), hn::Mul(a2, b2));
}
HWY_INLINE V cross1(V a, V b, V c, V d) {
    return hn::Sub(hn::Mul(a, b), hn::Mul(c, d));
}

// Planes, bounds and gradients of the lanes from `lane` on.
void setUpLanes(Batch& batch, std::size_t lane) {
    const D d;
    V v[4][3], low[3], high[3];
    for (int a = 0; a < 3; ++a) {
        V whole[4];
        for (int k = 0; k < 4; ++k) whole[k] = hn::Load(d, &batch.whole[k][a][lane]);
        const V base = hn::Min(hn::Min(whole[0], whole[1]), hn::Min(whole[2], whole[3]));
        hn::Store(base, d, &batch.base[a][lane]);
        for (int k = 0; k < 4; ++k)
            v[k][a] = hn::Add(hn::Sub(whole[k], base), hn::Load(d, &batch.part[k][a][lane]));
        low[a] = hn::Min(hn::Min(v[0][a], v[1][a]), hn::Min(v[2][a], v[3][a]));
        high[a] = hn::Max(hn::Max(v[0][a], v[1][a]), hn::Max(v[2][a], v[3][a]));
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
    const auto turn = [&](V& a, V& b, V& c) {
        const V s = hn::IfThenElse(alongZ, c, hn::IfThenElse(alongY, b, a));
        const V t = hn::IfThenElse(alongX, b, a);
        const V r = hn::IfThenElse(alongZ, b, c);
        a = s;
        b = t;
        c = r;
    };
    for (int k = 0; k < 4; ++k) turn(v[k][0], v[k][1], v[k][2]);
    turn(low[0], low[1], low[2]);
    turn(high[0], high[1], high[2]);
    const V slack = hn::Set(d, kBoxSlack);
    hn::Store(hn::Sub(low[0], slack), d, &batch.minS[lane]);
    hn::Store(hn::Add(high[0], slack), d, &batch.maxS[lane]);
    hn::Store(hn::Ceil(hn::Sub(low[1], slack)), d, &batch.minT[lane]);
    hn::Store(hn::Floor(hn::Add(high[1], slack)), d, &batch.maxT[lane]);
    hn::Store(hn::Ceil(hn::Sub(low[2], slack)), d, &batch.minR[lane]);
    hn::Store(hn::Floor(hn::Add(high[2], slack)), d, &batch.maxR[lane]);

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
    const V one = hn::Set(d, 1.0);
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
    for (int k = 0; k < 4; ++k) {
        const V s = g[k][0];
        const V reciprocal = hn::IfThenElse(hn::Lt(hn::Abs(s), tiny), hn::Set(d, kParallel), hn::Div(one, s));
        hn::Store(hn::Neg(hn::Mul(hn::Add(dilation, c[k]), reciprocal)), d, &batch.planeA[k][lane]);
        hn::Store(hn::Mul(hn::Add(dilation, dilation), reciprocal), d, &batch.shrink[k][lane]);
        hn::Store(hn::Neg(hn::Mul(g[k][1], reciprocal)), d, &batch.planeB[k][lane]);
        hn::Store(hn::Neg(hn::Mul(g[k][2], reciprocal)), d, &batch.planeC[k][lane]);
        hn::Store(hn::IfThenElseZero(hn::Gt(reciprocal, hn::Zero(d)), one), d, &batch.lower[k][lane]);
        hn::Store(c[k], d, &batch.constant[k][lane]);
        for (int a = 0; a < 3; ++a) hn::Store(g[k][a], d, &batch.gradient[k][a][lane]);
    }
}

// value = f0 + sum over i of (fi - f0) b_i.
void setUpChannelLanes(const Batch& batch, BatchChannel& channel, std::size_t lane) {
    const D d;
    const V f0 = hn::Load(d, &channel.node[0][lane]);
    V sum[4] = {f0, hn::Zero(d), hn::Zero(d), hn::Zero(d)};
    for (int k = 1; k < 4; ++k) {
        const V df = hn::Sub(hn::Load(d, &channel.node[k][lane]), f0);
        sum[0] = hn::Add(sum[0], hn::Mul(df, hn::Load(d, &batch.constant[k][lane])));
        for (int a = 0; a < 3; ++a)
            sum[a + 1] = hn::Add(sum[a + 1], hn::Mul(df, hn::Load(d, &batch.gradient[k][a][lane])));
    }
    hn::Store(sum[0], d, &channel.constant[lane]);
    hn::Store(sum[1], d, &channel.gradientS[lane]);
    hn::Store(sum[2], d, &channel.gradientT[lane]);
    hn::Store(sum[3], d, &channel.gradientR[lane]);
}

void loadBatch(const ScanInput& input, const std::int32_t* elements, int count, Batch& batch) {
    for (int lane = 0; lane < kBatch; ++lane) {
        const auto& tet = input.mesh.tets[std::size_t(elements[lane < count ? lane : 0])];
        for (std::size_t k = 0; k < 4; ++k) {
            const NodeFrame::Node& node = input.frame.nodes[std::size_t(tet[k])];
            for (int a = 0; a < 3; ++a) {
                batch.whole[k][a][lane] = node.whole[a];
                batch.part[k][a][lane] = node.part[a];
            }
        }
    }
    for (std::size_t lane = 0; lane < kBatch; lane += hn::Lanes(D())) setUpLanes(batch, lane);
}

void loadChannel(const ScanInput& input, const ScanChannel& source, const std::int32_t* elements, int count,
                 const Batch& batch, BatchChannel& channel) {
    for (int lane = 0; lane < kBatch; ++lane) {
        const std::int32_t element = elements[lane < count ? lane : 0];
        const auto& tet = input.mesh.tets[std::size_t(element)];
        float low = std::numeric_limits<float>::infinity(), high = -low;
        bool finite = true;
        for (std::size_t k = 0; k < 4; ++k) {
            const double value = source.at(source.cell ? element : tet[k]);
            const float rounded = float(value);
            finite = finite && std::isfinite(rounded);
            low = rounded < low ? rounded : low;
            high = rounded > high ? rounded : high;
            channel.node[k][lane] = value;
        }
        channel.low[lane] = low;
        channel.high[lane] = high;
        channel.finite[lane] = finite;
        channel.inDouble[lane] = std::max(std::fabs(low), std::fabs(high)) < kDenormalSteps ||
                                 batch.maxS[lane] - batch.minS[lane] > kMostFloatSteps ||
                                 double(high) - double(low) >= kWidestFloatRange;
        if (!finite)
            for (std::size_t k = 0; k < 4; ++k) channel.node[k][lane] = 0.0;
    }
    for (std::size_t lane = 0; lane < kBatch; lane += hn::Lanes(D())) setUpChannelLanes(batch, channel, lane);
}

// The state of one element while its scanlines are walked.
struct Walk {
    const ScanInput& input;
    const ScanOutput& output;
    Scratch& scratch;
    ScanCounts& counts;
    std::int32_t element;
    int lane;
    std::int64_t strideS, strideT, strideR;
    std::int64_t origin;  // offset of the element's first voxel in the block (may lie outside)
    int axis;
    bool simple;  // see writeSimpleRun
    std::optional<ElementDepth> depth;
    std::optional<ExactScanlines> exact;
};

// A group of scanlines: where each one's run starts in the block, how long it is there, and how many of its
// voxels lie before the region.
struct alignas(64) Rows {
    std::int32_t offset[kBatch], length[kBatch];
    double skipped[kBatch];
};

HWY_INLINE float limited(float value, float low, float high) {
    value = value < low ? low : value;
    return value > high ? high : value;
}

float valueAt(const BatchChannel& channel, int lane, int row, double step) {
    if (!channel.finite[lane]) return std::numeric_limits<float>::quiet_NaN();
    const float value = channel.inDouble[lane] ? float(channel.first[row] + step * channel.gradientS[lane])
                                               : float(channel.first[row]) + float(step) * channel.step;
    return limited(value, channel.low[lane], channel.high[lane]);
}

// The element's rank at a point it covers. On a face, where conforming meshes are contested, it is zero, and
// a look at the barycentrics tells: one that is worth less than 2^-15 voxel, which leaves the errors of both
// ways of computing it inside the step of 2^-13.
double rankOf(Walk& walk, std::int64_t offset) {
    const Batch& batch = walk.scratch.batch;
    const int lane = walk.lane;
    const Vec3i point = walk.output.pointAt(offset);
    if (batch.grade[lane] == kEasy) {
        const int axes[3] = {walk.axis, walk.axis == 0 ? 1 : 0, walk.axis == 2 ? 1 : 2};
        double local[3];
        for (int i = 0; i < 3; ++i) local[i] = point[axes[i]] - batch.base[axes[i]][lane];
        for (int k = 0; k < 4; ++k) {
            const double gs = batch.gradient[k][0][lane], gt = batch.gradient[k][1][lane],
                         gr = batch.gradient[k][2][lane];
            const double b = batch.constant[k][lane] + gs * local[0] + gt * local[1] + gr * local[2];
            if (b < 0x1p-15 * std::max({std::fabs(gs), std::fabs(gt), std::fabs(gr)})) return 0.0;
        }
    }
    if (!walk.depth) walk.depth.emplace(walk.input.mesh, walk.input.frame, walk.element);
    return walk.depth->rank(point);
}

// Points of the run that another element covers already: the deeper one owns them.
HWY_NOINLINE void writeContestedRun(Walk& walk, const Rows& rows, int row) {
    const Scratch& scratch = walk.scratch;
    std::int64_t offset = rows.offset[row];
    for (int k = 0; k < rows.length[row]; ++k, offset += walk.strideS) {
        std::int32_t& owner = walk.output.owner[offset];
        if (owner == kNoOwner) {
            owner = walk.element;
        } else {
            ++walk.counts.contested;
            if (!contestPoint(walk.input, walk.output, walk.element, rankOf(walk, offset), offset)) continue;
        }
        const double step = rows.skipped[row] + k;
        for (std::size_t c = 0; c < scratch.channels.size(); ++c) {
            walk.output.values[c][offset] = valueAt(scratch.channels[c], walk.lane, row, step);
        }
    }
}

// Values of one run of voxels that nothing covered before, counted from the run's own first voxel so that
// they don't depend on the region.
HWY_INLINE void fillRun(float* out, std::int64_t stride, int length, int skipped, float value, float step,
                        float low, float high) {
    int k = 0;
    if (stride == 1 && length >= kLongRun) {
        const hn::ScalableTag<float> df;
        const int lanes = int(hn::Lanes(df));
        const auto lowest = hn::Set(df, low), highest = hn::Set(df, high), slope = hn::Set(df, step),
                   first = hn::Set(df, value);
        for (; k + lanes <= length; k += lanes) {
            auto v = hn::Add(first, hn::Mul(hn::Iota(df, float(skipped + k)), slope));
            v = hn::IfThenElse(hn::Lt(v, lowest), lowest, v);
            v = hn::IfThenElse(hn::Gt(v, highest), highest, v);
            hn::StoreU(v, df, out + k);
        }
    }
    for (; k < length; ++k) out[k * stride] = limited(value + float(skipped + k) * step, low, high);
}

HWY_INLINE void writeRun(Walk& walk, const Rows& rows, int row) {
    const int length = rows.length[row];
    const std::int64_t offset = rows.offset[row];
    std::int32_t* const owner = walk.output.owner + offset;
    const std::int64_t stride = walk.strideS;
    std::int32_t free = kNoOwner;
    for (int k = 0; k < length; ++k) free &= owner[k * stride];
    if (free != kNoOwner) {
        writeContestedRun(walk, rows, row);
        return;
    }
    for (int k = 0; k < length; ++k) owner[k * stride] = walk.element;
    const Scratch& scratch = walk.scratch;
    for (std::size_t c = 0; c < scratch.channels.size(); ++c) {
        const BatchChannel& channel = scratch.channels[c];
        float* const out = walk.output.values[c] + offset;
        if (channel.finite[walk.lane] && !channel.inDouble[walk.lane]) {
            fillRun(out, stride, length, int(rows.skipped[row]), float(channel.first[row]), channel.step,
                    channel.low[walk.lane], channel.high[walk.lane]);
        } else {
            for (int k = 0; k < length; ++k)
                out[k * stride] = valueAt(channel, walk.lane, row, rows.skipped[row] + k);
        }
    }
}

// The common case, in one loop: one channel, finite, in float, along x, a short run.
HWY_INLINE void writeSimpleRun(Walk& walk, const Rows& rows, int row) {
    const int length = rows.length[row];
    if (length >= kLongRun) {
        writeRun(walk, rows, row);
        return;
    }
    std::int32_t* const owner = walk.output.owner + rows.offset[row];
    const BatchChannel& channel = walk.scratch.channels[0];
    float* const out = walk.output.values[0] + rows.offset[row];
    const auto value = float(channel.first[row]);
    const auto skipped = float(rows.skipped[row]);
    const float step = channel.step, low = channel.low[walk.lane], high = channel.high[walk.lane];
    const std::int32_t element = walk.element;
    // Few branches that depend on the length: two vectors that overlap in the middle.
    const hn::CappedTag<float, 4> df;
    const hn::RebindToSigned<decltype(df)> di;
    const auto valuesAt = [&](auto number) {
        const auto v = hn::Add(hn::Set(df, value), hn::Mul(number, hn::Set(df, step)));
        const auto raised = hn::IfThenElse(hn::Lt(v, hn::Set(df, low)), hn::Set(df, low), v);
        return hn::IfThenElse(hn::Gt(raised, hn::Set(df, high)), hn::Set(df, high), raised);
    };
    if (length >= 4) {
        const int last = length - 4;
        const auto free = hn::And(hn::LoadU(di, owner), hn::LoadU(di, owner + last));
        if (!hn::AllTrue(di, hn::Eq(free, hn::Set(di, kNoOwner)))) {
            writeContestedRun(walk, rows, row);
            return;
        }
        hn::StoreU(hn::Set(di, element), di, owner);
        hn::StoreU(hn::Set(di, element), di, owner + last);
        hn::StoreU(valuesAt(hn::Iota(df, skipped)), df, out);
        hn::StoreU(valuesAt(hn::Iota(df, skipped + float(last))), df, out + last);
        return;
    }
    const int middle = length / 2, last = length - 1;
    if ((owner[0] & owner[middle] & owner[last]) != kNoOwner) {
        writeContestedRun(walk, rows, row);
        return;
    }
    owner[0] = owner[middle] = owner[last] = element;
    out[0] = limited(value + skipped * step, low, high);
    out[middle] = limited(value + (skipped + float(middle)) * step, low, high);
    out[last] = limited(value + (skipped + float(last)) * step, low, high);
}

// True for scanlines whose ends differ too much when the faces are moved inwards instead of outwards.
template <int Lower>
HWY_INLINE M doubtfulEnds(const Batch& batch, int lane, const int (&order)[4], V t, V r, V minS, V maxS,
                          V begin, V end) {
    const D d;
    V low = minS, high = maxS;
    for (int i = 0; i < 4; ++i) {
        const int face = order[i];
        const V bound = hn::Add(hn::Add(hn::Set(d, batch.planeA[face][lane] + batch.shrink[face][lane]),
                                        hn::Mul(hn::Set(d, batch.planeB[face][lane]), t)),
                                hn::Mul(hn::Set(d, batch.planeC[face][lane]), r));
        if (i < Lower)
            low = hn::Max(low, bound);
        else
            high = hn::Min(high, bound);
    }
    // Where the scanline surely meets the element, an end within the tolerance of it is as good as exact.
    const V tolerance = hn::Set(d, kEndTolerance);
    const auto lowDiffers = hn::And(hn::Ne(hn::Ceil(low), begin), hn::Gt(hn::Sub(low, begin), tolerance));
    const auto highDiffers = hn::And(hn::Ne(hn::Floor(high), end), hn::Gt(hn::Sub(end, high), tolerance));
    return hn::And(hn::Le(begin, end), hn::Or(hn::Gt(low, high), hn::Or(lowDiffers, highDiffers)));
}

// Replaces the ends of the scanlines that double precision can't decide.
HWY_NOINLINE void decideEnds(Walk& walk, M doubtful, V t, V r, V& begin, V& end) {
    const D d;
    alignas(64) double ts[kBatch], rs[kBatch], begins[kBatch], ends[kBatch];
    std::uint8_t bits[8] = {};
    hn::Store(t, d, ts);
    hn::Store(r, d, rs);
    hn::Store(begin, d, begins);
    hn::Store(end, d, ends);
    hn::StoreMaskBits(d, doubtful, bits);
    if (!walk.exact) walk.exact.emplace(walk.input, walk.element, walk.axis);
    for (std::size_t i = 0; i < hn::Lanes(d); ++i)
        if ((bits[0] >> i) & 1) walk.exact->ends(ts[i], rs[i], begins[i], ends[i]);
    begin = hn::Load(d, begins);
    end = hn::Load(d, ends);
}

// Scanlines of one element inside the region; `Lower` of the four faces, those first in `order`, bound s from
// below.
template <int Lower>
void walkRows(Walk& walk, const int (&order)[4], const double (&from)[3], const double (&to)[3]) {
    const D d;
    const hn::Rebind<std::int32_t, D> di;
    const Batch& batch = walk.scratch.batch;
    const int lane = walk.lane;
    const std::size_t channels = walk.input.channels.size();
    const bool isDoubtful = batch.grade[lane] == kDoubtful;
    const V minS = hn::Set(d, batch.minS[lane]), maxS = hn::Set(d, batch.maxS[lane]);
    const V fromS = hn::Set(d, from[0]), toS = hn::Set(d, to[0]), toR = hn::Set(d, to[2]);
    const V origin = hn::Set(d, double(walk.origin)), strideS = hn::Set(d, double(walk.strideS)),
            strideT = hn::Set(d, double(walk.strideT)), strideR = hn::Set(d, double(walk.strideR));
    // The rows, along t and then along r, a vector of them at a time.
    const double countT = to[1] - from[1] + 1, total = countT * (to[2] - from[2] + 1);
    const auto lanes = double(hn::Lanes(d));
    const double stepR = std::floor(lanes / countT);
    const V perRow = hn::Set(d, countT), aheadR = hn::Set(d, stepR),
            aheadT = hn::Set(d, lanes - stepR * countT), one = hn::Set(d, 1.0);
    const V numbers = hn::Iota(d, 0.0), firstR = hn::Floor(hn::Div(numbers, perRow));
    V nextT = hn::Sub(numbers, hn::Mul(firstR, perRow)), nextR = hn::Add(firstR, hn::Set(d, from[2]));
    walk.counts.scanlines += std::int64_t(total);
    Rows rows;
    for (double done = 0; done < total; done += kBatch) {
        unsigned hit = 0;
        for (std::size_t q = 0; q < kBatch; q += hn::Lanes(d)) {
            const V t = hn::Add(hn::Set(d, from[1]), nextT), r = nextR;
            nextT = hn::Add(nextT, aheadT);
            nextR = hn::Add(nextR, aheadR);
            const auto over = hn::Ge(nextT, perRow);
            nextT = hn::IfThenElse(over, hn::Sub(nextT, perRow), nextT);
            nextR = hn::IfThenElse(over, hn::Add(nextR, one), nextR);
            V low = minS, high = maxS;
            for (int i = 0; i < 4; ++i) {
                const int face = order[i];
                const V bound = hn::Add(hn::Add(hn::Set(d, batch.planeA[face][lane]),
                                                hn::Mul(hn::Set(d, batch.planeB[face][lane]), t)),
                                        hn::Mul(hn::Set(d, batch.planeC[face][lane]), r));
                if (i < Lower)
                    low = hn::Max(low, bound);
                else
                    high = hn::Min(high, bound);
            }
            V begin = hn::Ceil(low), end = hn::Floor(high);
            if (isDoubtful) {
                const auto used = hn::Le(r, toR);
                const auto doubtful =
                    hn::And(used, doubtfulEnds<Lower>(batch, lane, order, t, r, minS, maxS, begin, end));
                if (!hn::AllFalse(d, doubtful)) decideEnds(walk, doubtful, t, r, begin, end);
            }
            const V clippedBegin = hn::Max(begin, fromS), clippedEnd = hn::Min(end, toS);
            const auto inside = hn::And(hn::Le(clippedBegin, clippedEnd), hn::Le(r, toR));
            if (hn::AllFalse(d, inside)) continue;
            const V offset = hn::Add(hn::Add(origin, hn::Mul(clippedBegin, strideS)),
                                     hn::Add(hn::Mul(t, strideT), hn::Mul(r, strideR)));
            const V length = hn::Add(hn::Sub(clippedEnd, clippedBegin), one);
            hn::Store(hn::DemoteTo(di, offset), di, rows.offset + q);
            hn::Store(hn::DemoteTo(di, length), di, rows.length + q);
            hn::Store(hn::Sub(clippedBegin, begin), d, rows.skipped + q);
            std::uint8_t bits[8] = {};
            hn::StoreMaskBits(d, inside, bits);
            hit |= unsigned(bits[0]) << q;
            for (std::size_t c = 0; c < channels; ++c) {
                BatchChannel& channel = walk.scratch.channels[c];
                const V value = hn::Add(hn::Add(hn::Add(hn::Set(d, channel.constant[lane]),
                                                        hn::Mul(hn::Set(d, channel.gradientT[lane]), t)),
                                                hn::Mul(hn::Set(d, channel.gradientR[lane]), r)),
                                        hn::Mul(hn::Set(d, channel.gradientS[lane]), begin));
                hn::Store(value, d, channel.first + q);
            }
        }
        for (unsigned ahead = hit; ahead; ahead &= ahead - 1)
            __builtin_prefetch(walk.output.owner + rows.offset[std::countr_zero(ahead)], 1);
        if (walk.simple) {
            for (; hit; hit &= hit - 1) writeSimpleRun(walk, rows, std::countr_zero(hit));
        } else {
            for (; hit; hit &= hit - 1) writeRun(walk, rows, std::countr_zero(hit));
        }
    }
}

void walkElement(const ScanInput& input, const ScanOutput& output, Scratch& scratch, std::int32_t element,
                 int lane, ScanCounts& counts) {
    const Batch& batch = scratch.batch;
    const int axis = int(batch.axis[lane]);
    const int axes[3] = {axis, axis == 0 ? 1 : 0, axis == 2 ? 1 : 2};  // of s, t and r
    // The part of the element's rows that lies in the region, relative to its first voxel.
    double from[3], to[3];
    for (int a = 0; a < 3; ++a) {
        from[a] = output.region.min[axes[a]] - batch.base[axes[a]][lane];
        to[a] = output.region.max[axes[a]] - 1 - batch.base[axes[a]][lane];
    }
    from[1] = std::max(from[1], batch.minT[lane]);
    to[1] = std::min(to[1], batch.maxT[lane]);
    from[2] = std::max(from[2], batch.minR[lane]);
    to[2] = std::min(to[2], batch.maxR[lane]);
    if (!(from[1] <= to[1] && from[2] <= to[2])) return;

    int order[4], lower = 0, upper = 4;
    for (int k = 0; k < 4; ++k) {
        if (batch.lower[k][lane] != 0.0)
            order[lower++] = k;
        else
            order[--upper] = k;
    }
    constexpr double kLimit = std::numeric_limits<float>::max();
    for (BatchChannel& channel : scratch.channels)
        channel.step = float(std::clamp(channel.gradientS[lane], -kLimit, kLimit));
    Walk walk{input,
              output,
              scratch,
              counts,
              element,
              lane,
              output.stride[axes[0]],
              output.stride[axes[1]],
              output.stride[axes[2]],
              0,
              axis,
              false,
              {},
              {}};
    walk.simple = axis == 0 && scratch.channels.size() == 1 && scratch.channels[0].finite[lane] &&
                  !scratch.channels[0].inDouble[lane];
    for (int a = 0; a < 3; ++a) {
        walk.origin += (std::int64_t(batch.base[a][lane]) - output.blockBox.min[a]) * output.stride[a];
    }
    switch (lower) {
        case 0:
            walkRows<0>(walk, order, from, to);
            break;
        case 1:
            walkRows<1>(walk, order, from, to);
            break;
        case 2:
            walkRows<2>(walk, order, from, to);
            break;
        case 3:
            walkRows<3>(walk, order, from, to);
            break;
        default:
            walkRows<4>(walk, order, from, to);
            break;
    }
}

// Elements reach for their nodes in no order: fetch those of the next batch while this one is worked, and the
// elements after that.
void prefetch(const ScanInput& input, std::span<const std::int32_t> elements, std::size_t begin) {
    for (std::size_t i = begin; i < std::min(begin + kBatch, elements.size()); ++i) {
        for (const std::int32_t node : input.mesh.tets[std::size_t(elements[i])]) {
            __builtin_prefetch(&input.frame.nodes[std::size_t(node)]);
            for (const ScanChannel& channel : input.channels)
                if (!channel.cell && channel.component == 0)
                    __builtin_prefetch(channel.values + std::int64_t(node) * channel.components);
        }
    }
    for (std::size_t i = begin + kBatch; i < std::min(begin + 2 * kBatch, elements.size()); ++i)
        __builtin_prefetch(&input.mesh.tets[std::size_t(elements[i])]);
}

void scan(const ScanInput& input, const ScanOutput& output, std::span<const std::int32_t> elements,
          ScanCounts& counts) {
    static thread_local Scratch scratch;
    scratch.channels.resize(input.channels.size());
    for (std::size_t begin = 0; begin < elements.size(); begin += kBatch) {
        const int count = int(std::min<std::size_t>(kBatch, elements.size() - begin));
        const std::int32_t* batchElements = elements.data() + begin;
        prefetch(input, elements, begin + kBatch);
        loadBatch(input, batchElements, count, scratch.batch);
        for (std::size_t c = 0; c < input.channels.size(); ++c)
            loadChannel(input, input.channels[c], batchElements, count, scratch.batch, scratch.channels[c]);
        for (int lane = 0; lane < count; ++lane) {
            if (scratch.batch.grade[lane] != kThin)
                walkElement(input, output, scratch, batchElements[lane], lane, counts);
            else
                scanElementExactly(input, output, batchElements[lane], counts);
        }
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
