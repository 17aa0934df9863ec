#include "refine/brick_plan.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <unordered_map>

#include "base/parallel.h"
#include "refine/brick_touch.h"
#include "refine/touch_kernel.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

constexpr std::int64_t kElementChunk = 16384;
constexpr double kDenseLimit = double(1 << 25);  // bricks of a dense grid of marks

double rangeCount(const BrickRange& range) {
    const Vec3d n = Vec3d(range.max) - Vec3d(range.min) + 1.0;
    return n.x < 1 || n.y < 1 || n.z < 1 ? 0 : n.x * n.y * n.z;
}

}  // namespace

double PlanFrame::spacingWorld(Depth depth) const {
    return std::ldexp(rootSpacingWorld, -depth.halvings());
}

Box3d brickTouchBox(const Vec3i& index, int brickCells) {
    const Vec3d first = Vec3d(index) * double(brickCells);
    return {first - kBrickSlackVoxels, first + double(brickCells)};
}

BrickPlan::BrickPlan(const TetMesh& mesh, const PlanFrame& frame, const Execution& execution,
                     const ElementIndex* index)
    : mesh_(&mesh), frame_(frame), rootRange_(clippedRange(frame, Depth(0))) {
    allocateRoots(index, execution);
}

void BrickPlan::allocateRoots(const ElementIndex* index, const Execution& execution) {
    // Within bounds an index leaves most of the mesh alone.
    std::vector<std::int32_t> near;
    const bool isPart = index && frame_.boundsWorld;
    if (isPart) {
        Box3d box = boxAround({Depth(0), rootRange_.min}, frame_);
        box.include(boxAround({Depth(0), rootRange_.max}, frame_).max);
        index->query(box, near);
    }
    const std::int64_t count = isPart ? std::int64_t(near.size()) : mesh_->elementCount();
    const auto element = [&](std::int64_t n) { return isPart ? near[std::size_t(n)] : std::int32_t(n); };
    std::vector<std::vector<std::pair<Vec3i, std::int32_t>>> found(
        std::size_t((count + kElementChunk - 1) / kElementChunk));
    parallelForChunks(execution, count, kElementChunk, [&](std::int64_t begin, std::int64_t end) {
        auto& list = found[std::size_t(begin / kElementChunk)];
        for (std::int64_t n = begin; n < end; ++n) {
            prefetchNodes(*mesh_, element(std::min(n + kPrefetchElements, count - 1)));
            const ElementOverlap own = overlapOf(*mesh_, frame_, element(n), Depth(0));
            const BrickRange range = rootsMeeting(own, frame_, rootRange_);
            for (int z = range.min.z; z <= range.max.z; ++z)
                for (int y = range.min.y; y <= range.max.y; ++y)
                    for (int x = range.min.x; x <= range.max.x; ++x)
                        if (touchesRoot(own, range, {x, y, z}, frame_))
                            list.emplace_back(Vec3i{x, y, z}, element(n));
        }
    });
    std::vector<Vec3i> roots;
    std::unordered_map<Vec3i, std::size_t, IndexHash> positions;
    for (const auto& list : found)
        for (const auto& [root, touching] : list) {
            const auto [position, fresh] = positions.try_emplace(root, roots.size());
            if (fresh) {
                roots.push_back(root);
                bricks_.emplace_back().key = {Depth(0), root};
            }
            bricks_[position->second].elements.push_back(touching);
        }
    tree_ = GrowingTree(roots);
}

std::vector<PlannedBrick*> BrickPlan::leaves() {
    std::vector<PlannedBrick*> result;
    result.reserve(leafCount());
    for (const GrowingLeaf& leaf : tree_.leaves()) result.push_back(&bricks_[leaf.slot]);
    return result;
}

// All eight, those without elements too.
std::vector<PlannedBrick> BrickPlan::children(const PlannedBrick& brick) const {
    std::vector<PlannedBrick> made(8);
    const BrickChildren children(brick.key, frame_);
    for (unsigned c = 0; c < 8; ++c) made[c].key = children.key(c);
    const std::size_t count = brick.elements.size();
    std::vector<ChildBits> touched(count);
    TouchBatch pairs;
    std::array<std::pair<std::size_t, ChildBits>, kTouchLanes> pairOf;  // element, and bit of the child
    const auto settlePairs = [&] {
        const std::uint64_t touching = tessera::touching(pairs);
        for (std::size_t i = 0; i < pairs.count; ++i)
            if (!(touching >> i & 1)) touched[pairOf[i].first] ^= pairOf[i].second;
        pairs.count = 0;
    };
    for (std::size_t n = 0; n < count; ++n) {
        prefetchNodes(*mesh_, brick.elements[std::min(n + std::size_t(kPrefetchElements), count - 1)]);
        const ElementOverlap own = overlapOf(*mesh_, frame_, brick.elements[n], brick.key.depth + 1);
        unsigned bits = touched[n] = children.meetingBounds(own);
        if (std::has_single_bit(bits)) continue;
        for (; bits != 0; bits &= bits - 1) {
            pairOf[pairs.count] = {n, ChildBits(bits & -bits)};
            pairs.add(own.nodes(), children.touchBox(unsigned(std::countr_zero(bits))));
            if (pairs.count == kTouchLanes) settlePairs();
        }
    }
    settlePairs();
    for (std::size_t n = 0; n < count; ++n)
        for (unsigned bits = touched[n]; bits != 0; bits &= bits - 1)
            made[std::size_t(std::countr_zero(bits))].elements.push_back(brick.elements[n]);
    splitSamples(brick, made);
    return made;
}

// As the splits from a root down to the brick would have left them.
std::vector<std::int32_t> BrickPlan::elementsOf(const DepthKey& key, const ElementIndex& index) const {
    std::vector<std::int32_t> elements;
    index.query(boxAround(key, frame_), elements);
    const BrickPath path(*mesh_, frame_, rootRange_, key);
    std::erase_if(elements, [&](std::int32_t e) { return !path.holds(e); });
    return elements;
}

bool BrickPlan::merge(const DepthKey& parent, const ElementIndex& index) {
    if (!tree_.merge(parent)) return false;
    const TreeChange& change = tree_.change();
    PlannedBrick merged;
    merged.key = parent;
    merged.elements = elementsOf(parent, index);
    for (const GrowingLeaf& leaf : change.removed) {
        const std::vector<std::uint32_t>& samples = bricks_[leaf.slot].samples;
        merged.samples.insert(merged.samples.end(), samples.begin(), samples.end());
        bricks_[leaf.slot] = {};
    }
    std::sort(merged.samples.begin(), merged.samples.end());
    bricks_.resize(tree_.slotCount());
    bricks_[change.added.front().slot] = std::move(merged);
    return true;
}

void BrickPlan::splitSamples(const PlannedBrick& brick, std::vector<PlannedBrick>& made) const {
    if (brick.samples.empty()) return;
    const double inverse = 1.0 / (frame_.spacingWorld(brick.key.depth) * frame_.brickCells);
    const Vec3d middle = Vec3d(brick.key.index) + 0.5;
    for (const std::uint32_t sample : brick.samples) {
        const Vec3d place = placeOfSample(sample) * inverse;
        std::size_t child = std::size_t((place.x >= middle.x ? 1 : 0) | (place.y >= middle.y ? 2 : 0) |
                                        (place.z >= middle.z ? 4 : 0));
        // Rounding can put a sample just across the middle, where no element reaches: any child that touches
        // it serves.
        for (std::size_t other = 0; made[child].elements.empty() && other < 8; ++other)
            if (!made[other].elements.empty()) child = other;
        made[child].samples.push_back(sample);
    }
}

bool BrickPlan::split(std::span<const DepthKey> keys, std::size_t maxLeaves, const Execution& execution) {
    const TreeChange& change = tree_.change();
    std::vector<std::uint32_t> split;  // slots of the bricks that are, in the order of change.added
    const auto choose = [&](std::span<const GrowingLeaf> wave, std::span<ChildBits> bits) {
        parallelFor(execution, std::int64_t(wave.size()), [&](std::int64_t i) {
            PlannedBrick& brick = bricks_[wave[std::size_t(i)].slot];
            if (brick.children.empty()) brick.children = children(brick);
            for (unsigned c = 0; c < 8; ++c)
                if (!brick.children[c].elements.empty())
                    bits[std::size_t(i)] = ChildBits(bits[std::size_t(i)] | 1u << c);
        });
        for (const GrowingLeaf& leaf : wave) split.push_back(leaf.slot);
    };
    if (!tree_.split(keys, maxLeaves, choose)) return false;
    bricks_.resize(tree_.slotCount());
    auto added = change.added.begin();
    for (const std::uint32_t slot : split) {
        for (PlannedBrick& child : bricks_[slot].children)
            if (!child.elements.empty()) bricks_[(added++)->slot] = std::move(child);
        bricks_[slot] = {};
    }
    return true;
}

BrickTree BrickPlan::tree(Depth finest) const {
    return tree_.brickTree(frame_.originWorld, frame_.rootSpacingWorld, frame_.brickCells, finest);
}

namespace {

// Marks of a box of bricks, one byte each, set from any thread. A layer more on each axis, which stays empty,
// tells neighbours by the difference of their positions.
class BrickMarks {
  public:
    explicit BrickMarks(const BrickRange& range)
        : range_(range),
          size_(range.max - range.min + 2),
          marks_(std::size_t(size_.x) * std::size_t(size_.y) * std::size_t(size_.z), 0) {}
    std::size_t position(int x, int y, int z) const {
        return (std::size_t(z - range_.min.z) * std::size_t(size_.y) + std::size_t(y - range_.min.y)) *
                   std::size_t(size_.x) +
               std::size_t(x - range_.min.x);
    }
    std::atomic_ref<std::uint8_t> at(std::size_t position) {
        return std::atomic_ref<std::uint8_t>(marks_[position]);
    }
    std::atomic_ref<std::uint8_t> at(int x, int y, int z) { return at(position(x, y, z)); }
    bool isMarked(std::size_t position) { return at(position).load(std::memory_order_relaxed) != 0; }
    /// True for bricks that are one or have a side in common.
    bool areBeside(std::size_t low, std::size_t high) const {
        const std::size_t step = high - low, row = std::size_t(size_.x), layer = row * std::size_t(size_.y);
        return (step == 0) | (step == 1) | (step == row) | (step == layer);
    }
    std::int64_t count() const {
        std::int64_t sum = 0;
        for (const std::uint8_t mark : marks_) sum += mark;
        return sum;
    }

  private:
    BrickRange range_;
    Vec3i size_;
    std::vector<std::uint8_t> marks_;
};

// The brick that a node lies in, and on which axes the slack puts it into the next one too.
struct NodeBrick {
    Vec3i brick;
    std::uint32_t nextAxes;
};

// The bricks of the nodes: as positions among the marks where one brick is all there is to a node, else
// kSeveral; and in full.
struct NodeBricks {
    static constexpr std::uint32_t kSeveral = ~std::uint32_t(0);
    std::vector<std::uint32_t> position;
    std::vector<NodeBrick> brick;
    /// True where the element's nodes lie in a marked brick or two of them that are side by side.
    bool areMarked(const std::array<std::int32_t, 4>& tet, BrickMarks& marks) const {
        const auto of = [&](std::size_t k) { return position[std::size_t(tet[k])]; };
        const std::uint32_t low = std::min({of(0), of(1), of(2), of(3)}),
                            high = std::max({of(0), of(1), of(2), of(3)});
        bool areTwo = true;
        for (std::size_t k = 0; k < 4; ++k) areTwo &= (of(k) == low) | (of(k) == high);
        return areTwo && high != kSeveral && marks.areBeside(low, high) && marks.isMarked(low) &&
               marks.isMarked(high);
    }
};

NodeBricks nodeBricks(const TetMesh& mesh, const PlanFrame& frame, const BrickRange& all,
                      const BrickMarks& marks, const Execution& execution) {
    NodeBricks result{std::vector<std::uint32_t>(mesh.points.size(), NodeBricks::kSeveral),
                      std::vector<NodeBrick>(mesh.points.size())};
    const double inverse = 1.0 / frame.spacingWorld(frame.maxDepth);
    parallelForChunks(execution, mesh.nodeCount(), kElementChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t n = begin; n < end; ++n) {
            const Vec3d index = (mesh.points[std::size_t(n)] - frame.originWorld) * inverse;
            const BrickRange range = bricksMeeting({index, index}, frame.brickCells);
            const Vec3i next = range.max - range.min;
            result.brick[std::size_t(n)] = {range.min, std::uint32_t(next.x | next.y << 1 | next.z << 2)};
            const Vec3i& b = range.min;
            if (range.min == range.max && glm::clamp(b, all.min, all.max) == b)
                result.position[std::size_t(n)] = std::uint32_t(marks.position(b.x, b.y, b.z));
        }
    });
    return result;
}

BrickRange elementRange(const TetMesh& mesh, const std::vector<NodeBrick>& nodes, std::int64_t element) {
    const auto& tet = mesh.tets[std::size_t(element)];
    const NodeBrick& first = nodes[std::size_t(tet[0])];
    BrickRange range{first.brick, first.brick};
    for (const std::int32_t n : tet) {
        const NodeBrick& node = nodes[std::size_t(n)];
        range.min = glm::min(range.min, node.brick);
        Vec3i high = node.brick;
        if (node.nextAxes) high += Vec3i(node.nextAxes & 1, (node.nextAxes >> 1) & 1, node.nextAxes >> 2);
        range.max = glm::max(range.max, high);
    }
    return range;
}

}  // namespace

std::int64_t touchedBricks(const TetMesh& mesh, const PlanFrame& frame, std::int64_t limit,
                           std::vector<BrickKey>* keys, const Execution& execution) {
    const Depth depth = frame.maxDepth;
    const BrickRange range = clippedRange(frame, depth);
    if (rangeCount(range) > kDenseLimit) return -1;
    BrickMarks marks(range);
    const double spacing = frame.spacingWorld(depth);
    const NodeBricks nodes = nodeBricks(mesh, frame, range, marks, execution);
    const std::int64_t last = mesh.elementCount() - 1;
    std::atomic<std::int64_t> left{std::int64_t(rangeCount(range))};  // bricks without a mark
    parallelForChunks(
        execution, mesh.elementCount(), kElementChunk, [&](std::int64_t begin, std::int64_t end) {
            if (left.load(std::memory_order_relaxed) == 0) return;
            std::optional<ElementOverlap> element;
            for (std::int64_t e = begin; e < end; ++e) {
                for (const std::int32_t n : mesh.tets[std::size_t(std::min(e + kPrefetchElements, last))])
                    __builtin_prefetch(&nodes.position[std::size_t(n)]);
                // Most bricks are marked already by an earlier element.
                if (nodes.areMarked(mesh.tets[std::size_t(e)], marks)) continue;
                const BrickRange own = elementRange(mesh, nodes.brick, e);
                const Vec3i low = glm::max(own.min, range.min), high = glm::min(own.max, range.max);
                element.reset();
                for (int z = low.z; z <= high.z; ++z)
                    for (int y = low.y; y <= high.y; ++y)
                        for (int x = low.x; x <= high.x; ++x) {
                            // Likewise: the exact test runs rarely.
                            auto mark = marks.at(x, y, z);
                            if (mark.load(std::memory_order_relaxed)) continue;
                            if (!element)
                                element.emplace(elementInIndexSpace(mesh, e, frame.originWorld, spacing));
                            const DepthKey key{depth, {x, y, z}};
                            if (element->touches(brickTouchBox(key.index, frame.brickCells)) &&
                                insideBounds(key, frame) && mark.exchange(1, std::memory_order_relaxed) == 0)
                                left.fetch_sub(1, std::memory_order_relaxed);
                        }
            }
        });
    const std::int64_t count = marks.count();
    if (!keys || count > limit) return count;
    keys->reserve(std::size_t(count));
    for (int z = range.min.z; z <= range.max.z; ++z)
        for (int y = range.min.y; y <= range.max.y; ++y)
            for (int x = range.min.x; x <= range.max.x; ++x)
                if (marks.at(x, y, z).load(std::memory_order_relaxed)) keys->push_back({0, {x, y, z}});
    return count;
}

}  // namespace tessera
