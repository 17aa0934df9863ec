#include "raster/point_scan.h"

#include <algorithm>
#include <bit>
#include <numeric>

#include "base/check.h"
#include "raster/regions.h"

namespace tessera {

namespace {

constexpr int kSizes = std::bit_width(unsigned(kScanBoxPoints));
/// Boxes stand by tiles of this edge, so that what is noted of their points stays in the caches.
constexpr int kTileShift = 5, kTilesAnEdge = kCellEdge >> kTileShift;
/// Far above the rounding of distances, in voxels.
constexpr double kSurelyOutside = 0x1p-6;

std::uint32_t packed(const Vec3i& place) {
    return std::uint32_t(place.x) | std::uint32_t(place.y) << 8 | std::uint32_t(place.z) << 16;
}
Vec3i unpacked(std::uint32_t place) {
    return {int(place & 255), int(place >> 8 & 255), int(place >> 16 & 255)};
}
int pointsIn(const Vec3i& low, const Vec3i& last) {
    const Vec3i size = last - low + 1;
    return size.x * size.y * size.z;
}

/// True when no point of the box lies in the element, by the box's centre and half its size.
template <class Geometry>
bool isOutside(const Geometry& geometry, const Vec3i& low, const Vec3i& last) {
    for (int face = 0; face < 4; ++face) {
        double most = double(geometry.offset[face]) + double(geometry.slack) + kSurelyOutside;
        for (int a = 0; a < 3; ++a) {
            const double n = double(geometry.normal[a][face]);
            most += n * ((n > 0 ? last[a] : low[a]) - double(geometry.base[a]));
        }
        if (most < 0) return true;
    }
    return false;
}

/// Halves a box until its parts are small; leaves out parts outside the element.
template <class Geometry>
void addParts(const Geometry& geometry, std::uint32_t rank, const Vec3i& low, const Vec3i& last,
              std::vector<ScanBox>& boxes) {
    if (pointsIn(low, last) <= kScanBoxPoints) {
        boxes.push_back({rank, packed(low), packed(last)});
        return;
    }
    const Vec3i size = last - low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    Vec3i lastOfFirst = last, lowOfSecond = low;
    lastOfFirst[axis] = low[axis] + size[axis] / 2;
    lowOfSecond[axis] = lastOfFirst[axis] + 1;
    if (!isOutside(geometry, low, lastOfFirst)) addParts(geometry, rank, low, lastOfFirst, boxes);
    if (!isOutside(geometry, lowOfSecond, last)) addParts(geometry, rank, lowOfSecond, last, boxes);
}

/// By tile, and in it by the power of two in the number of points.
std::size_t bucketOf(const ScanBox& box) {
    const Vec3i low = unpacked(box.low), tile = low >> kTileShift;
    return std::size_t((tile.z * kTilesAnEdge + tile.y) * kTilesAnEdge + tile.x) * kSizes +
           std::size_t(std::bit_width(unsigned(pointsIn(low, unpacked(box.last)))) - 1);
}

void appendSorted(const std::vector<ScanBox>& boxes, UninitializedVector<ScanBox>& sorted) {
    std::vector<std::size_t> next(std::size_t(kTilesAnEdge) * kTilesAnEdge * kTilesAnEdge * kSizes + 1, 0);
    for (const ScanBox& box : boxes) ++next[bucketOf(box) + 1];
    next[0] = sorted.size();
    std::partial_sum(next.begin(), next.end(), next.begin());
    resizeLarge(sorted, sorted.size() + boxes.size());
    for (const ScanBox& box : boxes) sorted[next[bucketOf(box)]++] = box;
}

}  // namespace

ScanBoxes listScanBoxes(const PreparedRegion& region) {
    TESSERA_CHECK(region.elements.size() < std::size_t(1) << kRankKindShift, "ranks hold the records");
    std::vector<ScanBox> easy, thin;
    reserveLarge(easy, region.easy.geometry.size());
    for (const SliceElement& e : region.elements) {
        const bool isThin = e.grade == ShapeGrade::thin;
        const std::uint32_t kind = (isThin ? 2u : 0u) + (e.isSmall ? 0u : 1u);
        const std::uint32_t rank = kind << kRankKindShift | e.record;
        const Vec3i low{e.low[0], e.low[1], e.low[2]}, last{e.high[0], e.high[1], e.high[2]};
        if (isThin)
            addParts(region.thin.geometry[e.record], rank, low, last, thin);
        else
            addParts(region.easy.geometry[e.record], rank, low, last, easy);
    }
    ScanBoxes result;
    appendSorted(easy, result.boxes);
    result.easyCount = result.boxes.size();
    appendSorted(thin, result.boxes);
    return result;
}

}  // namespace tessera
