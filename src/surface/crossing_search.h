#pragma once

#include <cstdint>
#include <vector>

#include "surface/triangle_tree.h"
#include "tessera/execution.h"

namespace tessera {

/// Pairs of triangles whose boxes meet that are looked at: more than any surface has that isn't damaged. One
/// that crosses counts as ten.
struct CrossingLimits {
    std::int64_t pairsPerTriangle = 200;
    std::int64_t pairsMore = 200'000'000;
};

/// Pairs of triangles that cross (trianglesCross).
struct Crossings {
    std::int64_t pairs = 0;
    /// One entry a triangle, 1: in one of the pairs.
    std::vector<std::uint8_t> crosses;
};

/// Finds all; where there are more pairs to look at than the limits say it finds some, always the same.
/// Throws InputError when it finds none of those.
Crossings findCrossings(const TriangleTree& tree, const CrossingLimits& limits, const Execution& execution);

/// The middle of what the boxes of a triangle and of one that crosses it have in common, world units.
Vec3d placeOfCrossing(const TriangleTree& tree, std::int32_t triangle);

}  // namespace tessera
