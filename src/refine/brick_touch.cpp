#include "refine/brick_touch.h"

#include <bit>
#include <cmath>

#include "brick/kept_points.h"

namespace tessera {

bool insideBounds(const DepthKey& key, const PlanFrame& frame) {
    if (!frame.boundsWorld) return true;
    const IndexBox kept =
        KeptPoints(frame.boundsWorld, frame.originWorld, frame.spacingWorld(key.depth), 2).range(0);
    const Vec3i first = key.index * frame.brickCells;
    return !intersect(kept, {first, first + frame.brickCells}).empty();
}

BrickRange clippedRange(const PlanFrame& frame, Depth depth) {
    const double inverse = 1.0 / frame.spacingWorld(depth);
    Box3d box{(frame.meshBoundsWorld.min - frame.originWorld) * inverse,
              (frame.meshBoundsWorld.max - frame.originWorld) * inverse};
    if (frame.boundsWorld) {
        box.min = glm::max(box.min,
                           (frame.boundsWorld->min - frame.originWorld) * inverse - (2.0 + frame.brickCells));
        box.max = glm::min(box.max,
                           (frame.boundsWorld->max - frame.originWorld) * inverse + (2.0 + frame.brickCells));
    }
    return bricksMeeting(box, frame.brickCells);
}

BrickRange rootsMeeting(const ElementOverlap& element, const PlanFrame& frame, const BrickRange& all) {
    const BrickRange range = bricksMeeting(element.bounds(), frame.brickCells);
    return {glm::max(range.min, all.min), glm::min(range.max, all.max)};
}

bool touchesRoot(const ElementOverlap& element, const BrickRange& roots, const Vec3i& root,
                 const PlanFrame& frame) {
    if (!insideBounds({Depth(0), root}, frame)) return false;
    const Box3d box = brickTouchBox(root, frame.brickCells);
    return roots.min == roots.max ? element.boundsTouch(box) : element.touches(box);
}

Box3d boxAround(const DepthKey& key, const PlanFrame& frame) {
    const double spacing = frame.spacingWorld(key.depth);
    const Box3d box = brickTouchBox(key.index, frame.brickCells);
    Box3d world{frame.originWorld + box.min * spacing, frame.originWorld + box.max * spacing};
    const Vec3d most = glm::max(glm::abs(world.min), glm::abs(world.max)) + glm::abs(frame.originWorld);
    const Vec3d margin = spacing * 0x1p-16 + most * 0x1p-50;
    world.min -= margin;
    world.max += margin;
    return world;
}

ElementOverlap overlapOf(const TetMesh& mesh, const PlanFrame& frame, std::int64_t element, Depth depth) {
    return ElementOverlap(elementInIndexSpace(mesh, element, frame.originWorld, frame.spacingWorld(depth)));
}

BrickChildren::BrickChildren(const DepthKey& parent, const PlanFrame& frame)
    : parent_(parent),
      boxes_{{brickTouchBox(key(0).index, frame.brickCells), brickTouchBox(key(7).index, frame.brickCells)}} {
    for (unsigned c = 0; c < 8; ++c)
        if (insideBounds(key(c), frame)) allowed_ = ChildBits(allowed_ | 1u << c);
}

ChildBits BrickChildren::meetingBounds(const ElementOverlap& element) const {
    // Per axis the lower and the upper children share their bounds.
    const Box3d& own = element.bounds();
    std::array<bool, 6> touched;
    for (int a = 0; a < 3; ++a)
        for (int upper = 0; upper < 2; ++upper) {
            const Box3d& half = boxes_.halves[upper];
            touched[std::size_t(2 * a + upper)] = own.min[a] < half.max[a] && own.max[a] >= half.min[a];
        }
    unsigned bits = 0;
    for (std::size_t c = 0; c < 8; ++c)
        if ((allowed_ >> c & 1) && touched[c & 1] && touched[2 + ((c >> 1) & 1)] && touched[4 + (c >> 2)])
            bits |= 1u << c;
    return ChildBits(bits);
}

ChildBits BrickChildren::touchedBy(const ElementOverlap& element, unsigned asked) const {
    unsigned bits = meetingBounds(element);
    if (std::has_single_bit(bits)) return ChildBits(bits & asked);
    bits &= asked;
    for (unsigned c = 0; c < 8; ++c)
        if ((bits >> c & 1) && !element.touches(boxes_.box(c))) bits &= ~(1u << c);
    return ChildBits(bits);
}

BrickPath::BrickPath(const TetMesh& mesh, const PlanFrame& frame, const BrickRange& roots,
                     const DepthKey& key)
    : mesh_(mesh), frame_(frame), roots_(roots), key_(key) {
    above_.reserve(std::size_t(key.depth.halvings()));
    for (Depth d; d < key.depth; d = d + 1) above_.emplace_back(ancestorKey(key, d), frame);
}

bool BrickPath::holds(std::int64_t element) const {
    const Vec3i root = ancestorKey(key_, Depth(0)).index;
    const ElementOverlap own = overlapOf(mesh_, frame_, element, Depth(0));
    const BrickRange roots = rootsMeeting(own, frame_, roots_);
    if (glm::clamp(root, roots.min, roots.max) != root || !touchesRoot(own, roots, root, frame_))
        return false;
    for (std::size_t d = 0; d < above_.size(); ++d) {
        const Depth depth(int(d) + 1);
        const unsigned child = childNumber(ancestorKey(key_, depth).index);
        if (above_[d].touchedBy(overlapOf(mesh_, frame_, element, depth), 1u << child) == 0) return false;
    }
    return true;
}

}  // namespace tessera
