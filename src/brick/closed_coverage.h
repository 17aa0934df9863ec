#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "brick/seams.h"
#include "tessera/execution.h"

namespace tessera {

/// Which points of the closed boxes of leaves are covered, by the seam rule. Tree, store and reconstruction
/// must stay as they are. Thread-safe.
class ClosedCoverage {
  public:
    ClosedCoverage(const BrickTree& tree, const BrickStore& store, const Reconstruction& reconstruction,
                   const Execution& execution);

    /// Whether the leaf owns no point that isn't covered.
    bool isFull(std::size_t leaf) const { return isFull_[leaf] != 0; }
    /// Whether all points of its closed box are covered, told without looking at them; false may mean either.
    bool isSurelyWhole(std::size_t leaf) const;
    /// One a point, x fastest: 0 where it isn't covered.
    std::vector<std::uint8_t> of(std::size_t leaf) const;

  private:
    const BrickTree& tree_;
    const BrickStore& store_;
    const Reconstruction& reconstruction_;
    std::vector<std::uint8_t> isFull_;  // by leaf
};

}  // namespace tessera
