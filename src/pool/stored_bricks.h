#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "schedule/brick_target.h"
#include "tessera/execution.h"

namespace tessera {

/// What a file says of the bricks that were read from it.
struct StoredTraits {
    int layers = 0;              ///< of the store's extension
    bool isHalf = false;         ///< values were rounded to half floats
    bool hasStatistics = false;  ///< range, histogram and error of each brick are known
};

/// The bricks of a file as a scheduler would show them.
struct StoredBricks {
    /// One a leaf of the tree, in its order, which is GrowingLeaf::slot too; depth 0 is the coarsest level.
    /// Their samples carry values outside the mesh, for a PoolTarget without one: those of the extension, or
    /// without an extension the mean of the samples next to the point (26 neighbours, of its level). Points
    /// on + faces that another leaf owns are left out, as they are read from that leaf. A vector with a
    /// component that isn't finite has none of the others either, as readVdb() gives it.
    std::vector<ShownBrick> bricks;
    std::int64_t estimatedPoints = 0;  ///< outside the mesh, with such a mean
    std::int64_t missingPoints = 0;    ///< outside the mesh, without any value: their codes are 0
    std::vector<std::string> notes;    ///< sentences: what isn't as in bricks that come from the mesh
};

/// Takes the memory of the closed boxes of all bricks. Publication{.added = result.bricks} fills a pool.
StoredBricks showStored(const BrickTree& tree, const BrickStore& store, const StoredTraits& traits,
                        const Execution& execution);

}  // namespace tessera
