// The scanline walk of Weiler and Ertl 2001, section 4, for eight elements and a vector of scanlines at a
// time.
//
// Each face of an element is solved for the scan axis, s >= A + B t + C r or s <= A + B t + C r, so a
// scanline's ends are a maximum and a minimum of at most three such planes. Planes are moved outwards by a
// bound on all rounding, so no point of the element is lost; elements for which that bound would let a point
// outside be covered go to scanElementExactly. Every operation is a single IEEE operation in a fixed order,
// so every instruction set gives the same bits.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/vector_targets.h"
#include "software/scan_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "software/scan_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "software/scan_batch-inl.h"
#include "software/scan_runs-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tessera::scan_kernel::HWY_NAMESPACE {

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
    if (batch.countT[lane] == 0 || batch.countR[lane] == 0) return;
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
