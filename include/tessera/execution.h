#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace tessera {

/// What a run is at.
enum class Stage : std::uint8_t {
    reading,
    /// Making tetrahedra of a surface or of points.
    tetrahedralizing,
    repairing,
    planning,
    sampling,
    /// Measuring the error of what was sampled last, between rounds of refinement.
    checking,
    /// Measuring the error of everything.
    measuring,
    comparing,
    /// Finding values outside the mesh.
    extending,
    writing
};

/// A stage that a run goes through, and the time that it is expected to take over that of the others. From
/// sampling on: with one round of sampling.
struct ExpectedStage {
    Stage stage;
    double weight;
};

/// Receives progress of long work. Called from any thread, for every item; must not block.
class ProgressSink {
  public:
    virtual ~ProgressSink() = default;
    /// @param done of `total` items of a stage, which begins with its first call.
    virtual void update(Stage stage, std::int64_t done, std::int64_t total) = 0;
    /// Sampling is about to begin, maybe anew: what it samples now, and about how much more in rounds to
    /// come. Called between stages, in units that are the same for a whole run.
    virtual void beginRound(double /*now*/, double /*later*/) {}
    /// The stages of every step, in their order; a run that isn't a series is one step.
    virtual void declare(std::vector<ExpectedStage> /*stages*/) {}
    /// The next step of a series begins.
    /// @param name such as "step 3 of 20". @param weight of the step, @param weightAfter of all the steps
    /// behind it together.
    virtual void beginStep(const std::string& /*name*/, double /*weight*/, double /*weightAfter*/) {}
    /// About how long a stage takes that reports nothing; for its next time.
    virtual void expect(Stage /*stage*/, double /*milliseconds*/) {}
};

/// How long work runs: threads, cancellation, progress. Results never depend on it.
struct Execution {
    /// Worker threads; 0: one for every processor.
    int threads = 0;
    /// When it turns true, work stops and throws Cancelled; may be null.
    const std::atomic<bool>* cancel = nullptr;
    /// May be null.
    ProgressSink* progress = nullptr;

    /// Worker threads, at least 1.
    int threadCount() const;
    /// Throws Cancelled when the caller asked to stop.
    void throwIfCancelled() const;
    void report(Stage stage, std::int64_t done, std::int64_t total) const {
        if (progress) progress->update(stage, done, total);
    }
    void beginRound(double now, double later) const {
        if (progress) progress->beginRound(now, later);
    }
    void declare(std::vector<ExpectedStage> stages) const {
        if (progress) progress->declare(std::move(stages));
    }
    void beginStep(const std::string& name, double weight, double weightAfter) const {
        if (progress) progress->beginStep(name, weight, weightAfter);
    }
    void expect(Stage stage, double milliseconds) const {
        if (progress) progress->expect(stage, milliseconds);
    }
    /// For the parts of work whose progress the caller reports itself.
    Execution withoutProgress() const { return {threads, cancel, nullptr}; }
};

}  // namespace tessera
