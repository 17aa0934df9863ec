#include "raster/point_scan.h"

#include <array>
#include <bit>
#include <numeric>

#include "base/check.h"

namespace tessera {

namespace {

/// Threads, with or without a part, that larger boxes of all sizes may have together.
constexpr std::size_t kFewThreads = std::size_t(1) << 18;

std::uint32_t packed(const Vec3i& place) {
    return std::uint32_t(place.x) | std::uint32_t(place.y) << 8 | std::uint32_t(place.z) << 16;
}
Vec3i unpacked(std::uint32_t place) {
    return {int(place & 255), int(place >> 8 & 255), int(place >> 16 & 255)};
}

/// As scan_boxes.glsl cuts them.
unsigned partsOf(const Vec3i& size) {
    Vec3i part = size;
    while (part.x * part.y * part.z > kPartPoints) {
        int& longest = part.z >= part.x && part.z >= part.y ? part.z : part.y >= part.x ? part.y : part.x;
        longest = (longest + 1) / 2;
    }
    const Vec3i parts = (size + part - 1) / part;
    return unsigned(parts.x * parts.y * parts.z);
}

std::size_t bucketOf(const ScanBox& box) {
    const Vec3i low = unpacked(box.low), size = unpacked(box.last) - low + 1, at = low >> kTileShift;
    const std::size_t tile = std::size_t((at.z * kTilesAnEdge + at.y) * kTilesAnEdge + at.x);
    const std::size_t ofGrade = box.rank >> (kRankKindShift + 1) == 0 ? 0 : kBuckets;
    const int points = size.x * size.y * size.z;
    if (points <= kPartPoints)
        return ofGrade + tile * kSmallSizes + std::size_t(std::bit_width(unsigned(points)) - 1);
    return ofGrade + kSmallBuckets + std::size_t(std::bit_width(partsOf(size) - 1) - 1) * kTiles + tile;
}

/// The first bucket of the i-th size: of small boxes, and of each number of parts.
std::size_t firstBucket(std::size_t i) {
    const std::size_t size = i % (kPartSizes + 1);
    return i / (kPartSizes + 1) * kBuckets + (size == 0 ? 0 : kSmallBuckets + (size - 1) * kTiles);
}

}  // namespace

std::vector<ScanRun> listScanRuns(std::span<const std::uint32_t, 2 * (kPartSizes + 1) + 1> first,
                                  const IndexBox& region) {
    std::vector<ScanRun> runs;
    for (const bool isThin : {false, true}) {
        const std::uint32_t* const at = first.data() + (isThin ? kPartSizes + 1 : 0);
        std::size_t most = kPartSizes;
        while (most > 0 && at[most + 1] == at[most]) --most;
        const auto add = [&](std::size_t from, std::size_t to) {
            runs.push_back({isThin, at[from], at[to + 1] - at[from], std::uint32_t(to)});
        };
        add(0, 0);
        // Where threads without a part cost little, all larger boxes in one go.
        if (region.count() <= kFewPoints || std::size_t(at[most + 1] - at[1]) << most <= kFewThreads)
            add(1, std::max<std::size_t>(1, most));
        else
            for (std::size_t size = 1; size <= most; ++size) add(size, size);
    }
    return runs;
}

ScanBoxes listScanBoxes(const PreparedRegion& region) {
    TESSERA_CHECK(region.elements.size() < std::size_t(1) << kRankKindShift, "ranks hold the records");
    UninitializedVector<ScanBox> boxes;
    reserveLarge(boxes, region.elements.size());
    std::vector<std::uint32_t> next(2 * kBuckets + 1, 0);
    for (const SliceElement& e : region.elements) {
        const std::uint32_t kind = (e.grade == ShapeGrade::thin ? 2u : 0u) + (e.isSmall ? 0u : 1u);
        boxes.push_back({kind << kRankKindShift | e.record, packed({e.low[0], e.low[1], e.low[2]}),
                         packed({e.high[0], e.high[1], e.high[2]})});
        ++next[bucketOf(boxes.back()) + 1];
    }
    std::partial_sum(next.begin(), next.end(), next.begin());
    std::array<std::uint32_t, 2 * (kPartSizes + 1) + 1> first;
    for (std::size_t i = 0; i < first.size(); ++i) first[i] = next[firstBucket(i)];
    ScanBoxes result{{}, listScanRuns(first, region.points)};
    resizeLarge(result.boxes, boxes.size());
    for (const ScanBox& box : boxes) result.boxes[next[bucketOf(box)]++] = box;
    return result;
}

}  // namespace tessera
