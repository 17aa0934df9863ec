#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "brick/depth.h"
#include "brick/growing_tree.h"
#include "brick/root_grid.h"
#include "mesh/element_index.h"
#include "refine/brick_findings.h"
#include "refine/brick_plan.h"
#include "refine/steady_vector.h"
#include "refine/visible_values.h"
#include "refine/wishes.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// What a mesh holds in the bricks of a frame, found out brick by brick as it is asked for and then kept:
/// which bricks there are, how many elements lie near one, and how small they are. Bricks are the ones that
/// BrickPlan would make, by the element index instead of lists, so a brick costs microseconds.
class MeshBricks {
  public:
    /// A brick's number; children are found by those of their parent.
    using Number = std::uint32_t;

    /// Passes over the mesh where the index isn't built yet, which is then built when a brick of depth 0 is
    /// looked into, and with `samplesPerElement` for the sizes of its elements. The index and its mesh must
    /// outlive it. @param samplesPerElement what RefineOptions::samplesPerElement says; 0: element sizes
    /// aren't wanted.
    MeshBricks(std::shared_ptr<const SharedElementIndex> index, const PlanFrame& frame,
               double samplesPerElement, const Execution& execution);

    const PlanFrame& frame() const { return frame_; }
    /// Bricks of depth 0, ascending by z, y, x: numbers 0, 1, ...
    std::span<const Vec3i> roots() const { return roots_; }
    /// A brick that was looked at, as all the leaves of a plan were.
    std::optional<Number> find(const DepthKey& key) const;
    const DepthKey& key(Number brick) const { return bricks_[brick].key; }
    /// Numbers are below it; it grows as bricks are looked at.
    std::size_t count() const { return bricks_.size(); }
    /// The closed box of the brick, within the mesh's bounds and those of the frame; world units.
    Box3d boxWorld(Number brick) const { return boxWorld(key(brick)); }
    /// The same of all eight children, whether they are there or not.
    ChildBoxes childBoxesWorld(Number brick) const;
    double spacingWorld(Number brick) const { return spacings_[std::size_t(key(brick).depth.halvings())]; }

    /// Which children there are.
    ChildBits children(Number brick);
    /// One of the children that there are.
    Number child(Number brick, unsigned child) const { return bricks_[brick].firstChild + child; }

    /// The bricks one depth above that touch the brick from outside its parent: balance wants them split
    /// before the brick is. In an order that depends on the brick alone.
    std::span<const Number> nearParents(Number brick);

    /// About how many elements lie near the brick.
    std::int64_t elementsNear(Number brick);
    /// The spacing that the sizes of the brick's elements ask for: all but a small share of them have
    /// samplesPerElement lattice points along their edges. World units; kNoWish when sizes aren't wanted.
    double wishedByElementSize(Number brick);

    /// What the brick's samples show, once somebody has told; null before.
    const BrickFindings* findings(Number brick) const { return bricks_[brick].findings.get(); }
    void setFindings(Number brick, BrickFindings findings);
    /// Values of the inspector's channel that the elements near the brick have: coarse samples would miss
    /// thin features. @param inspector the same in every call.
    const ValueMask& values(Number brick, const BrickInspector& inspector);

  private:
    static constexpr std::int32_t kNoElement = -1;
    struct NearParents {
        std::array<Number, 7> numbers;
        unsigned count = 0;
    };
    /// In a cache line of its own.
    struct alignas(64) Brick {
        DepthKey key;
        Number firstChild = 0;   ///< 0: not looked for yet
        Number nearParents = 0;  ///< likewise; one more than the place in nearParents_
        ChildBits children = 0;
        std::int32_t shownBy = kNoElement;  ///< an element that touches it
        std::int32_t elementsNear = -1;     ///< -1: not counted yet
        float wishedByElementSize = -1;     ///< -1: not looked for yet
        std::unique_ptr<const BrickFindings> findings;
        std::unique_ptr<const ValueMask> values;
    };

    const ElementIndex& index() const { return shared_->get(); }
    void findRoots(const Execution& execution);
    /// An element that touches each of the bricks of depth 0 that may be; kNoElement without one.
    std::vector<std::int32_t> rootsShown(const ElementIndex& index) const;
    std::vector<std::int32_t> rootsShown(const Execution& execution) const;
    void findChildren(Number brick);
    std::optional<Number> look(const DepthKey& key);
    Box3d boxWorld(const DepthKey& key) const;

    std::shared_ptr<const SharedElementIndex> shared_;
    const TetMesh& mesh_;
    PlanFrame frame_;
    std::vector<double> spacings_;  ///< by depth, world units
    BrickRange rootRange_;
    double samplesPerElement_;
    std::vector<float> sizes_;  ///< in units of the root spacing
    std::vector<Vec3i> roots_;
    RootGrid<Number> rootNumbers_;  ///< one more than the root's number; 0: no root
    SteadyVector<Brick> bricks_;    ///< the roots, then eight places for the children of each brick looked at
    SteadyVector<NearParents> nearParents_;
    std::vector<std::int32_t> found_;
    std::vector<float> foundSizes_;
};

}  // namespace tessera
