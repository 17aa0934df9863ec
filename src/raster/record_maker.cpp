#include "raster/record_maker.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <random>

#include "base/check.h"
#include "base/parallel.h"
#include "index_space/exact_scan.h"
#include "raster/shaders.h"

namespace tessera {

namespace {

constexpr std::uint32_t kDecidedBit = 1u << 31;
constexpr std::size_t kFan = 32;  ///< of the levels of sums
constexpr std::int64_t kChunk = 16384;
constexpr std::size_t kOperations = 8, kOperands = 4096;
constexpr std::size_t kRunCounts = 2 * (kPartSizes + 1) + 1;
constexpr std::size_t kLayers = std::size_t(kCellEdge) + 1;  ///< and the one behind the last
constexpr std::size_t kEmptyCounters = 64;                   ///< so that not all threads meet at one

/// As shaders compute them.
void operate(double a, double b, double (&results)[kOperations]) {
    const double made[kOperations] = {
        a + b, a - b, a * b, a / b, std::floor(a), std::sqrt(std::fabs(a)), a * b + a, double(float(a))};
    std::ranges::copy(made, results);
}

/// Zero where that isn't finite.
Vec3d sizeOf(const TetMesh& mesh, const std::array<std::uint32_t, 4>& tet) {
    Vec3d low = mesh.points[tet[0]], high = low;
    for (const std::uint32_t node : tet) {
        low = glm::min(low, mesh.points[node]);
        high = glm::max(high, mesh.points[node]);
    }
    const Vec3d size = high - low;
    return std::isfinite(size.x + size.y + size.z) ? size : Vec3d(0);
}

}  // namespace

DeviceMesh::Source::Source(const TetMesh& mesh, std::span<const ChannelCoding> channels, SampleFormat format,
                           const Execution& execution)
    : whole(mesh) {
    const float invalid = sampleMarks(format).invalid;
    for (std::size_t from = 0; from < std::max<std::size_t>(1, channels.size()); from += kChannelsAPass) {
        const auto codings = channels.subspan(from, std::min(kChannelsAPass, channels.size() - from));
        Pass& pass = passes.emplace_back();
        pass.channels = std::max(1, int(codings.size()));
        if (codings.empty()) pass.cellMask = 1;  // one that says nothing, of every element
        for (std::size_t c = 0; c < codings.size(); ++c)
            pass.cellMask |= unsigned(codings[c].isOfCells()) << c;
        const auto ofCells = std::size_t(std::popcount(pass.cellMask));
        const std::size_t ofNodes = std::size_t(pass.channels) - ofCells;
        pass.nodeCodes.resize(ofNodes * mesh.points.size());
        pass.cellCodes.resize(ofCells * mesh.tets.size());
        std::size_t n = 0, k = 0;
        for (const ChannelCoding& coding : codings) {
            const bool isOfCells = coding.isOfCells();
            const std::size_t place = isOfCells ? k++ : n++;
            parallelForChunks(execution, isOfCells ? mesh.elementCount() : mesh.nodeCount(), kChunk,
                              [&](std::int64_t begin, std::int64_t end) {
                                  for (std::int64_t i = begin; i < end; ++i)
                                      if (isOfCells)
                                          pass.cellCodes[std::size_t(i) * ofCells + place] =
                                              cellCode(coding, std::int32_t(i), invalid);
                                      else
                                          pass.nodeCodes[std::size_t(i) * ofNodes + place] =
                                              nodeCode(coding, std::int32_t(i));
                              });
        }
    }
    tets.resize(mesh.tets.size());
    std::vector<Vec3d> sizes((tets.size() + kChunk - 1) / kChunk, Vec3d(0));
    parallelForChunks(execution, mesh.elementCount(), kChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
            auto& tet = tets[std::size_t(e)];
            for (std::size_t k = 0; k < 4; ++k) tet[k] = std::uint32_t(mesh.tets[std::size_t(e)][k]);
            sizes[std::size_t(begin / kChunk)] += sizeOf(mesh, tet);
            for (const ChannelCoding& coding : channels)
                if (!isSafeOnDevice(coding, mesh, std::int32_t(e))) tet[0] |= kDecidedBit;
        }
    });
    for (const Vec3d& size : sizes) sizesWorld += size;
}

DeviceMesh::DeviceMesh(GlContext& context, const Source& source)
    : nodeCount_(source.whole.points.size()),
      elementCount_(source.whole.tets.size()),
      sizesWorld_(source.sizesWorld) {
    nodes_ = GlBuffer(context, std::span(source.whole.points));
    tets_ = GlBuffer(context, std::span(source.tets));
    for (const Source::Pass& pass : source.passes)
        passes_.push_back({GlBuffer(context, std::span(pass.nodeCodes)),
                           GlBuffer(context, std::span(pass.cellCodes)), pass.cellMask, pass.channels});
}

std::int64_t DeviceMesh::bytesOf(const TetMesh& mesh, std::span<const ChannelCoding> channels) {
    // Three doubles of a node, and a quarter more than eight when it is placed; numbers of candidates.
    std::int64_t aNode = 13 * std::int64_t(sizeof(double)),
                 anElement = 5 * std::int64_t(sizeof(std::int32_t)) + 1;
    for (const ChannelCoding& coding : channels)
        (coding.isOfCells() ? anElement : aNode) +=
            std::int64_t(coding.isOfCells() ? sizeof(float) : sizeof(NodeCode));
    return aNode * mesh.nodeCount() + anElement * mesh.elementCount();
}

int DeviceMesh::layerAxis(const Vec3d& spacingWorld) const {
    return layerAxisOf(sizesWorld_ / spacingWorld);
}

std::int64_t DeviceMesh::uploadedBytes() const {
    std::int64_t bytes = nodes_.bytes() + tets_.bytes();
    for (const Pass& pass : passes_) bytes += pass.nodeCodes.bytes() + pass.cellCodes.bytes();
    return bytes;
}

std::vector<ShaderDefine> recordDefines() {
    return {{"PLANE_ROUNDING", glslOf(kPlaneRounding)},
            {"MOST_PLANE_ERROR", glslOf(kMostPlaneError)},
            {"LARGEST_HEIGHT", glslOf(kLargestHeight)},
            {"LARGEST_MARGIN", glslOf(kLargestMargin)},
            {"LARGEST_FLOAT", glslOf(double(std::numeric_limits<float>::max()))},
            {"CORNER_FACTOR", glslOf(kCornerFactor)},
            {"FLOAT_ROUNDING", glslOf(kFloatRounding)},
            {"FLOAT_UNIT", glslOf(kFloatUnit)},
            {"SLACK_FACTOR", glslOf(kSlackFactor)},
            {"CELL_EDGE", glslOf(double(kCellEdge))},
            {"LAYERS", glslOf(kLayers)},
            {"KINDS", glslOf(kKinds)},
            {"EMPTY_COUNTERS", glslOf(kEmptyCounters)},
            {"BOX_SLACK", glslOf(kBoxSlack)},
            {"MARGIN", glslOf(float(2 * kLargestMargin))},
            {"ROUGH_ERROR", glslOf(0x1p-16f)},
            {"ROUGH", glslOf(0x1p-21f)},
            {"DECIDED_BIT", glslOf(std::size_t(kDecidedBit))},
            {"SMALL_EXTENT", std::to_string(kSmallExtent)},
            {"PART_POINTS", glslOf(std::size_t(kPartPoints))},
            {"PART_SIZES", glslOf(kPartSizes)},
            {"TILE_SHIFT", std::to_string(kTileShift)},
            {"TILES_AN_EDGE", glslOf(std::size_t(kTilesAnEdge))},
            {"TILES", glslOf(kTiles)},
            {"SMALL_SIZES", glslOf(kSmallSizes)},
            {"SMALL_BUCKETS", glslOf(kSmallBuckets)},
            {"BUCKETS", glslOf(kBuckets)},
            {"FAN", glslOf(kFan)},
            {"OPERATIONS", glslOf(kOperations)}};
}

const GlProgram& RecordMaker::program(GlContext& context, Stage stage, int channels) {
    const auto found = programs_.find({stage, channels});
    if (found != programs_.end()) return found->second;
    namespace text = shaders::raster;
    const auto made = [&](const ShaderText& main, std::vector<ShaderText> shared) {
        std::vector<ShaderDefine> all = recordDefines();
        all.push_back({"CHANNELS", std::to_string(channels)});
        if (stage == Stage::thinGeometry) all.push_back({"THIN"});
        if (stage == Stage::drawnGeometry) all.push_back({"DRAWN"});
        shared.insert(shared.begin(), text::kThreads);
        return makeComputeProgram(context, main, std::move(shared), std::move(all));
    };
    const auto ofStage = [&] {
        switch (stage) {
            case Stage::frame:
                return made(text::kFrameNodes, {text::kLookedAt});
            case Stage::near:
                return made(text::kNearElements, {text::kLookedAt});
            case Stage::sums:
                return made(text::kPrefixSums, {});
            case Stage::list:
                return made(text::kListElements, {text::kLookedAt});
            case Stage::easyGeometry:
            case Stage::thinGeometry:
                return made(text::kRecordGeometry,
                            {text::kRecordTypes, text::kPlacedNodes, text::kElementShape, text::kRanks,
                             text::kScanBoxes, text::kScanBuckets});
            case Stage::drawnGeometry:
                return made(text::kRecordGeometry,
                            {text::kRecordTypes, text::kPlacedNodes, text::kElementShape, text::kRanks,
                             text::kScanBoxes, text::kPixelRows, text::kTightenBox});
            case Stage::channels:
                return made(text::kRecordChannels, {text::kRecordTypes, text::kPlacedNodes,
                                                    text::kElementShape, text::kRanks, text::kScanBoxes});
            case Stage::sort:
                return made(text::kSortBoxes, {text::kRanks, text::kScanBoxes, text::kScanBuckets});
            case Stage::counts:
                return made(text::kRecordCounts, {});
            case Stage::doubles:
                return made(text::kDoubleTest, {});
        }
        throw InternalError("no such stage");
    };
    return programs_.emplace(std::pair(stage, channels), ofStage()).first->second;
}

ComputeUse RecordMaker::use(GlContext& context, Stage stage, int channels) {
    return {context, program(context, stage, channels)};
}

bool RecordMaker::isExact(GlContext& context) {
    if (isExact_) return *isExact_;
    std::mt19937_64 random(1);
    std::vector<double> operands;
    for (std::size_t i = 0; i < kOperands; ++i) {
        const double sign = random() & 1 ? -1 : 1;
        operands.push_back(sign * std::ldexp(1 + double(random() >> 12) * 0x1p-52, int(random() % 81) - 40));
    }
    const GlBuffer source(context, std::span(operands));
    const GlBuffer results(context, std::int64_t(kOperands * kOperations * sizeof(double)), 0);
    const ComputeUse test = use(context, Stage::doubles);
    test.bind(0, source);
    test.bind(1, results);
    test.set("count", kOperands);
    test.run(kOperands);
    const auto made = readItems<double>(context, results, 0, kOperands * kOperations);
    isExact_ = true;
    for (std::size_t i = 0; i < kOperands; ++i) {
        double expected[kOperations];
        operate(operands[i], operands[(i + 1) % kOperands], expected);
        for (std::size_t k = 0; k < kOperations; ++k)
            if (made[i * kOperations + k] != expected[k]) isExact_ = false;
    }
    return *isExact_;
}

void RecordMaker::useLookedAt(const ComputeUse& used, bool areLookedAt) const {
    used.bind(3, candidates_ ? candidates_ : frame_);  // where none are read, any
    used.flag("areCandidates", areLookedAt && candidates_);
}

void RecordMaker::place(GlContext& context, const DeviceMesh& mesh, const Lattice& lattice,
                        std::span<const std::int32_t> candidates) {
    TESSERA_CHECK(lattice.isAxisParallel(), "nodes of turned lattices are placed by the processor");
    grow(context, frame_, mesh.nodeCount_ * 6 * sizeof(double));
    grow(context, rough_, mesh.nodeCount_ * 4 * sizeof(float));
    candidates_ = candidates.empty() ? GlBuffer() : GlBuffer(context, candidates);
    lookedAt_ = candidates.empty() ? mesh.elementCount_ : candidates.size();
    const std::size_t count = candidates.empty() ? mesh.nodeCount_ : 4 * candidates.size();
    const ComputeUse placing = use(context, Stage::frame);
    useLookedAt(placing);
    placing.bind(4, mesh.tets_);
    placing.bind(0, mesh.nodes_);
    placing.bind(1, frame_);
    placing.bind(2, rough_);
    placing.set("originWorld", lattice.originWorld);
    placing.set("spacingWorld", Vec3d(lattice.uWorld.x, lattice.vWorld.y, lattice.wWorld.z));
    placing.set("nodeCount", count);
    placing.run(count);
}

void RecordMaker::usePlaced(ComputeUse& used, const DeviceMesh& mesh) const {
    used.bind(0, mesh.tets_);
    used.bind(1, frame_);
    used.set("regionMin", points_.min);
    used.set("regionSize", points_.size());
    used.set("cellMin", cellOrigin(points_));
    used.set("listedCount", listedCount_);
}

std::size_t RecordMaker::addUp(GlContext& context, const GlBuffer& items, std::size_t count, bool areBits,
                               GlBuffer& sums) {
    struct Level {
        std::size_t first, count;
    };
    std::vector<Level> levels{{0, count}};
    while (levels.back().count > 1 || levels.size() == 1)
        levels.push_back(
            {levels.back().first + levels.back().count, (levels.back().count + kFan - 1) / kFan});
    grow(context, sums, (levels.back().first + 1) * sizeof(GLuint));
    const ComputeUse adding = use(context, Stage::sums);
    adding.bind(0, items);
    adding.bind(1, sums);
    adding.flag("areBits", areBits);
    const auto step = [&](std::size_t level, bool isDown) {
        adding.set("level", levels[level].first);
        adding.set("nextLevel", levels[level + 1].first);
        adding.set("count", levels[level].count);
        adding.flag("isFirst", level == 0);
        adding.flag("isLast", level + 2 == levels.size());
        adding.flag("isDown", isDown);
        adding.run(levels[level + 1].count);
    };
    for (std::size_t level = 0; level + 1 < levels.size(); ++level) step(level, false);
    for (std::size_t level = levels.size() - 1; level-- > 0;) step(level, true);
    return levels.back().first;
}

void RecordMaker::list(GlContext& context, const GlBuffer& marks, const GlBuffer& sums, std::size_t words,
                       const GlBuffer& listed, bool areLookedAt) {
    const ComputeUse listing = use(context, Stage::list);
    listing.bind(0, marks);
    listing.bind(1, sums);
    listing.bind(2, listed);
    useLookedAt(listing, areLookedAt);
    listing.set("wordCount", words);
    listing.run(words);
}

std::int64_t RecordMaker::findNear(GlContext& context, const DeviceMesh& mesh, const IndexBox& points) {
    points_ = points;
    const std::size_t words = (lookedAt_ + 31) / 32;
    listedCount_ = 0;
    if (words == 0) return 0;
    grow(context, marks_, words * sizeof(GLuint));
    fill(context, marks_, words * sizeof(GLuint));
    const ComputeUse near = use(context, Stage::near);
    useLookedAt(near);
    near.bind(0, mesh.tets_);
    near.bind(1, rough_);
    near.bind(2, marks_);
    near.set("itemCount", lookedAt_);
    const auto setPlace = [&](const char* name, const Vec3i& place) {
        context.functions().ProgramUniform3f(near.program.id(), near.at(name), float(place.x), float(place.y),
                                             float(place.z));
    };
    setPlace("lowest", points.min);
    setPlace("highest", points.max - 1);
    near.run(lookedAt_);
    const std::size_t total = addUp(context, marks_, words, true, markSums_);
    listedCount_ = readItems<GLuint>(context, markSums_, total, 1).front();
    TESSERA_CHECK(listedCount_ < std::size_t(1) << kRankKindShift, "ranks hold the records");
    return std::int64_t(listedCount_);
}

std::int64_t RecordMaker::bytesFor(std::int64_t listed, std::int64_t thin, int channels) {
    const std::int64_t ofChannels = std::int64_t(sizeof(ChannelRecord)) * std::max(1, channels);
    const auto easy = std::int64_t(2 * sizeof(std::int32_t) + 2 * sizeof(ScanBox) + sizeof(EasyGeometry));
    const std::int64_t bytes =
        listed * (easy + ofChannels) + thin * (std::int64_t(sizeof(ThinGeometry)) + ofChannels);
    return bytes + bytes / 4;  // buffers are made larger than is needed at once
}

std::int64_t RecordMaker::largestBuffer(std::int64_t listed, std::int64_t thin, int channels) {
    const std::int64_t bytes =
        std::max({listed * std::int64_t(sizeof(EasyGeometry)), thin * std::int64_t(sizeof(ThinGeometry)),
                  listed * std::int64_t(sizeof(ChannelRecord)) * channels});
    return bytes + bytes / 4;
}

std::optional<RecordMaker::Made> RecordMaker::makeGeometry(GlContext& context, const DeviceMesh& mesh,
                                                           std::int64_t most, std::optional<int> layerAxis) {
    thinCount_ = 0;
    if (listedCount_ == 0) return Made{};
    const int channels = mesh.passes_.front().channels;  // no pass has more
    const auto fits = [&] {
        const std::int64_t listed = std::int64_t(listedCount_), thin = std::int64_t(thinCount_);
        return bytesFor(listed, thin, channels) <= most &&
               (most == kNoBound ||
                largestBuffer(listed, thin, channels) <= context.info().limits.storageBlockBytes);
    };
    if (!fits()) return std::nullopt;
    const std::size_t markWords = (lookedAt_ + 31) / 32, thinWords = (listedCount_ + 31) / 32;
    grow(context, listed_, listedCount_ * sizeof(GLuint));
    list(context, marks_, markSums_, markWords, listed_, true);

    // One more bucket than there are: before the last stand all.
    const std::size_t counters = layerAxis ? kKinds * kLayers + kEmptyCounters : 2 * kBuckets + 1;
    grow(context, easyGeometry_, listedCount_ * sizeof(EasyGeometry));
    grow(context, boxes_, listedCount_ * sizeof(ScanBox));
    grow(context, thinMarks_, thinWords * sizeof(GLuint));
    grow(context, boxCounts_, counters * sizeof(GLuint));
    grow(context, hard_, (listedCount_ + 1) * sizeof(GLuint));
    fill(context, thinMarks_, thinWords * sizeof(GLuint));
    fill(context, boxCounts_, counters * sizeof(GLuint));
    fill(context, hard_, sizeof(GLuint));
    ComputeUse easy = use(context, layerAxis ? Stage::drawnGeometry : Stage::easyGeometry);
    usePlaced(easy, mesh);
    easy.bind(2, listed_);
    easy.bind(3, easyGeometry_);
    easy.bind(4, boxes_);
    easy.bind(5, thinMarks_);
    easy.bind(6, boxCounts_);
    easy.bind(7, hard_);
    easy.set("layerAxis", std::size_t(layerAxis.value_or(2)));
    easy.run(listedCount_);

    const std::size_t thinTotal = addUp(context, thinMarks_, thinWords, true, thinSums_);
    Made made;
    const std::size_t hardCount =
        layerAxis ? countLayers(context, thinTotal, made) : countBuckets(context, thinTotal, made.runs);
    if (!fits()) return std::nullopt;
    if (hardCount > 0) made.hard = readItems<std::int32_t>(context, hard_, 1, hardCount);
    std::ranges::sort(made.hard);
    makeThinGeometry(context, mesh);
    if (layerAxis) return made;

    grow(context, sorted_, listedCount_ * sizeof(ScanBox));
    const ComputeUse sort = use(context, Stage::sort);
    sort.bind(0, boxes_);
    sort.bind(1, bucketSums_);
    sort.bind(2, sorted_);
    sort.set("listedCount", listedCount_);
    sort.run(listedCount_);
    return made;
}

std::size_t RecordMaker::countBuckets(GlContext& context, std::size_t thinTotal, std::vector<ScanRun>& runs) {
    addUp(context, boxCounts_, 2 * kBuckets + 1, false, bucketSums_);
    grow(context, counts_, (kRunCounts + 2) * sizeof(GLuint));
    const ComputeUse count = use(context, Stage::counts);
    count.bind(0, thinSums_);
    count.bind(1, hard_);
    count.bind(2, bucketSums_);
    count.bind(3, counts_);
    count.set("thinTotal", thinTotal);
    count.run(kRunCounts);
    const auto counts = readItems<GLuint>(context, counts_, 0, kRunCounts + 2);
    thinCount_ = counts[0];
    runs = listScanRuns(std::span(counts).subspan<2, kRunCounts>(), points_);
    return counts[1];
}

std::size_t RecordMaker::countLayers(GlContext& context, std::size_t thinTotal, Made& made) {
    const auto steps = readItems<GLuint>(context, boxCounts_, 0, kKinds * kLayers + kEmptyCounters);
    made.emptyPairs = std::accumulate(steps.end() - kEmptyCounters, steps.end(), std::int64_t(0));
    LayerCounts& layers = made.layers;
    layers.resize(kLayers);
    for (std::size_t kind = 0; kind < kKinds; ++kind) {
        GLuint count = 0;
        for (std::size_t layer = 0; layer < kLayers; ++layer)
            layers[layer][kind] = count += steps[kind * kLayers + layer];
    }
    thinCount_ = readItems<GLuint>(context, thinSums_, thinTotal, 1).front();
    return readItems<GLuint>(context, hard_, 0, 1).front();
}

void RecordMaker::makeThinGeometry(GlContext& context, const DeviceMesh& mesh) {
    grow(context, thinGeometry_, std::max<std::size_t>(1, thinCount_) * sizeof(ThinGeometry));
    grow(context, thinSlots_, std::max<std::size_t>(1, thinCount_) * sizeof(GLuint));
    if (thinCount_ == 0) return;
    ComputeUse thin = use(context, Stage::thinGeometry);
    usePlaced(thin, mesh);
    thin.bind(2, listed_);
    thin.bind(3, thinGeometry_);
    thin.bind(4, boxes_);
    thin.bind(5, thinMarks_);
    thin.bind(6, thinSums_);
    thin.bind(7, thinSlots_);
    thin.run(listedCount_);
}

void RecordMaker::makeChannels(GlContext& context, const DeviceMesh& mesh, std::size_t pass,
                               SampleFormat format) {
    if (listedCount_ == 0) return;
    const DeviceMesh::Pass& codes = mesh.passes_.at(pass);
    const std::size_t anElement = std::size_t(codes.channels) * sizeof(ChannelRecord);
    grow(context, easyChannels_, listedCount_ * anElement);
    grow(context, thinChannels_, std::max<std::size_t>(1, thinCount_) * anElement);
    ComputeUse channels = use(context, Stage::channels, codes.channels);
    usePlaced(channels, mesh);
    channels.bind(2, listed_);
    channels.bind(3, boxes_);
    channels.bind(4, codes.nodeCodes);
    channels.bind(5, codes.cellCodes);
    channels.bind(7, thinSlots_);
    channels.set("cellMask", codes.cellMask);
    context.functions().ProgramUniform1f(channels.program.id(), channels.at("invalid"),
                                         sampleMarks(format).invalid);
    for (const bool areThin : {false, true}) {
        const std::size_t count = areThin ? thinCount_ : listedCount_;
        if (count == 0) continue;
        channels.bind(6, areThin ? thinChannels_ : easyChannels_);
        channels.set("elementCount", count);
        channels.flag("areThin", areThin);
        channels.run(count);
    }
}

ScanRecords RecordMaker::records() const {
    return {easyGeometry_.id(), easyChannels_.id(), thinGeometry_.id(), thinChannels_.id(), sorted_.id(), {}};
}

std::vector<std::int32_t> RecordMaker::listed(GlContext& context) const {
    return readItems<std::int32_t>(context, listed_, 0, listedCount_);
}

std::vector<ScanBox> RecordMaker::boxes(GlContext& context) const {
    return readItems<ScanBox>(context, boxes_, 0, listedCount_);
}

}  // namespace tessera
