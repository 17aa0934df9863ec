#pragma once

#include "registry/cost_model.h"
#include "tessera/execution.h"

namespace tessera {

/// Samples small meshes of a few sizes here and now. The first of all calls isn't measured: it may open a
/// device and compile shaders.
/// @param budgetMs stops measuring anew; each size is measured twice in any case, once beside it.
/// Throws what binding and sampling do.
CostModel measureCost(const Resampler& resampler, const BindOptions& options, double budgetMs,
                      const Execution& execution);

}  // namespace tessera
