#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "tessera/execution.h"

namespace tessera {

/// Where a run stands.
struct ProgressState {
    bool hasBegun = false;  ///< some stage was reported
    Stage stage = Stage::reading;
    double share = 0;    ///< of the whole run, 0 to 1; never smaller than before
    double leftMs = -1;  ///< time until the end; below 0: not known yet
    std::string step;    ///< of a series: the name of the step at hand
};

/// Makes one share of a whole run out of what its stages report. What isn't known ahead is estimated; a wrong
/// estimate makes the share slower or faster from then on, never smaller: what remains is divided anew among
/// the stages that remain. While a stage reports nothing its share grows with time.
class RunProgress : public ProgressSink {
  public:
    using Clock = std::function<double()>;  ///< milliseconds
    explicit RunProgress(Clock clock);

    /// A stage that isn't named here takes no share.
    void declare(std::vector<ExpectedStage> stages) override;
    void beginStep(const std::string& name, double weight, double weightAfter) override;
    void expect(Stage stage, double milliseconds) override;

    void update(Stage stage, std::int64_t done, std::int64_t total) override;
    void beginRound(double now, double later) override;

    ProgressState state();

  private:
    void enter(Stage stage, double nowMs);
    void leave(double nowMs);
    bool isCounted(Stage stage) const;
    double unitsOf(const ExpectedStage& expected) const;
    double unitsAfter(std::size_t position) const;
    double fraction(double nowMs) const;
    double msPerUnit(double nowMs, double fraction) const;
    double leftInStepMs(double nowMs, double fraction) const;

    Clock clock_;
    std::atomic<std::uint64_t> latest_;  ///< stage and fraction of the last report, in one piece
    std::mutex mutex_;                   ///< of everything below
    std::vector<ExpectedStage> stages_;
    // The stage at work: its place in the list, and its part of the step.
    std::size_t position_ = 0;
    Stage stage_ = Stage::reading;
    bool inStage_ = false;
    double stageBase_ = 0, stageSpan_ = 0, stageUnits_ = 0, stageBeginMs_ = 0;
    double expectedMs_ = 0;
    Stage expectedStage_ = Stage::reading;
    // Rounds of this step: what this one samples, what later ones do, and all so far.
    bool hasRounds_ = false;
    double roundNow_ = 1, roundLater_ = 0, roundTotal_ = 1;
    // Stages of this step that are over, and how long they took: this tells how long others will.
    double countedUnits_ = 0, countedMs_ = 0;
    // Steps.
    double stepBase_ = 0, stepSpan_ = 1, stepWeight_ = 1, weightAfter_ = 0, stepBeginMs_ = 0;
    bool hasStep_ = false;
    std::string stepName_;
    double pastWeight_ = 0, pastMs_ = 0;  ///< of earlier steps of the same weight
    double shown_ = 0;
};

}  // namespace tessera
