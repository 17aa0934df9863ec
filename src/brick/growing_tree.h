#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "brick/brick_tree.h"
#include "brick/depth.h"
#include "brick/root_grid.h"

namespace tessera {

/// Which children of a brick there are: bit childNumber() of each.
using ChildBits = std::uint8_t;
inline constexpr ChildBits kAllChildren = 0xff;

/// A leaf of a growing tree. The slot is a small number that the leaf keeps as long as it stands: its place
/// in arrays beside the tree. A later leaf may get the slot of one that is gone.
struct GrowingLeaf {
    DepthKey key;
    std::uint32_t slot = 0;
    friend bool operator==(const GrowingLeaf&, const GrowingLeaf&) = default;
};

/// What one split or merge did. No leaf is in both lists, as no brick is made and split again by one call,
/// nor is a slot: what a caller keeps of the removed leaves is still there when the added ones get theirs.
struct TreeChange {
    std::vector<GrowingLeaf> removed;
    std::vector<GrowingLeaf> added;
};

/// Leaf bricks that are split into their children and merged again in place. Any two whose closed boxes touch
/// (26 neighbours) differ by at most one depth. A change costs what it changes, however many bricks there
/// are, but for the processor's caches and for arrays that grow.
class GrowingTree {
  public:
    /// Says which children of each of `bricks` there are, for all that are split at once; all bits are 0
    /// before. A brick may have none: then it just vanishes. change() tells what was done before in the same
    /// call of split(), bricks in this order and children ascending within each.
    using ChooseChildren =
        std::function<void(std::span<const GrowingLeaf> bricks, std::span<ChildBits> children)>;
    static constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();
    static constexpr Depth kDeepest{30};

    GrowingTree() = default;
    /// Leaves of depth 0, with the slots 0, 1, ... in this order. Throws InternalError when one comes twice.
    explicit GrowingTree(std::span<const Vec3i> roots);

    std::size_t leafCount() const { return leafCount_; }
    /// Every slot is below it; it never falls.
    std::size_t slotCount() const { return slotCount_; }
    /// Depth of the finest leaf; 0 for an empty tree.
    Depth deepest() const;
    /// Ascending by depth, z, y, x. Takes time for every leaf.
    std::vector<GrowingLeaf> leaves() const;

    /// Exactly this brick, when it is a leaf.
    std::optional<GrowingLeaf> findLeaf(const DepthKey& key) const;
    /// The leaf that is the brick or contains it.
    std::optional<GrowingLeaf> findCovering(const DepthKey& key) const;
    /// The brick was split and is no leaf now.
    bool isSplit(const DepthKey& key) const;
    /// Appends the leaves that touch a brick from outside it, none twice.
    void findNeighbours(const DepthKey& key, std::vector<GrowingLeaf>& found) const;

    /// Splits these leaves, and coarser neighbours until the tree is balanced again. When more than maxLeaves
    /// would stand, or `choose` throws, leaves all leaves and their slots as they were, and returns false
    /// or throws on. Throws InternalError when a key is no leaf.
    bool split(std::span<const DepthKey> keys, std::size_t maxLeaves, const ChooseChildren& choose);
    void split(const DepthKey& key, const ChooseChildren& choose) { split({&key, 1}, kNoLimit, choose); }

    /// The brick was split, its children are leaves or not there, and with it as a leaf the tree would still
    /// be balanced.
    bool canMerge(const DepthKey& parent) const;
    /// Makes the brick a leaf in place of its children. Changes nothing and returns false when it can't.
    bool merge(const DepthKey& parent);

    /// Of the last split() or merge(); empty when that returned false.
    const TreeChange& change() const { return change_; }

    /// The leaves as a tree for sampling and files. Depth `finest`, the deepest or below, becomes level 0.
    BrickTree brickTree(const Vec3d& originWorld, double rootSpacingWorld, int brickCells,
                        Depth finest) const;

  private:
    /// What stands at a brick: nothing, a leaf with its slot, or a split brick with its place in nodes_.
    class Entry {
      public:
        Entry() = default;
        static Entry leaf(std::uint32_t slot) { return Entry(kLeaf, slot); }
        static Entry split(std::uint32_t node) { return Entry(kSplit, node); }
        bool isAbsent() const { return (bits_ & 3) == kAbsent; }
        bool isLeaf() const { return (bits_ & 3) == kLeaf; }
        bool isSplit() const { return (bits_ & 3) == kSplit; }
        std::uint32_t slot() const { return bits_ >> 2; }
        std::uint32_t node() const { return bits_ >> 2; }

      private:
        enum : std::uint32_t { kAbsent, kLeaf, kSplit };
        Entry(std::uint32_t kind, std::uint32_t place) : bits_(place << 2 | kind) {}
        std::uint32_t bits_ = kAbsent;
    };
    /// One cache line holds two.
    struct alignas(32) Node {
        std::array<Entry, 8> children;
    };
    /// What stands at a brick, or the leaf above it.
    struct Found {
        Entry entry;
        Depth depth;
    };

    Found find(const DepthKey& key) const;
    std::array<Found, 8> nearParents(const DepthKey& key) const;
    std::array<Found, 27> around(const DepthKey& key) const;
    std::optional<GrowingLeaf> findLeaf(const DepthKey& key, std::array<Found, 8>& parents) const;
    Entry& entryOf(const DepthKey& key);
    template <class Visit>
    bool visitLeaves(Entry entry, const DepthKey& at, Visit&& visit) const;
    template <class Visit>
    bool visitTouching(Entry entry, const DepthKey& at, const DepthKey& brick, Visit&& visit) const;
    bool holdsLeaf(Entry entry) const;

    void splitOne(const GrowingLeaf& leaf, ChildBits children);
    void findUnbalanced(const std::array<Found, 8>* parentsOfOnly);
    void undoSplits();
    void endChange();
    std::uint32_t takeSlot();
    void count(Depth depth, int leaves);
    void freeNodes(Entry entry);

    RootGrid<Entry> roots_;
    std::vector<Vec3i> rootIndices_;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> freeNodes_, freeSlots_;
    std::vector<std::size_t> leavesOfDepth_;
    std::size_t leafCount_ = 0, slotCount_ = 0;
    TreeChange change_;
    // Of the running split(): bricks to split at once, and their children.
    std::vector<GrowingLeaf> wave_;
    std::vector<ChildBits> waveChildren_;
};

}  // namespace tessera
