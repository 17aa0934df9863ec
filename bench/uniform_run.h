#pragma once

#include <vector>

#include "refine/brick_result.h"
#include "refine/refine.h"
#include "refine/refine_options.h"
#include "tessera/resampler.h"

namespace tessera::bench {

/// Samples uniform bricks of so many points along the mesh's longest edge, and measures their error.
inline BrickResult runUniform(const TetMesh& mesh, const std::vector<int>& fields, const Resampler& resampler,
                              int points, int threads) {
    RefineOptions options;
    options.criterion = Criterion::uniform;
    options.resolution = points;
    Execution execution;
    execution.threads = threads;
    return refineAndResample(mesh, fields, resampler, options, execution);
}

}  // namespace tessera::bench
