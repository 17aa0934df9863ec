#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string_view>

namespace tessera {

/// Receives progress of long work. Called from any thread; must not block.
class ProgressSink {
  public:
    virtual ~ProgressSink() = default;
    /// @param stage a short word such as "resample"; @param done, total units of work of that stage.
    virtual void update(std::string_view stage, std::int64_t done, std::int64_t total) = 0;
};

/// How long work runs: threads, cancellation, progress. Results never depend on it.
struct Execution {
    int threads = 0;                            ///< worker threads; 0: one for every processor
    const std::atomic<bool>* cancel = nullptr;  ///< when it turns true, work stops with Cancelled
    ProgressSink* progress = nullptr;           ///< may be null

    int threadCount() const;
    void throwIfCancelled() const;
    void report(std::string_view stage, std::int64_t done, std::int64_t total) const {
        if (progress) progress->update(stage, done, total);
    }
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
