#include "raster/point_scan.h"

#include <algorithm>
#include <bit>
#include <numeric>

#include "base/check.h"
#include "raster/regions.h"

namespace tessera {

namespace {

/// Boxes stand by tiles of this edge, so that what is noted of their points stays in the caches.
constexpr int kTileShift = 5, kTilesAnEdge = kCellEdge >> kTileShift;
constexpr std::size_t kTiles = std::size_t(kTilesAnEdge) * kTilesAnEdge * kTilesAnEdge;
/// Small ones in a tile by the power of two in the number of points, larger ones by that in the number of
/// parts and then by tile.
constexpr std::size_t kSizes = std::bit_width(unsigned(kPartPoints)), kSmallBuckets = kTiles * kSizes;
constexpr std::size_t kBuckets = kSmallBuckets + kPartSizes * kTiles;

std::uint32_t packed(const Vec3i& place) {
    return std::uint32_t(place.x) | std::uint32_t(place.y) << 8 | std::uint32_t(place.z) << 16;
}
Vec3i unpacked(std::uint32_t place) {
    return {int(place & 255), int(place >> 8 & 255), int(place >> 16 & 255)};
}

/// As scan_parts.glsl cuts them.
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
    const int points = size.x * size.y * size.z;
    if (points <= kPartPoints) return tile * kSizes + std::size_t(std::bit_width(unsigned(points)) - 1);
    return kSmallBuckets + std::size_t(std::bit_width(partsOf(size) - 1) - 1) * kTiles + tile;
}

/// Sorts boxes of one grade behind those that the runs hold already.
void appendSorted(const std::vector<ScanBox>& boxes, bool isThin, ScanBoxes& to) {
    std::size_t first = to.runs.empty() ? 0 : to.runs.back().first + to.runs.back().count;
    std::vector<std::size_t> next(kBuckets + 1, 0);
    next[0] = first;
    for (const ScanBox& box : boxes) ++next[bucketOf(box) + 1];
    std::partial_sum(next.begin(), next.end(), next.begin());
    for (std::size_t size = 0; size <= kPartSizes; ++size) {
        const std::size_t last = next[kSmallBuckets + size * kTiles];
        if (last > first) to.runs.push_back({isThin, first, last - first, 1u << size});
        first = last;
    }
    for (const ScanBox& box : boxes) to.boxes[next[bucketOf(box)]++] = box;
}

}  // namespace

ScanBoxes listScanBoxes(const PreparedRegion& region) {
    TESSERA_CHECK(region.elements.size() < std::size_t(1) << kRankKindShift, "ranks hold the records");
    std::vector<ScanBox> easy, thin;
    reserveLarge(easy, region.easy.geometry.size());
    for (const SliceElement& e : region.elements) {
        const bool isThin = e.grade == ShapeGrade::thin;
        const std::uint32_t kind = (isThin ? 2u : 0u) + (e.isSmall ? 0u : 1u);
        (isThin ? thin : easy)
            .push_back({kind << kRankKindShift | e.record, packed({e.low[0], e.low[1], e.low[2]}),
                        packed({e.high[0], e.high[1], e.high[2]})});
    }
    ScanBoxes result;
    resizeLarge(result.boxes, region.elements.size());
    appendSorted(easy, false, result);
    appendSorted(thin, true, result);
    return result;
}

}  // namespace tessera
