#pragma once

#include <cstdint>

#include "refine/node_set.h"
#include "schedule/brick_scheduler.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// How far what is shown lies from the mesh, at its nodes near a place.
struct FocusError {
    /// Within the radius, used by an element that isn't flat; and of these, those that were compared.
    std::int64_t nodesNear = 0, nodes = 0;
    /// Shares of the field's range (field units when that is 0); 0 without a node that was compared.
    double relativeMax = 0, relativeRms = 0;
};

/// Compares the node values of one field's first component with trilinear interpolation among the samples of
/// the leaf that holds the node, (B + 1)^3 points. Left out are nodes whose cell isn't wholly in the mesh, or
/// has a value that isn't finite.
class FocusErrors {
  public:
    /// @param field of the mesh, with values at nodes; it must outlive this. @param channel of its samples.
    FocusErrors(const TetMesh& mesh, int field, int channel, const Execution& execution);

    FocusError measure(const BrickScheduler& scheduler, const Vec3d& placeWorld, double radiusWorld) const;

  private:
    const TetMesh& mesh_;
    const Field& field_;
    int channel_;
    double range_;
    NodeSet nodes_;
};

/// The finest brick of a frame that holds a place, whether there is one or not.
DepthKey finestBrickAt(const PlanFrame& frame, const Vec3d& placeWorld);

}  // namespace tessera
