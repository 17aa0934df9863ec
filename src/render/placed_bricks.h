#pragma once

#include <cstdint>
#include <vector>

#include "brick/brick_tree.h"
#include "mesh/field_range.h"
#include "pool/pool_target.h"
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
    /// The finite values of all points of the closed box lie within, those outside the mesh too, and so does
    /// what is interpolated.
    ValueRange range;
    bool isCovered = false;  ///< some point may be
    bool isWhole = false;    ///< every point is, with a finite value
};

/// What a target's pool shows.
std::vector<PlacedBrick> placeBricks(const PoolTarget& target, int channel);

}  // namespace tessera
