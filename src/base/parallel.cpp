#include "base/parallel.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "base/check.h"

#ifndef TESSERA_STD_THREADS
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#endif

namespace tessera {

#ifdef TESSERA_STD_THREADS

// ThreadSanitizer can't see through Debian's TBB, so its build runs loops on plain threads.
void parallelFor(const Execution& execution, std::int64_t count,
                 const std::function<void(std::int64_t)>& body) {
    const int threads = int(std::min<std::int64_t>(execution.threadCount(), count));
    std::atomic<std::int64_t> next{0};
    std::exception_ptr failure;
    std::mutex failureMutex;
    auto work = [&] {
        try {
            for (std::int64_t i = next++; i < count; i = next++) {
                execution.throwIfCancelled();
                body(i);
            }
        } catch (...) {
            std::lock_guard lock(failureMutex);
            if (!failure) failure = std::current_exception();
            next = count;
        }
    };
    std::vector<std::thread> pool;
    for (int t = 1; t < threads; ++t) pool.emplace_back(work);
    work();
    for (std::thread& thread : pool) thread.join();
    if (failure) std::rethrow_exception(failure);
}

#else

void parallelFor(const Execution& execution, std::int64_t count,
                 const std::function<void(std::int64_t)>& body) {
    if (count <= 0) return;
    const int threads = execution.threadCount();
    if (threads == 1 || count == 1) {
        for (std::int64_t i = 0; i < count; ++i) {
            execution.throwIfCancelled();
            body(i);
        }
        return;
    }
    // More threads than processors are honoured too: results must not depend on the number, and tests ask for
    // it.
    tbb::global_control control(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
    tbb::task_arena arena(threads);
    std::atomic<std::int64_t> next{0};
    arena.execute([&] {
        tbb::parallel_for(
            0, threads,
            [&](int) {
                for (std::int64_t i = next++; i < count; i = next++) {
                    execution.throwIfCancelled();
                    body(i);
                }
            },
            tbb::simple_partitioner{});
    });
}

#endif

void parallelForChunks(const Execution& execution, std::int64_t count, std::int64_t chunk,
                       const std::function<void(std::int64_t, std::int64_t)>& body) {
    TESSERA_CHECK(chunk > 0, "a chunk holds at least one item");
    const std::int64_t chunks = (count + chunk - 1) / chunk;
    parallelFor(execution, chunks,
                [&](std::int64_t c) { body(c * chunk, std::min(count, (c + 1) * chunk)); });
}

}  // namespace tessera
