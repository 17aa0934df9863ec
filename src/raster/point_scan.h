#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "base/large_pages.h"
#include "raster/prepared_region.h"
#include "raster/regions.h"

namespace tessera {

/// Which of equally deep elements owns a point: the one with the least rank. Small elements come before large
/// ones, as they are drawn; points that the processor decided come last. The record stands in the lower bits.
inline constexpr int kRankKindShift = 28;

/// A thread goes through no more points of a box: larger boxes have a thread a part.
inline constexpr int kPartPoints = 192;
/// A brick and a little more: a region no larger is settled without lists, whatever is near it.
inline constexpr std::int64_t kFewPoints = 20 * 20 * 20;
/// Powers of two in the number of parts.
inline constexpr std::size_t kPartSizes = 18;
inline constexpr std::size_t kMostScanRuns = 2 * (1 + kPartSizes);

/// Points of a region that an element may cover, 8 bits an axis; as the shaders read it.
struct ScanBox {
    std::uint32_t rank;
    std::uint32_t low, last;
};

/// Boxes that are gone through together.
struct ScanRun {
    bool isThin;  ///< else their elements are easy
    std::size_t first, count;
    std::uint32_t partBits;  ///< threads a box, as a power of two: no fewer than its parts
};

/// What compute shaders go through: a box an element.
struct ScanBoxes {
    UninitializedVector<ScanBox> boxes;
    std::vector<ScanRun> runs;
};

/// Boxes are sorted into buckets, of easy elements and then the same of thin ones. Small boxes stand by tile
/// and the power of two in the number of points, so that what is noted of their points stays in the caches
/// and neighbouring threads have about as much to do; larger ones by that in the number of parts, and tile.
inline constexpr int kTileShift = 5, kTilesAnEdge = kCellEdge >> kTileShift;
inline constexpr std::size_t kTiles = std::size_t(kTilesAnEdge) * kTilesAnEdge * kTilesAnEdge;
inline constexpr std::size_t kSmallSizes = std::bit_width(unsigned(kPartPoints));
inline constexpr std::size_t kSmallBuckets = kTiles * kSmallSizes;
inline constexpr std::size_t kBuckets = kSmallBuckets + kPartSizes * kTiles;  ///< of a grade

/// Of a region no larger than kFewPoints always four.
/// @param first where the boxes of each size begin: those of easy elements, those of thin ones, and the end.
std::vector<ScanRun> listScanRuns(std::span<const std::uint32_t, 2 * (kPartSizes + 1) + 1> first,
                                  const IndexBox& region);

ScanBoxes listScanBoxes(const PreparedRegion& region);

}  // namespace tessera
