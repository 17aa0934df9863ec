#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "brick/brick_tree.h"
#include "brick/depth.h"
#include "brick/growing_tree.h"
#include "brick/overlap.h"
#include "mesh/element_index.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Where the nested lattices stand. While a tree grows bricks are counted by depth: spacing rootSpacing /
/// 2^depth, exact in binary, and all lattices share the origin, so whatever depth turns out to be the finest,
/// the levels nest.
struct PlanFrame {
    Vec3d originWorld{0};
    double rootSpacingWorld = 1;
    Depth maxDepth;  ///< the finest spacing allowed is that of this depth
    int brickCells = 16;
    std::optional<Box3d> boundsWorld;
    Box3d meshBoundsWorld;
    double spacingWorld(Depth depth) const;
};

/// One leaf of a plan.
struct PlannedBrick {
    DepthKey key;
    std::vector<std::int32_t> elements;  ///< that touch the brick, ascending
    std::vector<std::uint32_t> samples;  ///< error-driven: samples inside the brick, ascending
    bool sampled = false;                ///< error-driven: its values are in the store
    std::int64_t storeLeaf = -1;         ///< error-driven: where
    double ratio = 0;                    ///< error-driven: what refinement goes by
    /// All eight, those without elements too, where a split that didn't fit has found them: the next try,
    /// with fewer bricks, needs them again. Else none.
    std::vector<PlannedBrick> children;
};

/// Bricks min to max, both included.
struct BrickRange {
    Vec3i min, max;
};

/// A growing tree over the elements of a mesh: leaves are split on demand, and children that no element
/// touches are dropped.
class BrickPlan {
  public:
    /// Allocates the bricks of depth 0. @param index of the mesh, or null: where the frame has bounds it
    /// spares a pass over the whole mesh.
    BrickPlan(const TetMesh& mesh, const PlanFrame& frame, const Execution& execution,
              const ElementIndex* index = nullptr);

    const PlanFrame& frame() const { return frame_; }
    std::size_t leafCount() const { return tree_.leafCount(); }
    /// Ascending by depth, z, y, x; valid until the next split() or merge().
    std::vector<PlannedBrick*> leaves();
    Depth deepest() const { return tree_.deepest(); }

    /// Splits these leaves, and coarser neighbours until the tree is balanced again. When more than maxLeaves
    /// would stand, leaves everything as it was and returns false.
    bool split(std::span<const DepthKey> keys, std::size_t maxLeaves, const Execution& execution);

    /// Makes a brick a leaf in place of its children, with the elements that it had before it was split and
    /// its children's samples; false, and nothing changes, where its children are split or the tree would
    /// not be balanced. Costs what lies in the brick.
    bool merge(const DepthKey& parent, const ElementIndex& index);

    /// Depth `finest`, the deepest or below, becomes level 0.
    BrickTree tree(Depth finest) const;

    /// Set by who uses samples: a sample's place relative to the origin, world units.
    std::function<Vec3d(std::uint32_t)> placeOfSample;

  private:
    void allocateRoots(const ElementIndex* index, const Execution& execution);
    std::vector<std::int32_t> elementsOf(const DepthKey& key, const ElementIndex& index) const;
    std::vector<PlannedBrick> children(const PlannedBrick& brick) const;
    void splitSamples(const PlannedBrick& brick, std::vector<PlannedBrick>& made) const;

    const TetMesh* mesh_;
    PlanFrame frame_;
    BrickRange rootRange_;  // that the mesh and the bounds leave
    GrowingTree tree_;
    std::vector<PlannedBrick> bricks_;  // by the slots of tree_; empty ones at free slots
};

/// Box of a half-open brick in index space of its depth, with the slack below.
Box3d brickTouchBox(const Vec3i& index, int brickCells);

/// Number of bricks of depth frame.maxDepth that elements touch (and their keys, level 0, when `keys` isn't
/// null and there are at most `limit`); -1 when the box of bricks is too large for a dense grid of marks. For
/// single-level trees: no element lists.
std::int64_t touchedBricks(const TetMesh& mesh, const PlanFrame& frame, std::int64_t limit,
                           std::vector<BrickKey>* keys, const Execution& execution);

}  // namespace tessera
