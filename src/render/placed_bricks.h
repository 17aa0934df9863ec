#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "brick/brick_tree.h"
#include "brick/growing_tree.h"
#include "mesh/field_range.h"
#include "pool/pool_target.h"
#include "tessera/execution.h"
#include "tessera/vec.h"

namespace tessera {

/// Where the bricks of a pool stand.
struct BrickFrame {
    Vec3d originWorld{0};
    double rootSpacingWorld = 1;  ///< of depth 0
    int cells = 0;                ///< along a brick's edge

    double spacingWorld(Depth depth) const;
    /// The closed box of a brick.
    Box3d boxWorld(const DepthKey& key) const;
};

/// A brick in a pool's slot, and what one of its channels has there.
struct PlacedBrick {
    DepthKey key;
    std::uint32_t slot = 0;
    /// Of the finite values of all points of the closed box, those outside the mesh too: what is interpolated
    /// lies within.
    ValueRange range;
    bool isCovered = false;  ///< some point is
    bool isWhole = false;    ///< every point is, with a finite value
};

/// What a target's pool shows. @param leaves those that were published last; the target isn't behind.
std::vector<PlacedBrick> placeBricks(const PoolTarget& target, std::span<const GrowingLeaf> leaves,
                                     int channel, const Execution& execution);

}  // namespace tessera
