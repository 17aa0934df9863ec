#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "brick/depth.h"
#include "brick/growing_tree.h"
#include "brick/overlap.h"
#include "refine/brick_plan.h"
#include "refine/wishes.h"
#include "tessera/mesh.h"

namespace tessera {

/// Keeps every brick with points that reading inside the frame's bounds can need.
bool insideBounds(const DepthKey& key, const PlanFrame& frame);

/// Bricks of a size whose touch boxes may meet a box in index space.
inline BrickRange bricksMeeting(const Box3d& index, int brickCells) {
    // What lies beyond the range of indices is far outside the bounds; it must not overflow here.
    constexpr double kFar = 1 << 30;
    const double inverse = 1.0 / brickCells;
    const Vec3d low = glm::clamp(index.min * inverse, Vec3d(-kFar), Vec3d(kFar));
    const Vec3d high = glm::clamp((index.max + kBrickSlackVoxels) * inverse, Vec3d(-kFar), Vec3d(kFar));
    return {{floorToInt(low.x), floorToInt(low.y), floorToInt(low.z)},
            {floorToInt(high.x), floorToInt(high.y), floorToInt(high.z)}};
}

/// Bricks of a depth that may meet the mesh and the frame's bounds.
BrickRange clippedRange(const PlanFrame& frame, Depth depth);

/// A box that holds whatever counts as touching the brick, world units.
Box3d boxAround(const DepthKey& key, const PlanFrame& frame);

/// An element in index space of a depth.
ElementOverlap overlapOf(const TetMesh& mesh, const PlanFrame& frame, std::int64_t element, Depth depth);

/// The bricks of depth 0, among `all`, that an element can touch.
BrickRange rootsMeeting(const ElementOverlap& element, const PlanFrame& frame, const BrickRange& all);

/// @param roots what rootsMeeting() gave for the element; `root` is one of them.
bool touchesRoot(const ElementOverlap& element, const BrickRange& roots, const Vec3i& root,
                 const PlanFrame& frame);

/// The eight children of a brick, and which of them an element touches.
class BrickChildren {
  public:
    BrickChildren(const DepthKey& parent, const PlanFrame& frame);
    DepthKey key(unsigned child) const { return childKey(parent_, child); }
    /// Those inside the frame's bounds.
    ChildBits allowed() const { return allowed_; }
    /// Those that an element's bounds meet; where it is one the element touches it.
    ChildBits meetingBounds(const ElementOverlap& element) const;
    Box3d touchBox(unsigned child) const { return boxes_.box(child); }
    /// Of the children that are asked for.
    /// @param element one that touches the parent, in index space of the children's depth.
    ChildBits touchedBy(const ElementOverlap& element, unsigned asked = 0xff) const;
    /// A point that the touch boxes of all eight share, and the middle of one; index space of their depth.
    /// What holds a point of a touch box touches the brick and all above.
    Vec3d shared() const { return (boxes_.halves[0].max + boxes_.halves[1].min) * 0.5; }
    Vec3d middle(unsigned child) const {
        const Box3d box = boxes_.box(child);
        return (box.min + box.max) * 0.5;
    }

  private:
    DepthKey parent_;
    ChildBoxes boxes_;
    ChildBits allowed_ = 0;
};

/// Tells whether an element belongs to a brick as splits from its root down to it would find: it touches the
/// root and then, depth by depth, the child on the way.
class BrickPath {
  public:
    /// @param roots clippedRange(frame, Depth(0)). Mesh and frame must outlive it.
    BrickPath(const TetMesh& mesh, const PlanFrame& frame, const BrickRange& roots, const DepthKey& key);
    bool holds(std::int64_t element) const;

  private:
    const TetMesh& mesh_;
    const PlanFrame& frame_;
    BrickRange roots_;
    DepthKey key_;
    std::vector<BrickChildren> above_;  // of the bricks above, from the root on
};

}  // namespace tessera
