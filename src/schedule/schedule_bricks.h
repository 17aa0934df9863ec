#pragma once

#include <span>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "refine/brick_result.h"
#include "refine/refine_options.h"
#include "schedule/brick_scheduler.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

/// The leaves that a scheduler shows, as the bricks of a file: copies of their samples.
struct BricksShown {
    BrickTree tree;
    BrickStore store;
};
/// @param finest depth that becomes level 0; not above the deepest leaf.
BricksShown bricksOf(const BrickScheduler& scheduler, Depth finest);

/// From a mesh to bricks by any criterion: refineAndResample(), or with Criterion::visibility or an archive a
/// scheduler that comes to rest.
/// @param fields indices into mesh.fields: the channels, in this order.
BrickResult makeBricks(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                       const RefineOptions& options, const Execution& execution,
                       std::shared_ptr<BrickArchive> archive = nullptr);

}  // namespace tessera
