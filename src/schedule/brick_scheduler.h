#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "brick/growing_tree.h"
#include "refine/mesh_bricks.h"
#include "refine/refine_options.h"
#include "refine/wish_plan.h"
#include "schedule/brick_memory.h"
#include "schedule/brick_sampling.h"
#include "schedule/brick_target.h"
#include "tessera/execution.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"
#include "tessera/transfer_function.h"

namespace tessera {

/// How a scheduler samples; it keeps this as long as it lives.
struct ScheduleOptions {
    /// Element size, focus, error, or several; lattice, finest spacing and bounds as for planBricks(). The
    /// first focus may be given later.
    RefineOptions refine;
    /// Not given: everything is seen. Else bricks are refined only where what it shows differs.
    std::optional<TransferFunction> transferFunction;
    /// Of all bricks in memory, shown, kept for later or being sampled.
    std::int64_t budgetBytes = std::int64_t(1) << 30;
    /// Threads of its own, which sample between calls too; 0: all work is done in update().
    int threads = 0;
    /// Bricks are read there if they are there, and kept there when they were sampled; may be null.
    std::shared_ptr<BrickArchive> archive = nullptr;
};

/// Of the samples of a brick's closed box.
std::int64_t bytesOfBrick(int channels, int brickCells);

struct LeafFindings {
    DepthKey leaf;
    BrickFindings findings;
};

/// What a scheduler has done so far.
struct ScheduleCounts {
    std::int64_t sampled = 0;    ///< bricks
    std::int64_t read = 0;       ///< bricks read from the archive
    std::int64_t reused = 0;     ///< bricks shown again from memory
    std::int64_t dropped = 0;    ///< bricks dropped from memory
    std::int64_t published = 0;  ///< changes shown
};

/// Keeps a mesh as bricks that are fine where they are wished to be: around a focus that moves, for one. It
/// samples the best bricks first, within a budget of bytes, and shows whole, consistent states only: leaves
/// cover the domain once, any two that touch differ by at most one depth, and each has all its samples. The
/// coarsest bricks come first and never go.
///
/// Its work is done in update(), by as many threads as that is given, or by threads of its own; what they
/// have done is shown in update() or publish(). All calls are for one thread.
/// What it shows at rest depends on the mesh, the wishes and the budget alone, unless findings are set: it is
/// the plan that WishPlan makes.
class BrickScheduler {
  public:
    using Clock = std::chrono::steady_clock;

    /// Builds the element index, but samples nothing yet. The mesh, the resampler and the target must outlive
    /// it. Throws InputError for options that contradict each other and a budget that doesn't hold the
    /// coarsest bricks.
    /// @param fields indices into mesh.fields: the channels, in this order.
    BrickScheduler(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                   const ScheduleOptions& options, BrickTarget& target, const Execution& execution = {});
    ~BrickScheduler();

    /// Moves the focus: work that waits is dropped, bricks that are being sampled come to their end. False,
    /// and nothing changes, where the difference is too small to be worth new bricks (isJitter()).
    bool setFocus(std::vector<Focus> focus);
    /// Changes what is seen; the field must be the one that was given first. Throws InputError.
    void setTransferFunction(const std::optional<TransferFunction>& function);
    /// Drops bricks at once where there are more. Throws InputError when the coarsest don't fit.
    void setBudget(std::int64_t budgetBytes);

    /// Samples and publishes until the deadline has passed, a little at least, or there is nothing to do.
    /// True at rest: what is shown is the plan. When it throws, what is shown stays consistent and the next
    /// call goes on.
    bool update(Clock::time_point deadline, const Execution& execution = {});
    ScheduleProgress progress() const;
    /// Shows what threads of its own have done, and waits for nothing. True at rest.
    bool publish(const Execution& execution = {}) { return update(Clock::now(), execution); }
    /// Until it is at rest.
    void finish(const Execution& execution = {});
    /// Samples and shows the coarsest bricks, before anything else was shown, by one pass over the mesh on
    /// all threads: sooner than by update(), but without a deadline. Does nothing where they are shown, and
    /// where bricks are judged by their values or there is an archive.
    void showCoarsest(const Execution& execution = {});

    /// The leaves shown; none before the coarsest bricks are there.
    const GrowingTree& tree() const { return tree_; }
    /// Of a leaf shown, or of a brick above one; null for others.
    std::shared_ptr<const Block> samples(const DepthKey& key) const;
    const PlanFrame& frame() const { return bricks_.frame(); }
    const Wishes& wishes() const { return wishes_; }
    /// What was found out about bricks so far.
    const MeshBricks& bricks() const { return bricks_; }
    /// Findings about leaves shown that come from more than their own samples: they take the place of those
    /// that it made, until a brick is sampled again. Plans anew.
    void setFindings(std::span<LeafFindings> findings);
    /// Of a leaf shown: the largest error found that counts, over its bound; 0 without errors.
    double errorOverBound(const DepthKey& leaf) const {
        return plan_ ? plan_->errorOverBound(*bricks_.find(leaf)) : 0;
    }
    /// The budget holds fewer bricks than are wished for.
    bool isCutShort() const { return plan_ && plan_->isCutShort(); }

    /// Of bricks in memory and of those being sampled.
    std::int64_t bytes() const { return std::int64_t(memory_.brickCount() + reserved_) * brickBytes_; }
    std::int64_t brickBytes() const { return brickBytes_; }
    /// The least budget: the coarsest bricks and one change.
    std::int64_t leastBudgetBytes() const;
    const ScheduleCounts& counts() const { return counts_; }
    /// The code path that samples, one of Resampler::targets().
    std::string_view resamplerTarget() const { return bound_->target(); }
    ResampleStatistics statistics() const { return sampling_.statistics(); }
    /// What all threads spent in sampling; the rest of their work is planning and bookkeeping.
    double samplingMs() const { return sampling_.busyMs(); }
    /// Drops all bricks that aren't shown.
    void forget();

  private:
    /// Bricks that are sampled, to be shown together.
    struct Change {
        std::optional<MeshBricks::Number> split;  ///< null: the roots
        ChildBits children = 0;
        std::vector<MeshBricks::Number> bricks;
        std::shared_ptr<BrickSampling::Order> order;
        std::size_t missing = 0;  ///< bricks that are being sampled
        int planNumber = 0;
    };

    bool workUntil(Clock::time_point deadline, const Execution& execution);
    void replan();
    WishPlan& plan();
    void beginRoots();
    bool beginChange(const WishPlan::Split& split);
    bool fillQueue(Clock::time_point deadline);
    void abandon(const Change& change);
    bool publishFinished();
    void show(const Change& change);
    bool showSplit(const Change& change);
    bool makeRoom(std::size_t bricks);
    bool mergeLeastUseful();
    bool merge(MeshBricks::Number brick);
    bool isSplit(MeshBricks::Number brick) const { return brick < isSplit_.size() && isSplit_[brick]; }
    void setSplit(MeshBricks::Number brick, bool isSplit);
    void publish(std::optional<MeshBricks::Number> within, std::span<const GrowingLeaf> removed,
                 std::span<const GrowingLeaf> added);
    MeshBricks::Number numberOf(std::optional<MeshBricks::Number> within, const DepthKey& key) const;
    std::size_t budgetBricks() const { return std::size_t(budgetBytes_ / brickBytes_); }
    PlanLimit limit() const;

    std::shared_ptr<const SharedElementIndex> index_;
    std::unique_ptr<BoundResampler> bound_;
    std::unique_ptr<BoundResampler> passing_;  ///< by passes over the mesh; null: not to be used
    MeshBricks bricks_;
    BrickTarget& target_;
    std::int64_t brickBytes_;
    std::int64_t budgetBytes_;
    std::string watchedField_;
    Wishes wishes_;

    GrowingTree tree_;
    bool hasRoots_ = false;           ///< the coarsest bricks are shown
    BrickMemory memory_;              ///< holds leaves and the bricks above them, and what changes wait for
    std::vector<bool> isSplit_;       ///< by number: bricks above leaves; what lies beyond the end isn't
    std::unique_ptr<WishPlan> plan_;  ///< null before the index is built
    int planNumber_ = 0;
    bool isAtRest_ = false;
    std::optional<WishPlan::Split> next_;          ///< of the plan, waiting for room
    std::vector<MeshBricks::Number> leastUseful_;  ///< split bricks, the least useful last
    bool hasRanked_ = false;

    BrickSampling sampling_;
    std::deque<Change> changes_;  ///< in the order in which they are shown
    std::size_t reserved_ = 0;    ///< bricks being sampled
    ScheduleCounts counts_;
};

}  // namespace tessera
