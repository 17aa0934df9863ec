#pragma once

#include <span>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "tessera/execution.h"
#include "tessera/resampler.h"

namespace tessera {

/// Samples these leaves into the store, level by level, neighbouring leaves in one block.
void resampleLeaves(const BrickTree& tree, std::span<const std::size_t> leaves, BoundResampler& resampler,
                    BrickStore& store, const Execution& execution, ResampleStatistics& statistics);

/// Samples every leaf of a tree. Neighbouring leaves of one level are sampled in larger blocks than a brick.
BrickStore resampleTree(const BrickTree& tree, BoundResampler& resampler, int channels,
                        const Execution& execution, ResampleStatistics& statistics);

}  // namespace tessera
