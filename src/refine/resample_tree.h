#pragma once

#include <span>

#include "refine/refine.h"

namespace tessera {

/// Samples these leaves into the store, level by level, neighbouring leaves in one block.
void resampleLeaves(const BrickTree& tree, std::span<const std::size_t> leaves, BoundResampler& resampler,
                    BrickStore& store, const Execution& execution, ResampleStatistics& statistics);

}  // namespace tessera
