#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "brick/depth.h"
#include "tessera/vec.h"

namespace tessera {

/// An octree from places to numbers of leaves, held as the words that a shader reads, so that a copy of
/// words() in a buffer is the same tree. As a block of GLSL, std430:
///
///     buffer BrickIndex {
///         ivec3 gridMin;    // words 0 to 2: the grid's first cell
///         int lift;         // word 3: its cells are bricks of depth -lift, 2^lift bricks of depth 0 an edge
///         ivec3 gridSize;   // words 4 to 6: its cells along each axis
///         uint firstNode;   // word 7: where the nodes begin in entries[]
///         uint entries[];   // words 8 on
///     };
///
/// entries[(z * gridSize.y + y) * gridSize.x + x] is the grid's cell gridMin + (x, y, z), and
/// entries[firstNode + 8 * n + c] child c of node n: c = x | y << 1 | z << 2, where x, y and z are 1 in the
/// upper half of the brick. An entry is a kind in its two low bits and a number above them:
///
///     0: there is no brick (the whole entry is 0)
///     1: a leaf with the number entry >> 2
///     2: a brick that is split, node entry >> 2
///
/// From a place to its leaf: divide its distance from the lattice's origin by the edge of a brick of depth 0,
/// then by 2^lift; the floor is the cell, the rest in [0, 1) is doubled at each step down, and its floor is
/// the child and its rest the place there. A place on a border belongs to the brick above it.
class BrickIndex {
  public:
    static constexpr std::uint32_t kHeaderWords = 8;
    enum Kind : std::uint32_t { absent, leaf, split };
    /// Numbers of leaves are below it.
    static constexpr std::uint32_t kMostNumbers = 1u << 30;

    struct Found {
        DepthKey key;
        std::uint32_t number;
    };

    BrickIndex();

    /// Makes room for bricks under these roots, indices of depth 0. The grid grows when one lies outside, and
    /// all words change; its cells are larger than roots where most would be empty.
    void cover(std::span<const Vec3i> roots);
    /// Puts a leaf where none stands, nor below; under roots that are covered. Replaces the number of one
    /// that stands already.
    void put(const DepthKey& key, std::uint32_t number);
    /// Takes a leaf away. Throws InternalError when there is none.
    void remove(const DepthKey& key);

    /// The leaf that is the brick or contains it.
    std::optional<Found> findCovering(const DepthKey& key) const;
    /// The leaf of any depth that owns lattice point `p` of a depth: that contains it in its half-open box of
    /// `cells` cells an edge.
    std::optional<Found> findOwner(Depth depth, const Vec3i& p, int cells) const;

    std::span<const std::uint32_t> words() const { return words_; }

    /// Words are told of in runs of so many.
    static constexpr std::uint32_t kRunWords = 64;
    /// The runs in which words changed since the last call, or are new; each once, in any order.
    std::vector<std::uint32_t> takeChangedRuns();

  private:
    static Kind kindOf(std::uint32_t entry) { return Kind(entry & 3); }
    void set(std::size_t word, std::uint32_t value);
    void layOut(std::vector<std::pair<DepthKey, std::uint32_t>> leaves);
    void collect(std::uint32_t entry, const DepthKey& key,
                 std::vector<std::pair<DepthKey, std::uint32_t>>& leaves) const;
    bool holds(const Vec3i& root) const;
    /// The word of the grid's cell above a brick; 0: outside.
    std::size_t cellWord(const DepthKey& key) const;
    std::size_t childWord(std::uint32_t node, unsigned child) const {
        return kHeaderWords + firstNode_ + std::size_t(8) * node + child;
    }
    /// Which child the brick's ancestor of depth `at` + 1 is, `at` counted from depth 0 and down to -lift.
    static unsigned childOn(const DepthKey& key, int at);
    std::uint32_t takeNode();

    std::vector<std::uint32_t> words_;
    Vec3i rootMin_{0}, rootMax_{0};  // roots covered, half-open
    std::size_t rootCount_ = 0;      // of the fullest cover(), to choose the grid by
    Vec3i gridMin_{0}, gridSize_{0};
    int lift_ = 0;
    std::uint32_t firstNode_ = 0;
    std::vector<std::uint32_t> freeNodes_;
    std::vector<bool> isChanged_;  // by run
    std::vector<std::uint32_t> changedRuns_;
};

}  // namespace tessera
