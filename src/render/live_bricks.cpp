#include "render/live_bricks.h"

#include <string>
#include <utility>

#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kFirstPoolBytes = 16'000'000;

}  // namespace

/// Hands on what is published.
class LiveBricks::Target : public BrickTarget {
  public:
    void publish(const Publication& publication) override {
        if (to) to->publish(publication);
    }
    PoolTarget* to = nullptr;
};

LiveBricks::LiveBricks(const TetMesh& mesh, int field, const Resampler& resampler,
                       const ScheduleOptions& schedule, SampleFormat format, GlThread& thread,
                       const Execution& execution)
    : mesh_(mesh),
      fields_{field},
      format_(format),
      threads_(execution.threads),
      budgetBytes_(schedule.budgetBytes),
      target_(std::make_unique<Target>()),
      scheduler_(std::make_unique<BrickScheduler>(mesh, fields_, resampler, schedule, *target_, execution)) {
    const PlanFrame& frame = scheduler_->frame();
    frame_ = {frame.originWorld, frame.rootSpacingWorld, frame.brickCells};
    makePool(thread);
}

LiveBricks::~LiveBricks() = default;

void LiveBricks::makePool(GlThread& thread) {
    TexelCoding coding(codingsOf(mesh_, fields_, format_), format_);
    const std::int64_t edge = frame_.cells + 1, slotBytes = edge * edge * edge * coding.pointBytes();
    PoolOptions options;
    // As many bricks as the scheduler may show, and some that change while frames hold what is shown.
    const std::int64_t bricks = budgetBytes_ / scheduler_->brickBytes();
    options.budgetBytes = (bricks + bricks / 16 + 64) * slotBytes;
    options.firstBytes = kFirstPoolBytes;
    pool_.emplace(thread, frame_.cells, std::move(coding), options);
    filling_ = std::make_unique<PoolTarget>(*pool_, mesh_, fields_, threads_);
    target_->to = filling_.get();
    placedState_ = 0;
    placed_.clear();
}

std::span<const PlacedBrick> LiveBricks::bricks() {
    const auto state = pool_->state();
    if (state && state->number != placedState_) {
        placed_ = placeBricks(*filling_, 0);
        placedState_ = state->number;
    }
    return placed_;
}

bool LiveBricks::update(BrickScheduler::Clock::time_point deadline, const Execution& execution) {
    const bool isAtRest = scheduler_->update(deadline, execution);
    if (filling_->isTooSmall()) {
        const std::int64_t bytes = filling_->budgetBytes(scheduler_->brickBytes());
        if (bytes < scheduler_->leastBudgetBytes())
            throw GlMemoryError("the OpenGL device has no memory for more than " +
                                std::to_string(pool_->capacity()) + " bricks");
        scheduler_->setBudget(bytes);
        return false;
    }
    return (!filling_->isBehind() || filling_->catchUp()) && isAtRest;
}

void LiveBricks::moveTo(GlThread& thread) {
    target_->to = nullptr;
    filling_.reset();
    pool_.reset();
    makePool(thread);
    std::vector<ShownBrick> all;
    for (const GrowingLeaf& leaf : scheduler_->tree().leaves())
        all.push_back({leaf, scheduler_->samples(leaf.key)});
    if (!all.empty()) filling_->publish({.removed = {}, .added = all, .tree = &scheduler_->tree()});
}

}  // namespace tessera
