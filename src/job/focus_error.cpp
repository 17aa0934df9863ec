#include "job/focus_error.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "mesh/field_range.h"

namespace tessera {

namespace {

/// By rounding, a place on a lattice plane may lie in the cell on either side: corners that have less of a
/// say than this may be outside the mesh.
constexpr double kLeastWeight = 1e-9;

/// The value at a place within the block's box; nothing where its cell isn't wholly covered and finite.
std::optional<double> interpolate(const Block& block, int channel, const Vec3d& placeWorld) {
    const Vec3d index = (placeWorld - block.lattice.originWorld) / block.lattice.uWorld.x;
    const Vec3i corner = glm::clamp(Vec3i(glm::floor(index)), block.box.min, block.box.max - 2);
    const Vec3d share = glm::clamp(index - Vec3d(corner), 0.0, 1.0);
    double value = 0;
    for (int n = 0; n < 8; ++n) {
        const Vec3i offset(n & 1, n >> 1 & 1, n >> 2);
        const Vec3d shares = glm::mix(1.0 - share, share, Vec3d(offset));
        const double weight = shares.x * shares.y * shares.z;
        if (weight < kLeastWeight) continue;
        if (!block.covered(corner + offset)) return std::nullopt;
        value += weight * double(block.value(channel, corner + offset));
    }
    if (!std::isfinite(value)) return std::nullopt;
    return value;
}

}  // namespace

DepthKey finestBrickAt(const PlanFrame& frame, const Vec3d& placeWorld) {
    constexpr double kFarthest = 1 << 30;
    const double edge = frame.spacingWorld(frame.maxDepth) * frame.brickCells;
    const Vec3d index = glm::floor((placeWorld - frame.originWorld) / edge);
    return {frame.maxDepth, Vec3i(glm::clamp(index, -kFarthest, kFarthest))};
}

FocusErrors::FocusErrors(const TetMesh& mesh, int field, int channel, const Execution& execution)
    : mesh_(mesh),
      field_(mesh.fields[std::size_t(field)]),
      channel_(channel),
      range_(fieldRange(field_, 0).width()),
      nodes_(nodesOfVolumes(mesh, execution)) {
    if (range_ == 0) range_ = 1;
}

FocusError FocusErrors::measure(const BrickScheduler& scheduler, const Vec3d& placeWorld,
                                double radiusWorld) const {
    FocusError error;
    double squares = 0;
    DepthKey last;
    std::shared_ptr<const Block> block;
    for (std::size_t n = 0; n < mesh_.points.size(); ++n) {
        const Vec3d& node = mesh_.points[n];
        if (!(glm::distance(node, placeWorld) <= radiusWorld) || !nodes_.contains(n)) continue;
        ++error.nodesNear;
        const auto leaf = scheduler.tree().findCovering(finestBrickAt(scheduler.frame(), node));
        if (!leaf) continue;
        if (!block || !(leaf->key == last)) {
            block = scheduler.samples(leaf->key);
            last = leaf->key;
        }
        const double exact = field_.at(std::int64_t(n), 0);
        const std::optional<double> shown = interpolate(*block, channel_, node);
        if (!shown || !std::isfinite(exact)) continue;
        ++error.nodes;
        const double difference = std::abs(*shown - exact) / range_;
        error.relativeMax = std::max(error.relativeMax, difference);
        squares += difference * difference;
    }
    if (error.nodes > 0) error.relativeRms = std::sqrt(squares / double(error.nodes));
    return error;
}

}  // namespace tessera
