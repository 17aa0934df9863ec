#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "tessera/lattice.h"

namespace tessera {

/// Floor of a number whose floor fits an int, without the library call that std::floor is on older
/// processors.
inline int floorToInt(double v) {
    const int truncated = int(v);
    return truncated - (v < double(truncated) ? 1 : 0);
}

/// A brick of brickCells^3 cells of one level. It owns the lattice points [index * B, index * B + B) of that
/// level (half-open); its closed box has B + 1 points along each axis. Level 0 is the finest; level l + 1 has
/// every second lattice point of level l, so brick (l, b) is the union of the eight bricks (l - 1, 2 b + {0,
/// 1}).
struct BrickKey {
    int level = 0;
    Vec3i index{0};
    friend bool operator==(const BrickKey&, const BrickKey&) = default;
};

/// Ascending by level, z, y, x.
inline bool inStorageOrder(const BrickKey& a, const BrickKey& b) {
    return std::tie(a.level, a.index.z, a.index.y, a.index.x) <
           std::tie(b.level, b.index.z, b.index.y, b.index.x);
}

struct BrickKeyHash {
    std::size_t operator()(const BrickKey& key) const;
};

/// The leaf bricks over a mesh: disjoint, and any two whose closed boxes touch (26 neighbours) differ by at
/// most one level. Space that no element touches has no brick.
class BrickTree {
  public:
    BrickTree() = default;
    /// @param spacingWorld h_0, the spacing of level 0. @param leaves in any order; stored ascending by
    /// level, z, y, x. Throws InternalError when leaves overlap.
    BrickTree(const Vec3d& originWorld, double spacingWorld, int brickCells, std::vector<BrickKey> leaves);

    const Vec3d& originWorld() const { return origin_; }
    double spacingWorld(int level = 0) const;
    int brickCells() const { return brickCells_; }
    /// 1 + the coarsest level present; 0 for an empty tree.
    int levelCount() const { return levelCount_; }
    std::span<const BrickKey> leaves() const { return leaves_; }
    std::size_t leafCount() const { return leaves_.size(); }

    Lattice lattice(int level) const;
    IndexBox ownedPoints(const BrickKey& key) const;
    IndexBox closedPoints(const BrickKey& key) const;

    /// Position of exactly this key among the leaves, or -1.
    std::int64_t findLeaf(const BrickKey& key) const;
    /// The leaf that is `key` or contains it (a coarser one), or -1.
    std::int64_t findCovering(const BrickKey& key) const;
    /// True when `key` itself isn't a leaf but leaves lie inside it.
    bool isRefined(const BrickKey& key) const;
    /// The leaf whose half-open box of cells contains the place, given in index space of level 0, or -1.
    std::int64_t findLeafAt(const Vec3d& index0) const {
        constexpr double kLimit = Walk::kLimit;
        if (!(std::abs(index0.x) < kLimit && std::abs(index0.y) < kLimit && std::abs(index0.z) < kLimit))
            return -1;
        const Vec3i p{floorToInt(index0.x), floorToInt(index0.y), floorToInt(index0.z)};
        return findLeafBy([&](int shift) { return p >> std::min(shift, 31); });
    }
    /// What findLeafAt reads, for many places at once: entries of root bricks x first, then y, and eight
    /// children of each inner brick. An entry is a leaf, kAbsent, or kFirstInner minus an inner brick's
    /// position.
    struct Walk {
        static constexpr std::int32_t kAbsent = -1, kFirstInner = -2;
        static constexpr double kLimit = 2147483647.0;  ///< no leaf holds a place as far away
        const std::int32_t* roots = nullptr;            ///< null where they aren't laid out as a grid
        const std::int32_t* children = nullptr;
        Vec3i rootMin{0}, rootSize{0};
        int rootShift = 0;  ///< from a point of level 0 to its root brick
    };
    Walk walk() const;
    /// Appends the leaves whose half-open boxes of cells meet a closed box given in index space of level 0.
    void findLeavesIn(const Box3d& index0, std::vector<std::size_t>& leaves) const;
    /// The leaf, of any level, whose half-open box contains lattice point `p` of `level`, or -1.
    std::int64_t findLeafAt(int level, const Vec3i& p) const;

  private:
    // Children of an inner brick, child (x & 1) | (y & 1) << 1 | (z & 1) << 2. An entry is a leaf's position,
    // kAbsent, or an inner brick coded as innerEntry(position in inner_).
    using Children = std::array<std::int32_t, 8>;
    static constexpr std::int32_t kAbsent = Walk::kAbsent;
    static constexpr std::int32_t innerEntry(std::size_t position) {
        return Walk::kFirstInner - std::int32_t(position);
    }
    static constexpr std::size_t innerPosition(std::int32_t entry) {
        return std::size_t(Walk::kFirstInner - entry);
    }
    int rootShift() const { return std::countr_zero(unsigned(brickCells_)) + levelCount_ - 1; }

    void findIn(std::int32_t entry, int level, const Vec3i& index, const Box3d& index0,
                std::vector<std::size_t>& leaves) const;
    void layOutRoots();
    void insert(std::int32_t leaf);
    std::int32_t rootEntry(const Vec3i& index) const {
        if (denseRoots_.empty()) return sparseRootEntry(index);
        // Unsigned comparison rejects what lies below the grid too.
        const std::uint32_t x = std::uint32_t(index.x) - std::uint32_t(rootMin_.x);
        const std::uint32_t y = std::uint32_t(index.y) - std::uint32_t(rootMin_.y);
        const std::uint32_t z = std::uint32_t(index.z) - std::uint32_t(rootMin_.z);
        if (x >= std::uint32_t(rootSize_.x) || y >= std::uint32_t(rootSize_.y) ||
            z >= std::uint32_t(rootSize_.z))
            return kAbsent;
        return denseRoots_[(std::size_t(z) * std::size_t(rootSize_.y) + y) * std::size_t(rootSize_.x) + x];
    }
    std::int32_t sparseRootEntry(const Vec3i& index) const;
    static std::size_t childOf(const Vec3i& index) {
        return std::size_t((index.x & 1) | (index.y & 1) << 1 | (index.z & 1) << 2);
    }
    /// @param shifted a point of level 0, its coordinates shifted to the right by so many bits.
    template <class Shifted>
    std::int64_t findLeafBy(const Shifted& shifted) const {
        if (levelCount_ == 0) return -1;
        int shift = rootShift();
        std::int32_t entry = rootEntry(shifted(shift));
        while (entry < kAbsent) entry = inner_[innerPosition(entry)][childOf(shifted(--shift))];
        return entry;
    }
    std::int32_t& rootSlot(const Vec3i& index);
    /// The entry at `key`, or the leaf above it; `level` receives the level of what was found.
    std::int32_t descend(const BrickKey& key, int& level) const;

    Vec3d origin_{0};
    double spacing_ = 1;
    int brickCells_ = 16;
    int levelCount_ = 0;
    std::vector<BrickKey> leaves_;
    std::vector<Children> inner_;
    // Bricks of the coarsest level present: a dense grid over their box, or a map when that would be mostly
    // empty.
    Vec3i rootMin_{0};
    Vec3i rootSize_{0};
    std::vector<std::int32_t> denseRoots_;
    std::unordered_map<BrickKey, std::int32_t, BrickKeyHash> sparseRoots_;
};

}  // namespace tessera
