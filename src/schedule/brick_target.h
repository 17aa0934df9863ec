#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "brick/growing_tree.h"
#include "tessera/lattice.h"

namespace tessera {

/// A leaf brick with the samples of its closed box: (B + 1)^3 points of its depth's lattice.
struct ShownBrick {
    GrowingLeaf leaf;
    std::shared_ptr<const Block> samples;
};

/// A step from one consistent state of a scheduler to the next: leaves that cover the domain once, of which
/// any two that touch differ by at most one depth.
struct Publication {
    std::span<const GrowingLeaf> removed;
    std::span<const ShownBrick> added;
    /// Leaves that stay and touch what was removed: by the seam rule their values on that border may change.
    std::span<const GrowingLeaf> bordering;
};

/// Where a scheduler puts its bricks: a store in memory, or a pool of 3D textures.
class BrickTarget {
  public:
    virtual ~BrickTarget() = default;
    /// Called from within BrickScheduler's calls, by the thread that made the call. The samples may be kept.
    virtual void publish(const Publication& publication) = 0;
};

}  // namespace tessera
