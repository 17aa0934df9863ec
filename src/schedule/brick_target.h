#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/check.h"
#include "brick/growing_tree.h"
#include "brick/surface_distance.h"
#include "tessera/lattice.h"

namespace tessera {

/// A leaf brick with the samples of its closed box: (B + 1)^3 points of its depth's lattice.
struct ShownBrick {
    GrowingLeaf leaf;
    std::shared_ptr<const Block> samples;
    /// Null unless the bricks are from a file, where no mesh is at hand.
    std::shared_ptr<const SurfacePoints> surface = {};
};

/// A step from one consistent state of a scheduler to the next: leaves that cover the domain once, of which
/// any two that touch differ by at most one depth.
struct Publication {
    std::span<const GrowingLeaf> removed;
    std::span<const ShownBrick> added;
    /// After the step. All of this is valid during publish() alone.
    const GrowingTree* tree = nullptr;
    /// What was changed lies in this brick of the tree; null: all is new.
    const DepthKey* within = nullptr;

    /// Leaves that stay and touch what was removed: by the seam rule their values on that border may change.
    std::vector<GrowingLeaf> findBordering() const {
        std::vector<GrowingLeaf> bordering;
        if (!within) return bordering;
        TESSERA_CHECK(tree, "a place in no tree");
        tree->findNeighbours(*within, bordering);
        return bordering;
    }
};

/// How far a scheduler is.
struct ScheduleProgress {
    std::size_t leavesShown = 0;
    /// Of the plan as far as it is made: it grows while work goes on, and is shown whole at rest.
    std::size_t leavesPlanned = 0;
    /// Bricks that are being sampled or wait for it.
    std::size_t bricksAtWork = 0;
    std::int64_t bytes = 0, budgetBytes = 0;
};

/// Where a scheduler puts its bricks: a store in memory, or a pool of 3D textures.
class BrickTarget {
  public:
    virtual ~BrickTarget() = default;
    // All are called from within BrickScheduler's calls, by the thread that made the call.
    /// The samples may be kept.
    virtual void publish(const Publication& publication) = 0;
    /// At the end of a call that published something.
    virtual void progress(const ScheduleProgress&) {}
    /// When it comes to rest: nothing is left to do until wishes or the budget change.
    virtual void rest() {}
};

}  // namespace tessera
