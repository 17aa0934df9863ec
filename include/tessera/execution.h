#pragma once

#include <atomic>
#include <cstdint>

namespace tessera {

/// What a run is at.
enum class Stage : std::uint8_t {
    reading,
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

/// Receives progress of long work. Called from any thread, for every item; must not block.
class ProgressSink {
  public:
    virtual ~ProgressSink() = default;
    /// @param done of `total` items of a stage, which begins with its first call.
    virtual void update(Stage stage, std::int64_t done, std::int64_t total) = 0;
    /// Sampling is about to begin, maybe anew: what it samples now, and about how much more in rounds to
    /// come. Called between stages, in units that are the same for a whole run.
    virtual void beginRound(double /*now*/, double /*later*/) {}
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
    /// For the parts of work whose progress the caller reports itself.
    Execution withoutProgress() const { return {threads, cancel, nullptr}; }
};

}  // namespace tessera
