#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

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
