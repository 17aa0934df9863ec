#include "brick/growing_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "base/check.h"

namespace tessera {

namespace {

// Of the brick's 27 neighbours, itself in the middle.
Vec3i neighbourOffset(unsigned n) {
    return {int(n % 3) - 1, int(n / 3 % 3) - 1, int(n / 9) - 1};
}
constexpr unsigned kItself = 13;

// Children of a neighbour that touch the brick, by neighbour.
std::array<ChildBits, 27> childrenTouchingBrick() {
    std::array<ChildBits, 27> result{};
    for (unsigned n = 0; n < 27; ++n)
        for (unsigned c = 0; c < 8; ++c) {
            bool touches = true;
            for (int a = 0; a < 3; ++a) {
                const bool upper = (c >> a) & 1;
                touches = touches && neighbourOffset(n)[a] != (upper ? 1 : -1);
            }
            if (touches) result[n] = ChildBits(result[n] | 1u << c);
        }
    return result;
}
const std::array<ChildBits, 27> kChildrenTouchingBrick = childrenTouchingBrick();

// Children that lie on the sides of a corner, on the axes whose bits are set.
std::array<std::array<ChildBits, 8>, 8> childrenTowards() {
    std::array<std::array<ChildBits, 8>, 8> result{};
    for (unsigned axes = 0; axes < 8; ++axes)
        for (unsigned corner = 0; corner < 8; ++corner)
            for (unsigned c = 0; c < 8; ++c)
                if (((c ^ corner) & axes) == 0)
                    result[axes][corner] = ChildBits(result[axes][corner] | 1u << c);
    return result;
}
const std::array<std::array<ChildBits, 8>, 8> kChildrenTowards = childrenTowards();

// The parents of a brick's neighbours and of itself are eight bricks, a block of 2^3; the one that is least
// on all axes.
Vec3i nearParentsLow(const Vec3i& index) {
    return {(index.x - 1) >> 1, (index.y - 1) >> 1, (index.z - 1) >> 1};
}

// Closed boxes of bricks of any depths share a point. `fine` isn't above `coarse`.
bool touch(const DepthKey& fine, const DepthKey& coarse) {
    const int shift = fine.depth - coarse.depth;
    for (int a = 0; a < 3; ++a) {
        const std::int64_t low = std::int64_t(coarse.index[a]) << shift;
        const std::int64_t high = (std::int64_t(coarse.index[a]) + 1) << shift;
        if (fine.index[a] + std::int64_t(1) < low || fine.index[a] > high) return false;
    }
    return true;
}

}  // namespace

GrowingTree::GrowingTree(std::span<const Vec3i> roots)
    : roots_(roots), rootIndices_(roots.begin(), roots.end()) {
    for (const Vec3i& index : roots) {
        Entry& entry = roots_.slot(index);
        TESSERA_CHECK(entry.isAbsent(), "two roots of a tree are the same brick");
        entry = Entry::leaf(takeSlot());
        count(Depth(0), 1);
    }
}

Depth GrowingTree::deepest() const {
    for (std::size_t d = leavesOfDepth_.size(); d > 0; --d)
        if (leavesOfDepth_[d - 1] > 0) return Depth(int(d) - 1);
    return Depth(0);
}

GrowingTree::Found GrowingTree::find(const DepthKey& key) const {
    if (key.depth < Depth(0)) return {};
    Found found{roots_.at(ancestorKey(key, Depth(0)).index), Depth(0)};
    while (found.entry.isSplit() && found.depth < key.depth) {
        found.depth = found.depth + 1;
        found.entry = nodes_[found.entry.node()].children[childNumber(ancestorKey(key, found.depth).index)];
    }
    return found;
}

// What stands at the eight bricks from nearParentsLow(), bit a of the position choosing the upper on axis a.
// The way down is walked once for all, as far as they have their ancestors in common.
std::array<GrowingTree::Found, 8> GrowingTree::nearParents(const DepthKey& key) const {
    const Depth last = key.depth - 1;
    const DepthKey low{last, nearParentsLow(key.index)}, high{last, low.index + 1};
    // Of each depth the ancestors are a block too, of one or two bricks along an axis.
    const auto first = [&](Depth depth) { return ancestorKey(low, depth).index; };
    const auto axesOfTwo = [&](Depth depth) {
        return childNumber(ancestorKey(high, depth).index - first(depth));
    };
    std::array<Found, 8> block;
    // Down to the last ancestor that all have in common there is one way.
    const Vec3i differ = low.index ^ high.index;
    const int apart = std::bit_width(std::uint32_t(differ.x | differ.y | differ.z));
    Depth depth{0};
    if (apart <= last.halvings()) {
        depth = last - apart;
        block[0] = find({depth, first(depth)});
        if (!block[0].entry.isSplit()) {
            block.fill(block[0]);
            return block;
        }
    } else {
        const unsigned rootAxes = axesOfTwo(Depth(0));
        for (unsigned n = 0; n < 8; ++n)
            if ((n & ~rootAxes) == 0) block[n] = {roots_.at(first(Depth(0)) + childOffset(n)), Depth(0)};
    }
    while (depth < last) {
        depth = depth + 1;
        const unsigned child = childNumber(first(depth)), axes = axesOfTwo(depth);
        // An upper brick has another parent than the lower one where that is its parent's upper child. The
        // last comes first, as bricks take the place of what they come from.
        for (unsigned n = 8; n-- > 0;) {
            if (n & ~axes) continue;
            const Found& from = block[n & child];
            block[n] =
                from.entry.isSplit() ? Found{nodes_[from.entry.node()].children[child ^ n], depth} : from;
        }
    }
    return block;
}

// What stands at the brick and at its neighbours.
std::array<GrowingTree::Found, 27> GrowingTree::around(const DepthKey& key) const {
    std::array<Found, 27> result;
    std::array<Found, 8> parents;
    if (key.depth > Depth(0)) parents = nearParents(key);
    const Vec3i low = nearParentsLow(key.index);
    for (unsigned n = 0; n < 27; ++n) {
        const Vec3i index = key.index + neighbourOffset(n);
        if (key.depth == Depth(0)) {
            result[n].entry = roots_.at(index);
            continue;
        }
        unsigned axes = 0;
        for (int a = 0; a < 3; ++a) axes |= unsigned((index[a] >> 1) - low[a]) << a;
        result[n] = parents[axes];
        if (result[n].entry.isSplit())
            result[n] = {nodes_[result[n].entry.node()].children[childNumber(index)], key.depth};
    }
    return result;
}

// Of a brick whose parent, if it has one, is split.
GrowingTree::Entry& GrowingTree::entryOf(const DepthKey& key) {
    Entry* entry = &roots_.slot(ancestorKey(key, Depth(0)).index);
    for (Depth depth = Depth(1); depth <= key.depth; depth = depth + 1)
        entry = &nodes_[entry->node()].children[childNumber(ancestorKey(key, depth).index)];
    return *entry;
}

// Calls visit(leaf) for every leaf in a brick until one call returns true, and returns whether one did.
template <class Visit>
bool GrowingTree::visitLeaves(Entry entry, const DepthKey& at, Visit&& visit) const {
    if (entry.isLeaf()) return visit(GrowingLeaf{at, entry.slot()});
    if (entry.isSplit())
        for (unsigned c = 0; c < 8; ++c)
            if (visitLeaves(nodes_[entry.node()].children[c], childKey(at, c), visit)) return true;
    return false;
}

// Likewise, for the leaves that touch `brick`; `at` isn't above it.
template <class Visit>
bool GrowingTree::visitTouching(Entry entry, const DepthKey& at, const DepthKey& brick, Visit&& visit) const {
    if (entry.isAbsent() || !touch(at, brick)) return false;
    if (entry.isLeaf()) return visit(GrowingLeaf{at, entry.slot()});
    for (unsigned c = 0; c < 8; ++c)
        if (visitTouching(nodes_[entry.node()].children[c], childKey(at, c), brick, visit)) return true;
    return false;
}

bool GrowingTree::holdsLeaf(Entry entry) const {
    return visitLeaves(entry, {}, [](const GrowingLeaf&) { return true; });
}

std::vector<GrowingLeaf> GrowingTree::leaves() const {
    std::vector<GrowingLeaf> result;
    result.reserve(leafCount_);
    for (const Vec3i& root : rootIndices_)
        visitLeaves(roots_.at(root), {Depth(0), root}, [&](const GrowingLeaf& leaf) {
            result.push_back(leaf);
            return false;
        });
    std::sort(result.begin(), result.end(),
              [](const GrowingLeaf& a, const GrowingLeaf& b) { return inStorageOrder(a.key, b.key); });
    return result;
}

std::optional<GrowingLeaf> GrowingTree::findLeaf(const DepthKey& key) const {
    const Found found = find(key);
    if (!found.entry.isLeaf() || found.depth != key.depth) return {};
    return GrowingLeaf{key, found.entry.slot()};
}

// The same, with nearParents() of the brick where it has a parent: in a large tree all these are far from the
// processor, and are fetched at once.
std::optional<GrowingLeaf> GrowingTree::findLeaf(const DepthKey& key, std::array<Found, 8>& parents) const {
    if (key.depth <= Depth(0)) return findLeaf(key);
    parents = nearParents(key);
    const unsigned child = childNumber(key.index);
    const Entry own = parents[child ^ 7].entry;
    if (!own.isSplit()) return {};
    const Entry entry = nodes_[own.node()].children[child];
    if (!entry.isLeaf()) return {};
    return GrowingLeaf{key, entry.slot()};
}

std::optional<GrowingLeaf> GrowingTree::findCovering(const DepthKey& key) const {
    const Found found = find(key);
    if (!found.entry.isLeaf()) return {};
    return GrowingLeaf{ancestorKey(key, found.depth), found.entry.slot()};
}

bool GrowingTree::isSplit(const DepthKey& key) const {
    return find(key).entry.isSplit();
}

void GrowingTree::findNeighbours(const DepthKey& key, std::vector<GrowingLeaf>& found) const {
    const std::size_t before = found.size();
    const std::array<Found, 27> near = around(key);
    for (unsigned n = 0; n < 27; ++n) {
        if (n == kItself) continue;
        const DepthKey at{key.depth, key.index + neighbourOffset(n)};
        if (near[n].entry.isSplit()) {
            visitTouching(near[n].entry, at, key, [&](const GrowingLeaf& leaf) {
                found.push_back(leaf);
                return false;
            });
        } else if (near[n].entry.isLeaf()) {
            // A coarser leaf can lie at several of the neighbours, and around the brick itself.
            const GrowingLeaf leaf{ancestorKey(at, near[n].depth), near[n].entry.slot()};
            if (leaf.key != ancestorKey(key, near[n].depth) &&
                std::find(found.begin() + std::ptrdiff_t(before), found.end(), leaf) == found.end())
                found.push_back(leaf);
        }
    }
}

std::uint32_t GrowingTree::takeSlot() {
    if (freeSlots_.empty()) {
        TESSERA_CHECK(slotCount_ < std::size_t(1) << 30, "a tree has too many bricks");
        return std::uint32_t(slotCount_++);
    }
    const std::uint32_t slot = freeSlots_.back();
    freeSlots_.pop_back();
    return slot;
}

// Leaves more or fewer of a depth.
void GrowingTree::count(Depth depth, int leaves) {
    const auto d = std::size_t(depth.halvings());
    if (d >= leavesOfDepth_.size()) leavesOfDepth_.resize(d + 1);
    leavesOfDepth_[d] += std::size_t(leaves);
    leafCount_ += std::size_t(leaves);
}

void GrowingTree::freeNodes(Entry entry) {
    if (!entry.isSplit()) return;
    for (const Entry child : nodes_[entry.node()].children) freeNodes(child);
    nodes_[entry.node()] = {};
    freeNodes_.push_back(entry.node());
}

void GrowingTree::splitOne(const GrowingLeaf& leaf, ChildBits children) {
    TESSERA_CHECK(leaf.key.depth < kDeepest, "a brick is too deep to be split");
    if (freeNodes_.empty()) {
        freeNodes_.push_back(std::uint32_t(nodes_.size()));
        nodes_.emplace_back();
    }
    Entry& entry = entryOf(leaf.key);
    TESSERA_CHECK(entry.isLeaf() && entry.slot() == leaf.slot, "a brick is split twice");
    const std::uint32_t node = freeNodes_.back();
    freeNodes_.pop_back();
    entry = Entry::split(node);
    change_.removed.push_back(leaf);
    count(leaf.key.depth, -1);
    for (unsigned c = 0; c < 8; ++c) {
        if (!((children >> c) & 1)) continue;
        const std::uint32_t slot = takeSlot();
        count(leaf.key.depth + 1, 1);
        nodes_[node].children[c] = Entry::leaf(slot);
        change_.added.push_back({childKey(leaf.key, c), slot});
    }
}

// Replaces the wave that was just split by the leaves that are now more than one depth above a leaf that they
// touch. As the tree was balanced before, these are leaves that touch a child just made, and none of them was
// made by the same call of split(). Of a wave of one brick nearParents() may be known.
void GrowingTree::findUnbalanced(const std::array<Found, 8>* parentsOfOnly) {
    const std::size_t count = wave_.size();
    for (std::size_t i = 0; i < count; ++i) {
        const DepthKey key = wave_[i].key;
        if (key.depth == Depth(0)) continue;
        const std::array<Found, 8> parents = parentsOfOnly ? *parentsOfOnly : nearParents(key);
        const unsigned own = childNumber(key.index) ^ 7;
        for (unsigned n = 0; n < 8; ++n) {
            // A parent touches the children that lie on its side.
            if (!parents[n].entry.isLeaf() || !(waveChildren_[i] & kChildrenTowards[n ^ own][n])) continue;
            const DepthKey parent{key.depth - 1, nearParentsLow(key.index) + childOffset(n)};
            wave_.push_back({ancestorKey(parent, parents[n].depth), parents[n].entry.slot()});
        }
    }
    wave_.erase(wave_.begin(), wave_.begin() + std::ptrdiff_t(count));
    std::sort(wave_.begin(), wave_.end(),
              [](const GrowingLeaf& a, const GrowingLeaf& b) { return inStorageOrder(a.key, b.key); });
    wave_.erase(std::unique(wave_.begin(), wave_.end()), wave_.end());
}

void GrowingTree::undoSplits() {
    for (std::size_t i = change_.removed.size(); i > 0; --i) {
        const GrowingLeaf& leaf = change_.removed[i - 1];
        Entry& entry = entryOf(leaf.key);
        freeNodes(entry);
        entry = Entry::leaf(leaf.slot);
        count(leaf.key.depth, 1);
    }
    for (std::size_t i = change_.added.size(); i > 0; --i) {
        count(change_.added[i - 1].key.depth, -1);
        freeSlots_.push_back(change_.added[i - 1].slot);
    }
    change_.removed.clear();
    change_.added.clear();
}

// Slots are free for the next change, not for this one.
void GrowingTree::endChange() {
    for (const GrowingLeaf& leaf : change_.removed) freeSlots_.push_back(leaf.slot);
}

bool GrowingTree::split(std::span<const DepthKey> keys, std::size_t maxLeaves, const ChooseChildren& choose) {
    change_.removed.clear();
    change_.added.clear();
    wave_.clear();
    std::array<Found, 8> parents;
    for (const DepthKey& key : keys) {
        const std::optional<GrowingLeaf> leaf = findLeaf(key, parents);
        TESSERA_CHECK(leaf, "only a leaf is split");
        wave_.push_back(*leaf);
    }
    const std::array<Found, 8>* parentsOfOnly = keys.size() == 1 ? &parents : nullptr;
    try {
        while (!wave_.empty()) {
            waveChildren_.assign(wave_.size(), 0);
            choose(wave_, waveChildren_);
            for (std::size_t i = 0; i < wave_.size(); ++i) splitOne(wave_[i], waveChildren_[i]);
            if (leafCount_ > maxLeaves) {
                undoSplits();
                return false;
            }
            findUnbalanced(std::exchange(parentsOfOnly, nullptr));
        }
    } catch (...) {
        undoSplits();
        throw;
    }
    endChange();
    return true;
}

bool GrowingTree::canMerge(const DepthKey& parent) const {
    const std::array<Found, 27> near = around(parent);
    const Found& own = near[kItself];
    if (!own.entry.isSplit() || own.depth != parent.depth) return false;
    for (const Entry child : nodes_[own.entry.node()].children)
        if (child.isSplit() && holdsLeaf(child)) return false;
    for (unsigned n = 0; n < 27; ++n) {
        if (n == kItself) continue;
        if (near[n].entry.isLeaf() && parent.depth - near[n].depth > 1) return false;
        if (!near[n].entry.isSplit()) continue;
        const DepthKey at{parent.depth, parent.index + neighbourOffset(n)};
        const auto& children = nodes_[near[n].entry.node()].children;
        for (unsigned c = 0; c < 8; ++c)
            if (((kChildrenTouchingBrick[n] >> c) & 1) && children[c].isSplit() &&
                visitTouching(children[c], childKey(at, c), parent, [](const GrowingLeaf&) { return true; }))
                return false;
    }
    return true;
}

bool GrowingTree::merge(const DepthKey& parent) {
    change_.removed.clear();
    change_.added.clear();
    if (!canMerge(parent)) return false;
    Entry& entry = entryOf(parent);
    for (unsigned c = 0; c < 8; ++c) {
        const Entry child = nodes_[entry.node()].children[c];
        if (!child.isLeaf()) continue;
        change_.removed.push_back({childKey(parent, c), child.slot()});
        count(parent.depth + 1, -1);
    }
    freeNodes(entry);
    entry = Entry::leaf(takeSlot());
    count(parent.depth, 1);
    change_.added.push_back({parent, entry.slot()});
    endChange();
    return true;
}

BrickTree GrowingTree::brickTree(const Vec3d& originWorld, double rootSpacingWorld, int brickCells,
                                 Depth finest) const {
    std::vector<BrickKey> keys;
    keys.reserve(leafCount_);
    for (const Vec3i& root : rootIndices_)
        visitLeaves(roots_.at(root), {Depth(0), root}, [&](const GrowingLeaf& leaf) {
            keys.push_back({levelOf(leaf.key.depth, finest), leaf.key.index});
            return false;
        });
    return BrickTree(originWorld, std::ldexp(rootSpacingWorld, -finest.halvings()), brickCells,
                     std::move(keys));
}

}  // namespace tessera
