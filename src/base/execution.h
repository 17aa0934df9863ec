#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace tessera {

/// What a run is at.
enum class Stage : std::uint8_t {
    reading,
    repairing,
    planning,
    sampling,
    checking,   ///< measuring the error of what was sampled last, between rounds of refinement
    measuring,  ///< measuring the error of everything
    comparing,
    extending,  ///< finding values outside the mesh
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
    int threads = 0;                            ///< worker threads; 0: one for every processor
    const std::atomic<bool>* cancel = nullptr;  ///< when it turns true, work stops with Cancelled
    ProgressSink* progress = nullptr;           ///< may be null

    int threadCount() const;
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

/// Calls body(i) once for every i in [0, count), in any order, on any thread. The first exception stops the
/// loop and is rethrown. Checks for cancellation between items.
void parallelFor(const Execution& execution, std::int64_t count,
                 const std::function<void(std::int64_t)>& body);

/// Calls body(begin, end) on fixed chunks of `chunk` items of [0, count): chunk borders, and so any per-chunk
/// result, do not depend on the number of threads.
void parallelForChunks(const Execution& execution, std::int64_t count, std::int64_t chunk,
                       const std::function<void(std::int64_t, std::int64_t)>& body);

}  // namespace tessera
