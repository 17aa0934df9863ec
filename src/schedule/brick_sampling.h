#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <thread>
#include <vector>

#include "brick/depth.h"
#include "refine/brick_findings.h"
#include "refine/brick_plan.h"
#include "resample/stoppable_sampling.h"
#include "schedule/brick_archive.h"
#include "tessera/execution.h"
#include "tessera/resampler.h"

namespace tessera {

/// A brick and the samples of its closed box.
struct SampledBrick {
    DepthKey key;
    std::shared_ptr<const Block> samples;
    std::optional<BrickFindings> findings;
    bool wasRead = false;  ///< from the archive
};

/// Samples bricks in the order in which they were asked for, on several threads, stopping and going on within
/// a brick too. Bricks that touch are sampled together. Orders are given and taken by one thread.
class BrickSampling {
  public:
    using Clock = std::chrono::steady_clock;

    /// What is sampled for one change of the tree.
    class Order;

    /// All must outlive it; the resampler is best bound with the same index. @param inspector looks at each
    /// brick; may be null. @param archive where bricks are looked for first and kept; may be null. @param
    /// threads of its own, which sample whenever there is an
    /// order; 0: sampling is done by work() alone.
    BrickSampling(BoundResampler& bound, std::shared_ptr<const SharedElementIndex> index,
                  const PlanFrame& frame, std::shared_ptr<const BrickInspector> inspector,
                  std::shared_ptr<BrickArchive> archive, int threads);
    ~BrickSampling();

    /// Puts bricks of one depth at the end of the queue.
    /// @param together bricks that touch, each group sampled as one.
    std::shared_ptr<Order> order(std::span<const std::vector<DepthKey>> together);
    bool isDone(const Order& order) const;
    /// Some of it was sampled already.
    bool hasBegun(const Order& order) const;
    /// Of an order that is done, once.
    std::vector<SampledBrick> take(Order& order);
    /// Takes an order out of the queue, and waits for the piece of it that a thread is at; what was sampled
    /// is lost.
    void drop(const Order& order);

    /// Samples until the deadline has passed, a little at least, or nothing is left; with threads of its own
    /// it waits for them. When it throws, what was being sampled is sampled again.
    /// @param whenDone called by the calling thread whenever an order is done; may take and give orders.
    void work(Clock::time_point deadline, const Execution& execution, const std::function<void()>& whenDone);

    ResampleStatistics statistics() const;
    /// Of all threads, in sampling and reading.
    double busyMs() const;

  private:
    struct Task;
    class Crew;
    /// A task that a thread is at keeps its order.
    struct Taken {
        std::shared_ptr<Order> order;
        std::shared_ptr<Task> task;
        explicit operator bool() const { return task != nullptr; }
    };
    void addSampling(Order& order, const std::vector<DepthKey>& bricks);
    void addReading(Order& order, const DepthKey& key);
    void add(Order& order, const DepthKey& key, std::shared_ptr<const Block> samples, bool wasRead);
    Taken nextTask();
    bool hasTask() const;
    bool step(const Taken& taken, std::int64_t elements, const Execution& execution);
    void endPiece(const Taken& taken, bool isDone, Clock::time_point began);
    void serve(const std::stop_token& stop);
    void waitForThreads(Clock::time_point deadline, const Execution& execution,
                        const std::function<void()>& whenDone);

    BoundResampler& bound_;
    std::shared_ptr<const SharedElementIndex> index_;
    const PlanFrame& frame_;
    std::shared_ptr<const BrickInspector> inspector_;
    std::shared_ptr<BrickArchive> archive_;
    mutable std::mutex mutex_;  ///< of all below
    std::condition_variable_any changed_;
    std::deque<std::shared_ptr<Order>> queue_;  ///< that aren't done
    double busyMs_ = 0;
    bool anyDone_ = false;        ///< since whenDone was called
    int running_ = 0;             ///< tasks
    std::exception_ptr failure_;  ///< of a thread of its own
    ResampleStatistics statistics_;
    std::vector<std::jthread> threads_;
};

}  // namespace tessera
