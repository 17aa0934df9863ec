// Part of the scan that every instruction set compiles for itself: the rows found become runs in the block.

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "software/scan_batch-inl.h"

#if defined(TESSERA_SCAN_RUNS_TOGGLE) == defined(HWY_TARGET_TOGGLE)
#ifdef TESSERA_SCAN_RUNS_TOGGLE
#undef TESSERA_SCAN_RUNS_TOGGLE
#else
#define TESSERA_SCAN_RUNS_TOGGLE
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::scan_kernel::HWY_NAMESPACE {

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
    std::int64_t offset = runs.offset[row];
    for (int k = 0; k < runs.length[row]; ++k, offset += scratch.stride[lane]) {
        const bool takes = coverPoint(walk.input, walk.output, scratch.element[lane], offset, walk.counts,
                                      [&] { return rankOf(walk, lane, offset); });
        if (!takes) continue;
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

}  // namespace tessera::scan_kernel::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
