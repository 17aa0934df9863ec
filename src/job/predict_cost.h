#pragma once

#include <span>

#include "refine/plan.h"
#include "refine/refine.h"
#include "tessera/resampler.h"

namespace tessera {

/// Predicted wall time from the plan to the whole file.
struct CostPrediction {
    double levelsMs = 0;
    double flatMs = 0;
};

/// Samples a small, fixed choice of the leaves here and now and extrapolates; writing is reckoned at a
/// typical rate of OpenVDB with Blosc.
CostPrediction predictCost(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                           const PlanEstimate& estimate, int channels, const Resampler& resampler,
                           const BindOptions& bind, const Execution& execution);

}  // namespace tessera
