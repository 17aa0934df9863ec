#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <unordered_map>
#include <vector>

#include "base/execution.h"
#include "brick/brick_tree.h"
#include "brick/overlap.h"
#include "mesh/tet_mesh.h"

namespace tessera {

/// Where the nested lattices stand. While a tree grows bricks are counted by depth: spacing rootSpacing /
/// 2^depth, exact in binary, and all lattices share the origin, so whatever depth turns out to be the finest,
/// the levels nest.
struct PlanFrame {
    Vec3d originWorld{0};
    double rootSpacingWorld = 1;
    int maxDepth = 0;  ///< the finest spacing allowed is that of this depth
    int brickCells = 16;
    std::optional<Box3d> boundsWorld;
    Box3d meshBoundsWorld;
    double spacingWorld(int depth) const;
};

/// One leaf of a growing tree. In `key` the level is the depth (0: coarsest).
struct PlannedBrick {
    BrickKey key;
    std::vector<std::int32_t> elements;  ///< that touch the brick, ascending
    std::vector<std::uint32_t> samples;  ///< error-driven: samples inside the brick, ascending
    bool sampled = false;                ///< error-driven: its values are in the store
    std::int64_t storeLeaf = -1;         ///< error-driven: where
    double ratio = 0;                    ///< error-driven: what refinement goes by
};

/// The growing tree: leaves over the elements, split on demand, kept 2:1 balanced.
class BrickPlan {
  public:
    /// Allocates the bricks of depth 0.
    BrickPlan(const TetMesh& mesh, const PlanFrame& frame, const Execution& execution);

    const PlanFrame& frame() const { return frame_; }
    std::size_t leafCount() const { return leafCount_; }
    /// Ascending by depth, z, y, x; valid until the next split().
    std::vector<PlannedBrick*> leaves();
    int deepest() const;

    /// Splits these leaves, and coarser neighbours until the tree is balanced again; children without
    /// elements are dropped. When more than maxLeaves would stand, leaves everything as it was and returns
    /// false.
    bool split(const std::vector<BrickKey>& keys, std::size_t maxLeaves, const Execution& execution);

    /// Level 0 is the deepest depth present, or `finestDepth` when given (>= 0).
    BrickTree tree(int finestDepth = -1) const;

    /// Set by who uses samples: a sample's place relative to the origin, world units.
    std::function<Vec3d(std::uint32_t)> placeOfSample;

  private:
    static constexpr std::int64_t kInner = -1;
    static constexpr std::int64_t kGone = -2;

    void allocateRoots(const Execution& execution);
    std::vector<PlannedBrick> children(const PlannedBrick& brick) const;
    void splitSamples(const PlannedBrick& brick, std::vector<PlannedBrick>& made) const;
    void replace(const BrickKey& key, std::vector<PlannedBrick> made);
    std::vector<BrickKey> unbalanced(const std::vector<BrickKey>& fresh) const;
    void undo();

    const TetMesh* mesh_;
    PlanFrame frame_;
    std::vector<PlannedBrick> bricks_;  // leaves, and slots of bricks that were split
    std::unordered_map<BrickKey, std::int64_t, BrickKeyHash> at_;  // position in bricks_, or kInner
    std::size_t leafCount_ = 0;
    // What the running split() did, for undo(): slots split, keys made.
    std::vector<std::int64_t> splitSlots_;
    std::size_t slotsBefore_ = 0;
};

/// Box of the half-open brick of `depth`, in index space of that depth, with the slack below.
Box3d brickTouchBox(const BrickKey& key, int brickCells);

/// Nodes of an element in index space of a spacing.
std::array<Vec3d, 4> elementInIndexSpace(const TetMesh& mesh, std::int64_t element, const Vec3d& originWorld,
                                         double spacingWorld);

/// Asks for an element's nodes ahead of their use: elements reach nodes in no order, and waiting for them is
/// most of what a pass over elements costs.
inline void prefetchNodes(const TetMesh& mesh, std::int64_t element) {
    for (const std::int32_t node : mesh.tets[std::size_t(element)])
        __builtin_prefetch(&mesh.points[std::size_t(node)]);
}
inline constexpr std::int64_t kPrefetchElements = 16;  ///< how far ahead

/// Number of bricks of depth frame.maxDepth that elements touch (and their keys, level 0, when `keys` isn't
/// null and there are at most `limit`); -1 when the box of bricks is too large for a dense grid of marks. For
/// single-level trees: no element lists.
std::int64_t touchedBricks(const TetMesh& mesh, const PlanFrame& frame, std::int64_t limit,
                           std::vector<BrickKey>* keys, const Execution& execution);

}  // namespace tessera
