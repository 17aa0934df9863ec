#pragma once

#include <cstdint>
#include <vector>

#include "base/large_pages.h"
#include "raster/prepared_region.h"

namespace tessera {

/// Which of equally deep elements owns a point: the one with the least rank. Small elements come before large
/// ones, as they are drawn; points that the processor decided come last. The record stands in the lower bits.
inline constexpr int kRankKindShift = 28;

/// A box has no more points, so that no thread is left with one at the end.
inline constexpr int kScanBoxPoints = 192;
/// Of a box on the device: its points, a bit each.
inline constexpr int kScanBoxWords = (kScanBoxPoints + 31) / 32;

/// Points of a region that an element may cover, 8 bits an axis; as the shaders read it.
struct ScanBox {
    std::uint32_t rank;
    std::uint32_t low, last;
};

/// What compute shaders go through, a thread a box: those of easy elements, then those of thin ones.
struct ScanBoxes {
    UninitializedVector<ScanBox> boxes;
    std::size_t easyCount = 0;
};

/// The boxes of each grade stand by place and size, so that neighbouring threads have about as much to do.
ScanBoxes listScanBoxes(const PreparedRegion& region);

}  // namespace tessera
