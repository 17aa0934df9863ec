#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "brick/brick_tree.h"
#include "brick/growing_tree.h"
#include "refine/brick_findings.h"
#include "refine/mesh_bricks.h"
#include "refine/split_queue.h"
#include "refine/visible_values.h"
#include "tessera/focus.h"

namespace tessera {

/// What bricks are to be refined by; the sizes of elements besides, where MeshBricks has them. The finest of
/// all wishes counts.
struct Wishes {
    std::vector<Focus> focus;
    /// h_0, world units.
    double finestSpacingWorld = 0;
    /// By the errors that the inspector finds, until they are within its bound.
    bool byError = false;
    /// Needed for errors and for what is seen.
    std::shared_ptr<const BrickInspector> inspector = nullptr;
    /// Not null: only where what the inspector's channel shows can be seen. A brick whose
    /// elements have no value that is seen wishes nothing, by whatever criterion; of errors those count that
    /// change a colour.
    std::shared_ptr<const VisibleValues> visible = nullptr;
};

/// How many bricks a plan may have.
struct PlanLimit {
    enum class Counts {
        leaves,
        /// Leaves and the bricks above them, which a program keeps to go back to.
        all
    };
    Counts counts = Counts::leaves;
    std::size_t bricks = GrowingTree::kNoLimit;
};

/// Makes a plan split by split, the best first: that with the greatest benefit for its cost. Benefit is how
/// many points are wished for each that there is, 64 times as much in bricks that hold a focus; cost are the
/// elements near the brick and the points of its children, with fixed weights. So the plan depends on the
/// mesh, the wishes and the limit alone. It ends when no leaf wishes to be split, or with the first split
/// that the limit doesn't allow. Without a limit its leaves are the coarsest balanced ones that fulfil the
/// wishes: closed boxes that touch differ by at most one depth.
class WishPlan {
  public:
    /// One brick of the plan and its children. The plan is balanced after each; those that balance alone asks
    /// for come before the one that needs them.
    struct Split {
        MeshBricks::Number brick = 0;
        ChildBits children = 0;
    };

    /// @param bricks must outlive it. Throws InputError when the roots are more than the limit.
    WishPlan(MeshBricks& bricks, Wishes wishes, const PlanLimit& limit);

    /// Null when the plan is complete, or waits.
    std::optional<Split> next();
    /// The plan goes on when there are findings of these leaves (MeshBricks::setFindings).
    std::span<const MeshBricks::Number> waitsFor() const { return waitsFor_; }
    /// All that is left, without errors. Throws Cancelled.
    void complete(const Execution& execution = {});

    // What next() has given so far, and perhaps a few splits more.
    bool isSplit(MeshBricks::Number brick) const { return stateOf(brick) == State::split; }
    std::size_t leafCount() const { return leafCount_; }
    /// Ascending by depth, z, y, x.
    std::vector<MeshBricks::Number> leaves() const;
    /// Of the finest leaf; 0 without any.
    Depth deepest() const;
    /// The leaves as a tree for sampling and files. Depth `finest`, the deepest or below, becomes level 0.
    BrickTree brickTree(Depth finest) const;

    const Wishes& wishes() const { return wishes_; }
    /// Some leaf wishes to be split, and the limit doesn't allow it.
    bool isCutShort() const { return isCutShort_; }
    /// The coarsest spacing that fulfils all wishes in a brick, world units; kNoWish without any. A focus is
    /// content with sqrt(2) times what it wishes for: bricks take the nearest of the spacings, which are
    /// powers of two apart. Errors count where there are findings.
    double wishedSpacing(MeshBricks::Number brick) const;
    /// The largest error found in a brick that counts, over its bound; 0 where nothing is seen, and without
    /// findings.
    double errorOverBound(MeshBricks::Number brick) const;
    /// Benefit for cost of splitting a brick, whether it is a leaf or not; 0 where none is wished.
    double valueOfSplit(MeshBricks::Number brick) const;

  private:
    enum class State : std::uint8_t { absent, leaf, split };

    State stateOf(MeshBricks::Number brick) const {
        return brick < states_.size() ? states_[brick] : State::absent;
    }
    double wishedWithoutErrors(MeshBricks::Number brick) const;
    double wishedWithoutErrors(MeshBricks::Number brick, double byFocus) const;
    double wishedByError(MeshBricks::Number brick) const;
    double costOfSplit(MeshBricks::Number brick) const;
    double valueOfError(MeshBricks::Number brick) const;
    bool isSeen(MeshBricks::Number brick) const;
    /// Of a leaf that may be split.
    void consider(MeshBricks::Number brick, double spacingWorld, double byFocus, bool holdsFocus);
    bool considerErrors();
    std::optional<MeshBricks::Number> popCandidate();
    void require(MeshBricks::Number brick);
    bool split(MeshBricks::Number brick);

    MeshBricks& bricks_;
    Wishes wishes_;
    PlanLimit limit_;
    std::vector<State> states_;  ///< by number; what lies beyond the end is absent
    std::size_t leafCount_ = 0, splitCount_ = 0;
    SplitQueue candidates_;
    SplitQueue byError_;                                   ///< leaves that have findings
    std::vector<MeshBricks::Number> unjudged_, waitsFor_;  ///< leaves whose errors weren't looked at
    int leftInRound_ = 0;
    std::vector<Split> made_;  ///< by the last split() and given out one by one
    std::size_t given_ = 0;
    bool isCutShort_ = false;
};

}  // namespace tessera
