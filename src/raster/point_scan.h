#pragma once

#include <cstdint>
#include <vector>

#include "base/large_pages.h"
#include "raster/prepared_region.h"

namespace tessera {

/// Which of equally deep elements owns a point: the one with the least rank. Small elements come before large
/// ones, as they are drawn; points that the processor decided come last. The record stands in the lower bits.
inline constexpr int kRankKindShift = 28;

/// A thread goes through no more points of a box: larger boxes are cut into parts.
inline constexpr int kPartPoints = 192;
/// Powers of two in the number of parts.
inline constexpr std::size_t kPartSizes = 18;
inline constexpr std::size_t kMostScanRuns = 2 * (1 + kPartSizes);
/// Parts that there is room for on the device.
inline constexpr std::size_t kPartRoom = std::size_t(1) << kPartSizes;

/// Points of a region that an element may cover, 8 bits an axis; as the shaders read it.
struct ScanBox {
    std::uint32_t rank;
    std::uint32_t low, last;
};

/// Boxes of which each has about as many parts.
struct ScanRun {
    bool isThin;  ///< else their elements are easy
    std::size_t first, count;
    std::uint32_t parts;  ///< of a box, at most
};

/// What compute shaders go through: a box an element.
struct ScanBoxes {
    UninitializedVector<ScanBox> boxes;
    std::vector<ScanRun> runs;
};

/// Small boxes stand by place and size, so that neighbouring threads have about as much to do.
ScanBoxes listScanBoxes(const PreparedRegion& region);

}  // namespace tessera
