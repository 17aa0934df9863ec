#include "schedule/brick_sampling.h"

#include <algorithm>
#include <utility>

#include "base/check.h"
#include "base/parallel.h"

namespace tessera {

/// Bricks of one depth that are sampled as one box.
struct BrickSampling::Task {
    std::vector<DepthKey> bricks;
    std::unique_ptr<StoppableSampling> sampling;
    bool isRunning = false, hasBegun = false, isDone = false;
};

class BrickSampling::Order {
  public:
    std::vector<std::shared_ptr<Task>> tasks;
    std::vector<SampledBrick> sampled;
    std::size_t left = 0;  // tasks that aren't done
};

namespace {

IndexBox closedBox(const DepthKey& key, int cells) {
    return {key.index * cells, (key.index + 1) * cells + 1};
}

std::shared_ptr<const Block> cut(const Block& from, const IndexBox& box) {
    auto part = std::make_shared<Block>();
    part->lattice = from.lattice;
    part->box = box;
    part->channels = from.channels;
    part->values.resize(std::size_t(from.channels) * part->count());
    part->coverage.resize(part->count());
    const int length = box.size().x;
    Vec3i p = box.min;
    for (p.z = box.min.z; p.z < box.max.z; ++p.z)
        for (p.y = box.min.y; p.y < box.max.y; ++p.y) {
            const std::size_t source = from.offset(p), target = part->offset(p);
            std::copy_n(from.coverage.data() + source, length, part->coverage.data() + target);
            for (int c = 0; c < from.channels; ++c)
                std::copy_n(from.channel(c).data() + source, length,
                            part->values.data() + std::size_t(c) * part->count() + target);
        }
    return part;
}

}  // namespace

BrickSampling::BrickSampling(BoundResampler& bound, std::shared_ptr<const SharedElementIndex> index,
                             const PlanFrame& frame)
    : bound_(bound), index_(std::move(index)), frame_(frame) {}

BrickSampling::~BrickSampling() = default;

std::shared_ptr<BrickSampling::Order> BrickSampling::order(std::span<const std::vector<DepthKey>> together) {
    auto order = std::make_shared<Order>();
    const int cells = frame_.brickCells;
    for (const std::vector<DepthKey>& bricks : together) {
        if (bricks.empty()) continue;
        IndexBox box = closedBox(bricks.front(), cells);
        for (const DepthKey& key : bricks) {
            const IndexBox own = closedBox(key, cells);
            box = {glm::min(box.min, own.min), glm::max(box.max, own.max)};
        }
        const double spacing = frame_.spacingWorld(bricks.front().depth);
        auto task = std::make_shared<Task>();
        task->bricks = bricks;
        task->sampling = std::make_unique<StoppableSampling>(
            bound_, index_, Lattice::axisParallel(frame_.originWorld, spacing), std::span(&box, 1),
            [this, cells, keys = bricks, to = order.get()](std::size_t, const Block& block) {
                std::vector<SampledBrick> parts;
                for (const DepthKey& key : keys) parts.push_back({key, cut(block, closedBox(key, cells))});
                const std::lock_guard lock(mutex_);
                to->sampled.insert(to->sampled.end(), parts.begin(), parts.end());
            });
        order->tasks.push_back(std::move(task));
    }
    order->left = order->tasks.size();
    const std::lock_guard lock(mutex_);
    if (order->left > 0) queue_.push_back(order);
    return order;
}

bool BrickSampling::isDone(const Order& order) {
    return order.left == 0;
}

bool BrickSampling::hasBegun(const Order& order) {
    return std::any_of(order.tasks.begin(), order.tasks.end(),
                       [](const std::shared_ptr<Task>& task) { return task->hasBegun; });
}

std::vector<SampledBrick> BrickSampling::take(Order& order) {
    TESSERA_CHECK(isDone(order), "bricks are taken before they are sampled");
    return std::move(order.sampled);
}

void BrickSampling::drop(const Order& order) {
    const std::lock_guard lock(mutex_);
    std::erase_if(queue_, [&](const std::shared_ptr<Order>& queued) { return queued.get() == &order; });
}

// The first that no thread is at.
std::shared_ptr<BrickSampling::Task> BrickSampling::nextTask() {
    for (const std::shared_ptr<Order>& order : queue_)
        for (const std::shared_ptr<Task>& task : order->tasks)
            if (!task->isDone && !task->isRunning) {
                task->isRunning = task->hasBegun = true;
                return task;
            }
    return nullptr;
}

void BrickSampling::workOnThread(Clock::time_point deadline, const Execution& single, bool& stop) {
    while (true) {
        std::shared_ptr<Task> task;
        {
            const std::lock_guard lock(mutex_);
            if (!stop) task = nextTask();
        }
        if (!task) return;
        bool isDone = false, isLate = false, mustStop = false;
        const auto leave = [&] {
            const std::lock_guard lock(mutex_);
            task->isRunning = false;
            task->isDone = isDone;
            if (isDone) {
                statistics_ += task->sampling->statistics();
                task->sampling.reset();
                for (std::size_t i = 0; i < queue_.size(); ++i) {
                    const auto& tasks = queue_[i]->tasks;
                    if (std::find(tasks.begin(), tasks.end(), task) == tasks.end()) continue;
                    if (--queue_[i]->left > 0) break;
                    stop = stop || i == 0;
                    queue_.erase(queue_.begin() + std::ptrdiff_t(i));
                    break;
                }
            }
            if (isLate) stop = true;
        };
        try {
            // A piece at a time, so that a thread stops soon when another one has finished the first order.
            while (!isDone && !isLate && !mustStop) {
                isDone = task->sampling->advance(Clock::now(), single);
                isLate = Clock::now() >= deadline;
                const std::lock_guard lock(mutex_);
                mustStop = stop;
            }
        } catch (...) {
            leave();
            throw;
        }
        leave();
    }
}

void BrickSampling::work(Clock::time_point deadline, const Execution& execution) {
    bool stop = false;
    Execution single = execution.withoutProgress();
    single.threads = 1;
    const int threads = execution.threadCount();
    parallelFor(execution.withoutProgress(), threads,
                [&](std::int64_t) { workOnThread(deadline, single, stop); });
}

}  // namespace tessera
