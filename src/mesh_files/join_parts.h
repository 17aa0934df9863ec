#pragma once

#include <cstdint>
#include <vector>

#include "mesh_files/raw_mesh.h"

namespace tessera {

/// What joining makes of the points of a block.
struct JoinedPoints {
    std::vector<std::int32_t> newIndex;  ///< of every point before
    std::vector<std::int32_t> kept;      ///< old index of every point that stays, ascending
    std::int64_t apart = 0;              ///< points that stay only because their values differ
};

/// Of the points of a merged block that belong to different parts, those at exactly the same place with the
/// same values become one. Points of one part stay apart, as do different values: jumps of a field stay.
/// Where one value isn't finite the other is written in its place. Independent of threads.
/// @param firstPoint of every part, ascending.
JoinedPoints joinParts(RawBlock& block, const std::vector<std::size_t>& firstPoint,
                       const Execution& execution);

}  // namespace tessera
