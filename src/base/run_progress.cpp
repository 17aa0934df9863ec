#include "base/run_progress.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace tessera {

namespace {

constexpr std::uint64_t kNoStage = std::uint64_t(0xff) << 32;
constexpr double kUsualMs = 1500;  // of a stage of which nothing is known
// A stage that reports nothing comes near this share of itself as time goes by.
constexpr double kSilentShare = 0.9, kShareBeforeReports = 0.1;
constexpr double kMostGuessed = 0.3;      // of rounds to come, over those that are known
constexpr double kFirstEstimateMs = 500;  // time that has to be measured before it tells anything

std::uint64_t packed(Stage stage, float fraction) {
    return std::uint64_t(stage) << 32 | std::bit_cast<std::uint32_t>(fraction);
}

float fractionIn(std::uint64_t latest) {
    return std::bit_cast<float>(std::uint32_t(latest));
}

/// Stages whose work doesn't say how it goes on.
bool isSilent(Stage stage) {
    return stage == Stage::reading || stage == Stage::tetrahedralizing || stage == Stage::extending ||
           stage == Stage::writing;
}

}  // namespace

RunProgress::RunProgress(Clock clock) : clock_(std::move(clock)), latest_(kNoStage) {}

void RunProgress::declare(std::vector<ExpectedStage> stages) {
    const std::lock_guard lock(mutex_);
    stages_ = std::move(stages);
}

void RunProgress::expect(Stage stage, double milliseconds) {
    const std::lock_guard lock(mutex_);
    expectedStage_ = stage;
    expectedMs_ = milliseconds;
}

void RunProgress::beginStep(const std::string& name, double weight, double weightAfter) {
    const std::lock_guard lock(mutex_);
    stepName_ = name;
    const double now = clock_();
    latest_ = kNoStage;
    if (hasStep_) {
        if (weight != stepWeight_) pastWeight_ = pastMs_ = 0;
        if (weight == stepWeight_) {
            pastWeight_ += stepWeight_;
            pastMs_ += now - stepBeginMs_;
        }
        stepBase_ += stepSpan_;
    }
    hasStep_ = true;
    stepWeight_ = weight;
    weightAfter_ = weightAfter;
    stepBeginMs_ = now;
    stepSpan_ = (1 - stepBase_) * weight / (weight + weightAfter);
    position_ = 0;
    inStage_ = hasRounds_ = false;
    stageBase_ = stageSpan_ = 0;
    roundNow_ = roundTotal_ = 1;
    roundLater_ = countedUnits_ = countedMs_ = 0;
}

void RunProgress::update(Stage stage, std::int64_t done, std::int64_t total) {
    const float part = total > 0 ? float(std::clamp(double(done) / double(total), 0.0, 1.0)) : 0.0f;
    const std::uint64_t before = latest_.load(std::memory_order_relaxed);
    // Workers come here for every item: of one stage they only leave a number.
    if (before >> 32 != std::uint64_t(stage)) {
        const std::lock_guard lock(mutex_);
        if (latest_.load() >> 32 != std::uint64_t(stage)) enter(stage, clock_());
        latest_ = packed(stage, part);
        return;
    }
    // Threads overtake each other.
    if (part > fractionIn(before) || part == 0) latest_.store(packed(stage, part), std::memory_order_relaxed);
}

void RunProgress::beginRound(double now, double later) {
    const std::lock_guard lock(mutex_);
    const double at = clock_();
    leave(at);
    latest_ = kNoStage;
    if (!hasRounds_) {
        // Stages before it say nothing about those that come.
        roundTotal_ = countedUnits_ = countedMs_ = 0;
        hasRounds_ = true;
    }
    roundNow_ = now;
    roundLater_ = later;
    roundTotal_ += now;
}

/// What a stage costs, in units that are the same for all stages of a step.
double RunProgress::unitsOf(const ExpectedStage& expected) const {
    const bool everyRound = expected.stage == Stage::sampling || expected.stage == Stage::checking;
    return expected.weight * (everyRound ? roundNow_ : roundTotal_ + roundLater_);
}

double RunProgress::unitsAfter(std::size_t position) const {
    double units = 0;
    bool inRounds = false;
    for (std::size_t s = position; s < stages_.size(); ++s) {
        const bool everyRound = stages_[s].stage == Stage::sampling || stages_[s].stage == Stage::checking;
        inRounds = inRounds || everyRound;
        if (s > position) units += unitsOf(stages_[s]);
    }
    for (const ExpectedStage& expected : stages_)
        if (inRounds && (expected.stage == Stage::sampling || expected.stage == Stage::checking))
            units += expected.weight * roundLater_;
    return units;
}

/// Whether the time it takes tells how long the stages behind it will.
bool RunProgress::isCounted(Stage stage) const {
    return stage != Stage::reading && stage != Stage::tetrahedralizing && stage != Stage::repairing &&
           stage != Stage::planning;
}

/// The stage at work is over.
void RunProgress::leave(double nowMs) {
    if (!inStage_) return;
    stageBase_ += stageSpan_;
    stageSpan_ = 0;
    inStage_ = false;
    if (!isCounted(stage_)) return;
    countedUnits_ += stageUnits_;
    countedMs_ += nowMs - stageBeginMs_;
}

void RunProgress::enter(Stage stage, double nowMs) {
    leave(nowMs);
    const auto found = std::find_if(stages_.begin(), stages_.end(),
                                    [&](const ExpectedStage& s) { return s.stage == stage; });
    stage_ = stage;
    inStage_ = true;
    stageBeginMs_ = nowMs;
    stageUnits_ = 0;
    if (found == stages_.end()) return;
    position_ = std::size_t(found - stages_.begin());
    stageUnits_ = unitsOf(*found);
    const double all = stageUnits_ + unitsAfter(position_);
    stageSpan_ = all > 0 ? (1 - stageBase_) * stageUnits_ / all : 0;
}

double RunProgress::fraction(double nowMs) const {
    if (!inStage_) return 0;
    const double reported = double(fractionIn(latest_.load(std::memory_order_relaxed)));
    if (reported > 0) return reported;
    double usualMs = kUsualMs;
    if (expectedStage_ == stage_ && expectedMs_ > 0)
        usualMs = expectedMs_;
    else if (isCounted(stage_) && countedUnits_ > 0 && stageUnits_ > 0)
        usualMs = std::max(100.0, stageUnits_ * countedMs_ / countedUnits_);
    const double most = isSilent(stage_) ? kSilentShare : kShareBeforeReports;
    return most * (1 - std::exp(-(nowMs - stageBeginMs_) / usualMs));
}

/// Below 0 when it isn't known.
double RunProgress::msPerUnit(double nowMs, double part) const {
    double units = countedUnits_, ms = countedMs_;
    const bool reports = fractionIn(latest_.load(std::memory_order_relaxed)) > 0;
    if (inStage_ && isCounted(stage_) && reports) {
        units += stageUnits_ * part;
        ms += nowMs - stageBeginMs_;
    }
    return units > 0 && ms >= kFirstEstimateMs ? ms / units : -1;
}

/// Below 0 when it isn't known.
double RunProgress::leftInStepMs(double nowMs, double part) const {
    const double perUnit = msPerUnit(nowMs, part);
    // Rounds that outweigh what is done are a guess that may be far off.
    if (perUnit < 0 || roundLater_ > kMostGuessed * roundTotal_) return -1;
    return perUnit * (stageUnits_ * (1 - part) + unitsAfter(position_));
}

ProgressState RunProgress::state() {
    const std::lock_guard lock(mutex_);
    const double now = clock_();
    const double part = fraction(now);
    const double step = std::min(1.0, stageBase_ + stageSpan_ * part);
    shown_ = std::clamp(stepBase_ + stepSpan_ * step, shown_, 1.0);
    ProgressState state{inStage_ || shown_ > 0, stage_, shown_, leftInStepMs(now, part), stepName_};
    if (weightAfter_ <= 0) return state;
    // A series: earlier steps tell how long one takes, or else this one.
    const double thisMs = now - stepBeginMs_;
    if (pastWeight_ > 0) {
        const double stepMs = pastMs_ / pastWeight_ * stepWeight_;
        if (state.leftMs < 0) state.leftMs = std::max(0.0, stepMs - thisMs);
        state.leftMs += weightAfter_ * (pastMs_ / pastWeight_);
    } else if (state.leftMs >= 0) {
        state.leftMs += weightAfter_ * (thisMs + state.leftMs) / stepWeight_;
    }
    return state;
}

}  // namespace tessera
