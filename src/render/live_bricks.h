#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "pool/pool_target.h"
#include "render/placed_bricks.h"
#include "schedule/brick_scheduler.h"

namespace tessera {

/// A field's bricks that a scheduler keeps, in a pool where pictures are drawn from. All calls are for one
/// thread.
class LiveBricks {
  public:
    /// Nothing is sampled yet. All must outlive it. @param field of one component. The pool holds what the
    /// schedule's budget allows. Throws InputError as BrickScheduler and BrickPool do, GlError.
    LiveBricks(const TetMesh& mesh, int field, const Resampler& resampler, const ScheduleOptions& schedule,
               SampleFormat format, GlThread& thread, const Execution& execution);
    ~LiveBricks();

    BrickScheduler& scheduler() { return *scheduler_; }
    const BrickScheduler& scheduler() const { return *scheduler_; }
    const BrickFrame& frame() const { return frame_; }
    const BrickPool& pool() const { return *pool_; }
    /// What pool().state() shows; nothing before the coarsest bricks are there.
    std::span<const PlacedBrick> bricks();

    /// BrickScheduler::update(), and what it publishes is shown. True at rest, with everything shown. Where
    /// the device has no memory for as many bricks as the budget allows, the budget becomes what there is.
    /// Throws GlMemoryError where that doesn't hold the coarsest bricks.
    bool update(BrickScheduler::Clock::time_point deadline, const Execution& execution);

    /// BrickScheduler::showCoarsest(), in the pool too.
    void showCoarsest(const Execution& execution) { scheduler_->showCoarsest(execution); }

    /// Another device takes the place of the one before, which may be lost: everything is uploaded again.
    /// Throws GlError.
    void moveTo(GlThread& thread);
    /// Since the device has no memory for more bricks there are fewer than the budget allows.
    bool isDeviceFull() const { return pool_->isDeviceFull(); }

  private:
    class Target;

    void makePool(GlThread& thread);

    const TetMesh& mesh_;
    std::vector<int> fields_;
    SampleFormat format_;
    int threads_;
    std::int64_t budgetBytes_;
    BrickFrame frame_;
    std::unique_ptr<Target> target_;  // the scheduler's, whichever pool there is
    std::unique_ptr<BrickScheduler> scheduler_;
    std::optional<BrickPool> pool_;
    std::unique_ptr<PoolTarget> filling_;
    std::vector<PlacedBrick> placed_;
    std::int64_t placedState_ = 0;  // PoolState::number of placed_
};

}  // namespace tessera
