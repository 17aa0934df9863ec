#include "refine/mesh_bricks.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <limits>
#include <utility>

#include "base/check.h"
#include "base/parallel.h"
#include "refine/brick_touch.h"
#include "refine/element_size.h"
#include "refine/wishes.h"

namespace tessera {

namespace {

bool meet(const Box3d& a, const Box3d& b) {
    return a.min.x <= b.max.x && a.min.y <= b.max.y && a.min.z <= b.max.z && a.max.x >= b.min.x &&
           a.max.y >= b.min.y && a.max.z >= b.min.z;
}

// In the order of z, y, x.
template <class Visit>
void forEachIn(const BrickRange& range, const Visit& visit) {
    Vec3i at;
    for (at.z = range.min.z; at.z <= range.max.z; ++at.z)
        for (at.y = range.min.y; at.y <= range.max.y; ++at.y)
            for (at.x = range.min.x; at.x <= range.max.x; ++at.x) visit(at);
}

constexpr std::int64_t kElementsATask = 4096;

}  // namespace

MeshBricks::MeshBricks(std::shared_ptr<const SharedElementIndex> index, const PlanFrame& frame,
                       double samplesPerElement, const Execution& execution)
    : shared_(std::move(index)),
      mesh_(shared_->mesh()),
      frame_(frame),
      rootRange_(clippedRange(frame, Depth(0))),
      samplesPerElement_(samplesPerElement) {
    if (samplesPerElement > 0)
        sizes_ = elementSizes(mesh_, frame.rootSpacingWorld, frame.boundsWorld, execution.withoutProgress());
    for (Depth depth; depth <= frame.maxDepth + 1; depth = depth + 1)
        spacings_.push_back(frame.spacingWorld(depth));
    findRoots(execution);
}

void MeshBricks::findRoots(const Execution& execution) {
    // One of many roots is found faster by the index.
    constexpr double kMostInAPass = 4096;
    const Vec3d count = Vec3d(rootRange_.max - rootRange_.min) + 1.0;
    const bool isByPass =
        !shared_->ifBuilt() && !frame_.boundsWorld && count.x * count.y * count.z <= kMostInAPass;
    const std::vector<std::int32_t> shownBy =
        isByPass ? rootsShown(execution) : rootsShown(shared_->get(execution));
    std::size_t n = 0;
    forEachIn(rootRange_, [&](const Vec3i& root) {
        const std::int32_t element = shownBy[n++];
        if (element == kNoElement) return;
        roots_.push_back(root);
        Brick& brick = bricks_.add();
        brick.key = {Depth(0), root};
        brick.shownBy = element;
    });
    rootNumbers_ = RootGrid<Number>(roots_);
    for (std::size_t r = 0; r < roots_.size(); ++r) rootNumbers_.slot(roots_[r]) = Number(r) + 1;
}

std::vector<std::int32_t> MeshBricks::rootsShown(const ElementIndex& index) const {
    std::vector<std::int32_t> shown;
    forEachIn(rootRange_, [&](const Vec3i& root) {
        std::int32_t& shownBy = shown.emplace_back(kNoElement);
        const DepthKey key{Depth(0), root};
        if (!insideBounds(key, frame_)) return;
        const Box3d box = boxAround(key, frame_);
        const BrickPath path(mesh_, frame_, rootRange_, key);
        index.walk([&](const Box3d& near) { return shownBy == kNoElement && meet(near, box); },
                   [&](std::int32_t e) {
                       if (shownBy == kNoElement && path.holds(e)) shownBy = e;
                   });
    });
    return shown;
}

// The first element of each, whatever the threads.
std::vector<std::int32_t> MeshBricks::rootsShown(const Execution& execution) const {
    const Vec3i size = rootRange_.max - rootRange_.min + 1;
    const std::int64_t elements = mesh_.elementCount();
    std::vector<std::int32_t> shown(std::size_t(size.x) * std::size_t(size.y) * std::size_t(size.z),
                                    std::numeric_limits<std::int32_t>::max());
    parallelForChunks(execution, elements, kElementsATask, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
            prefetchNodes(mesh_, std::min(e + kPrefetchElements, elements - 1));
            const ElementOverlap own = overlapOf(mesh_, frame_, std::int32_t(e), Depth(0));
            const BrickRange range = rootsMeeting(own, frame_, rootRange_);
            forEachIn(range, [&](const Vec3i& root) {
                const Vec3i at = root - rootRange_.min;
                const std::atomic_ref<std::int32_t> first(
                    shown[std::size_t((at.z * size.y + at.y) * size.x + at.x)]);
                std::int32_t known = first.load(std::memory_order_relaxed);
                if (known <= e || !touchesRoot(own, range, root, frame_)) return;
                while (e < known && !first.compare_exchange_weak(known, std::int32_t(e))) {
                }
            });
        }
    });
    for (std::int32_t& element : shown)
        if (element == std::numeric_limits<std::int32_t>::max()) element = kNoElement;
    return shown;
}

std::optional<MeshBricks::Number> MeshBricks::find(const DepthKey& key) const {
    Number number = rootNumbers_.at(ancestorKey(key, Depth(0)).index);
    if (number-- == 0) return {};
    for (Depth depth(1); depth <= key.depth; depth = depth + 1) {
        const unsigned child = childNumber(ancestorKey(key, depth).index);
        if (!(bricks_[number].children >> child & 1)) return {};
        number = bricks_[number].firstChild + child;
    }
    return number;
}

// The brick, when it is there: the bricks above are looked at, if none has done so.
std::optional<MeshBricks::Number> MeshBricks::look(const DepthKey& key) {
    Number number = rootNumbers_.at(ancestorKey(key, Depth(0)).index);
    if (number-- == 0) return {};
    for (Depth depth(1); depth <= key.depth; depth = depth + 1) {
        const unsigned child = childNumber(ancestorKey(key, depth).index);
        if (!(children(number) >> child & 1)) return {};
        number = bricks_[number].firstChild + child;
    }
    return number;
}

// An element that touches a child shows that the child is there: a few elements show all inside a mesh.
void MeshBricks::findChildren(Number brick) {
    const DepthKey key = bricks_[brick].key;
    const BrickChildren children(key, frame_);
    std::optional<BrickPath> path;
    unsigned missing = children.allowed();
    ChildBits there = 0;
    std::array<std::int32_t, 8> shownBy;
    const auto show = [&](std::int32_t e, unsigned touched) {
        for (unsigned bits = touched; bits != 0; bits &= bits - 1)
            shownBy[std::size_t(std::countr_zero(bits))] = e;
        there = ChildBits(there | touched);
        missing &= ~touched;
    };
    const auto overlap = [&](std::int32_t e) { return overlapOf(mesh_, frame_, e, key.depth + 1); };
    const auto showTouched = [&](std::int32_t e, unsigned asked) {
        const unsigned touched = children.touchedBy(overlap(e), missing & asked);
        if (touched == 0) return;
        if (!path) path.emplace(mesh_, frame_, rootRange_, key);
        if (path->holds(e)) show(e, touched);
    };
    const double spacing = frame_.spacingWorld(key.depth + 1);
    // Of the elements around a point of those children one that holds it shows them all.
    const auto showAround = [&](const Vec3d& point, unsigned asked) {
        if ((missing & asked) == 0) return;
        const Vec3d world = frame_.originWorld + point * spacing;
        found_.clear();
        index().query({world, world}, found_);
        for (const std::int32_t e : found_)
            if (overlap(e).holds(point)) return show(e, missing & asked);
        for (const std::int32_t e : found_) showTouched(e, asked);
    };
    // The one that showed the brick may be as large.
    const std::int32_t own = bricks_[brick].shownBy;
    if (const ElementOverlap large = overlap(own); large.holds(children.shared()))
        show(own, missing);
    else
        show(own, children.touchedBy(large, missing));
    showAround(children.shared(), 0xff);
    for (unsigned c = 0; c < 8; ++c) showAround(children.middle(c), 1u << c);
    if (missing != 0) {
        std::array<Box3d, 8> boxes;
        for (unsigned c = 0; c < 8; ++c) boxes[c] = boxAround(children.key(c), frame_);
        const auto mayShow = [&](const Box3d& near) {
            for (unsigned bits = missing; bits != 0; bits &= bits - 1)
                if (meet(near, boxes[std::size_t(std::countr_zero(bits))])) return true;
            return false;
        };
        index().walk(mayShow, [&](std::int32_t e) { showTouched(e, 0xff); });
    }
    const std::size_t first = bricks_.size();
    TESSERA_CHECK(first + 8 < ~Number(0), "too many bricks were looked at");
    bricks_.grow(first + 8);
    for (unsigned c = 0; c < 8; ++c) {
        bricks_[first + c].key = children.key(c);
        if (there >> c & 1) bricks_[first + c].shownBy = shownBy[c];
    }
    bricks_[brick].firstChild = Number(first);
    bricks_[brick].children = there;
}

ChildBits MeshBricks::children(Number brick) {
    if (bricks_[brick].firstChild == 0) findChildren(brick);
    return bricks_[brick].children;
}

std::span<const MeshBricks::Number> MeshBricks::nearParents(Number brick) {
    const DepthKey key = bricks_[brick].key;
    if (key.depth == Depth(0)) return {};
    if (bricks_[brick].nearParents == 0) {
        NearParents near;
        for (unsigned n = 0; n < 8; ++n) {
            const DepthKey at{key.depth - 1, ((key.index - 1) >> 1) + childOffset(n)};
            if (at.index == key.index >> 1) continue;
            if (const auto number = look(at)) near.numbers[near.count++] = *number;
        }
        nearParents_.add() = near;
        bricks_[brick].nearParents = Number(nearParents_.size());
    }
    const NearParents& near = nearParents_[bricks_[brick].nearParents - 1];
    return {near.numbers.data(), near.count};
}

ChildBoxes MeshBricks::childBoxesWorld(Number brick) const {
    const DepthKey key = bricks_[brick].key;
    ChildBoxes boxes;
    for (int half = 0; half < 2; ++half) boxes.halves[half] = boxWorld({key.depth + 1, key.index * 2 + half});
    return boxes;
}

Box3d MeshBricks::boxWorld(const DepthKey& key) const {
    const double edge = frame_.spacingWorld(key.depth) * frame_.brickCells;
    const Vec3d low = frame_.originWorld + Vec3d(key.index) * edge;
    Box3d box{glm::max(low, frame_.meshBoundsWorld.min), glm::min(low + edge, frame_.meshBoundsWorld.max)};
    if (frame_.boundsWorld) {
        box.min = glm::max(box.min, frame_.boundsWorld->min);
        box.max = glm::min(box.max, frame_.boundsWorld->max);
    }
    // A brick beside the bounds is there for its points on their border.
    box.max = glm::max(box.min, box.max);
    return box;
}

std::int64_t MeshBricks::elementsNear(Number brick) {
    std::int32_t& count = bricks_[brick].elementsNear;
    if (count < 0) count = std::int32_t(index().countAbout(boxAround(key(brick), frame_)));
    return count;
}

double MeshBricks::wishedByElementSize(Number brick) {
    if (samplesPerElement_ <= 0) return kNoWish;
    float& wished = bricks_[brick].wishedByElementSize;
    if (wished >= 0) return double(wished) * frame_.rootSpacingWorld / samplesPerElement_;
    found_.clear();
    foundSizes_.clear();
    index().query(boxAround(key(brick), frame_), found_);
    const BrickPath path(mesh_, frame_, rootRange_, key(brick));
    for (const std::int32_t e : found_)
        if (sizes_[std::size_t(e)] > 0 && path.holds(e)) foundSizes_.push_back(sizes_[std::size_t(e)]);
    wished = std::numeric_limits<float>::infinity();
    if (!foundSizes_.empty()) {
        const auto decides = foundSizes_.begin() + mostTooSmall(std::int64_t(foundSizes_.size()));
        std::nth_element(foundSizes_.begin(), decides, foundSizes_.end());
        wished = *decides;
    }
    return wishedByElementSize(brick);
}

void MeshBricks::setFindings(Number brick, BrickFindings findings) {
    bricks_[brick].findings = std::make_unique<const BrickFindings>(std::move(findings));
}

const ValueMask& MeshBricks::values(Number brick, const BrickInspector& inspector) {
    std::unique_ptr<const ValueMask>& values = bricks_[brick].values;
    if (!values) {
        found_.clear();
        index().query(boxAround(key(brick), frame_), found_);
        values = std::make_unique<const ValueMask>(inspector.binsOf(found_));
    }
    return *values;
}

}  // namespace tessera
