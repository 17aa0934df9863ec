#pragma once

#include <cstddef>
#include <cstdint>

#include "brick/overlap.h"

namespace tessera {

inline constexpr std::size_t kTouchLanes = 64;  ///< pairs of a batch

/// Pairs of an element and a box that its bounds meet, a lane each.
struct alignas(64) TouchBatch {
    double corner[4][3][kTouchLanes];  ///< the element's nodes, from the box's centre
    double half[3][kTouchLanes];       ///< the box's half size
    std::size_t count = 0;

    void add(const std::array<Vec3d, 4>& nodes, const Box3d& box);
};

/// ElementOverlap::touches for all pairs of a batch: a bit for each that touches, the first one's the lowest.
/// Every operation is a single IEEE operation in a fixed order: the same on every processor.
std::uint64_t touching(const TouchBatch& batch);

}  // namespace tessera
