#pragma once

#include <span>
#include <string>

#include "refine/brick_result.h"
#include "refine/refine_options.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

/// A bound of refinement by error that a report exceeds, as a sentence: which field, by how much, where.
/// Empty when the report keeps to it.
/// @param fields what the report's fields are in the mesh.
std::string exceededBound(const TetMesh& mesh, std::span<const int> fields, const RefineOptions& options,
                          const ErrorReport& report);

/// Plans, samples and measures: the whole way from a mesh to bricks, by any criterion.
/// @param fields indices into mesh.fields: the channels, in this order.
BrickResult refineAndResample(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                              const RefineOptions& options, const Execution& execution);

}  // namespace tessera
