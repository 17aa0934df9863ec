#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "brick/depth.h"
#include "refine/brick_findings.h"
#include "refine/brick_plan.h"
#include "resample/stoppable_sampling.h"
#include "tessera/execution.h"
#include "tessera/resampler.h"

namespace tessera {

/// A brick and the samples of its closed box.
struct SampledBrick {
    DepthKey key;
    std::shared_ptr<const Block> samples;
    std::optional<BrickFindings> findings;
};

/// Samples bricks in the order in which they were asked for, on several threads, stopping and going on within
/// a brick too. Bricks that touch are sampled together.
class BrickSampling {
  public:
    using Clock = std::chrono::steady_clock;

    /// What is sampled for one change of the tree.
    class Order;

    /// All must outlive it; the resampler is best bound with the same index. @param inspector looks at each
    /// brick that is sampled; may be null.
    BrickSampling(BoundResampler& bound, std::shared_ptr<const SharedElementIndex> index,
                  const PlanFrame& frame, std::shared_ptr<const BrickInspector> inspector);
    ~BrickSampling();

    /// Puts bricks of one depth at the end of the queue.
    /// @param together bricks that touch, each group sampled as one.
    std::shared_ptr<Order> order(std::span<const std::vector<DepthKey>> together);
    static bool isDone(const Order& order);
    /// Some of it was sampled already.
    static bool hasBegun(const Order& order);
    /// Of an order that is done, once.
    static std::vector<SampledBrick> take(Order& order);
    /// Takes an order out of the queue; what was sampled of it is lost.
    void drop(const Order& order);

    /// Samples until the deadline has passed, a little at least, or nothing is left. When it throws, what was
    /// being sampled is sampled again by the next call.
    /// @param whenDone called by the calling thread whenever an order is done; may take and give orders.
    void work(Clock::time_point deadline, const Execution& execution, const std::function<void()>& whenDone);

    const ResampleStatistics& statistics() const { return statistics_; }

  private:
    struct Task;
    class Crew;
    std::shared_ptr<Task> nextTask();
    void endPiece(const std::shared_ptr<Task>& task, bool isDone);

    BoundResampler& bound_;
    std::shared_ptr<const SharedElementIndex> index_;
    const PlanFrame& frame_;
    std::shared_ptr<const BrickInspector> inspector_;
    std::mutex mutex_;                          ///< of all below
    std::deque<std::shared_ptr<Order>> queue_;  ///< that aren't done
    bool anyDone_ = false;                      ///< since whenDone was called
    int running_ = 0;                           ///< tasks
    ResampleStatistics statistics_;
};

}  // namespace tessera
