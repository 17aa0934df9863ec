#include "schedule/brick_sampling.h"

#include <algorithm>
#include <condition_variable>
#include <thread>
#include <utility>

#include "base/check.h"
#include "base/parallel.h"
#include "lattice/copy_points.h"

namespace tessera {

/// Bricks of one depth that are sampled as one box, or one that is read.
struct BrickSampling::Task {
    std::unique_ptr<StoppableSampling> sampling;
    std::function<void()> read;
    bool isRunning = false, hasBegun = false, isDone = false;
};

class BrickSampling::Order {
  public:
    std::vector<std::shared_ptr<Task>> tasks;
    std::vector<SampledBrick> sampled;
    std::size_t left = 0;  // tasks that aren't done
};

namespace {

// Elements of the next piece: large pieces cost less, small ones end in time.
std::int64_t pieceElements(BrickSampling::Clock::duration left) {
    constexpr double kElementsAMs = 400;
    constexpr std::int64_t kMost = 65536;
    const double ms = std::chrono::duration<double, std::milli>(left).count();
    return std::clamp(std::int64_t(std::clamp(ms, 0.0, 1e6) * kElementsAMs),
                      StoppableSampling::kPieceElements / 4, kMost);
}

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
    copyPoints(from, box, *part);
    return part;
}

}  // namespace

BrickSampling::BrickSampling(BoundResampler& bound, std::shared_ptr<const SharedElementIndex> index,
                             const PlanFrame& frame, std::shared_ptr<const BrickInspector> inspector,
                             std::shared_ptr<BrickArchive> archive, int threads)
    : bound_(bound),
      index_(std::move(index)),
      frame_(frame),
      inspector_(std::move(inspector)),
      archive_(std::move(archive)) {
    for (int t = 0; t < threads; ++t)
        threads_.emplace_back([this](const std::stop_token& stop) { serve(stop); });
}

BrickSampling::~BrickSampling() {
    for (std::jthread& thread : threads_) thread.request_stop();
    threads_.clear();
}

void BrickSampling::add(Order& order, const DepthKey& key, std::shared_ptr<const Block> samples,
                        bool wasRead) {
    if (archive_ && !wasRead) archive_->append(key, *samples);
    SampledBrick brick{key, std::move(samples), {}, wasRead};
    if (inspector_) brick.findings = inspector_->inspect(key, *brick.samples, frame_);
    const std::lock_guard lock(mutex_);
    order.sampled.push_back(std::move(brick));
}

void BrickSampling::addReading(Order& order, const DepthKey& key) {
    auto task = std::make_shared<Task>();
    task->read = [this, key, to = &order] {
        const Lattice lattice = Lattice::axisParallel(frame_.originWorld, frame_.spacingWorld(key.depth));
        add(*to, key, archive_->read(key, lattice, closedBox(key, frame_.brickCells)), true);
    };
    order.tasks.push_back(std::move(task));
}

void BrickSampling::addSampling(Order& order, const std::vector<DepthKey>& bricks) {
    if (bricks.empty()) return;
    const int cells = frame_.brickCells;
    IndexBox box = closedBox(bricks.front(), cells);
    for (const DepthKey& key : bricks) {
        const IndexBox own = closedBox(key, cells);
        box = {glm::min(box.min, own.min), glm::max(box.max, own.max)};
    }
    const double spacing = frame_.spacingWorld(bricks.front().depth);
    auto task = std::make_shared<Task>();
    task->sampling = std::make_unique<StoppableSampling>(
        bound_, index_, Lattice::axisParallel(frame_.originWorld, spacing), std::span(&box, 1),
        [this, cells, bricks, to = &order](std::size_t, const Block& block) {
            for (const DepthKey& key : bricks) add(*to, key, cut(block, closedBox(key, cells)), false);
        });
    order.tasks.push_back(std::move(task));
}

std::shared_ptr<BrickSampling::Order> BrickSampling::order(std::span<const std::vector<DepthKey>> together) {
    auto order = std::make_shared<Order>();
    for (const std::vector<DepthKey>& bricks : together) {
        std::vector<DepthKey> sampled;
        for (const DepthKey& key : bricks)
            if (archive_ && archive_->contains(key))
                addReading(*order, key);
            else
                sampled.push_back(key);
        addSampling(*order, sampled);
    }
    order->left = order->tasks.size();
    const std::lock_guard lock(mutex_);
    if (order->left > 0) queue_.push_back(order);
    changed_.notify_all();
    return order;
}

bool BrickSampling::isDone(const Order& order) const {
    const std::lock_guard lock(mutex_);
    return order.left == 0;
}

bool BrickSampling::hasBegun(const Order& order) const {
    const std::lock_guard lock(mutex_);
    return std::any_of(order.tasks.begin(), order.tasks.end(),
                       [](const std::shared_ptr<Task>& task) { return task->hasBegun; });
}

std::vector<SampledBrick> BrickSampling::take(Order& order) {
    const std::lock_guard lock(mutex_);
    TESSERA_CHECK(order.left == 0, "bricks are taken before they are sampled");
    return std::move(order.sampled);
}

ResampleStatistics BrickSampling::statistics() const {
    const std::lock_guard lock(mutex_);
    return statistics_;
}

void BrickSampling::drop(const Order& order) {
    std::unique_lock lock(mutex_);
    std::erase_if(queue_, [&](const std::shared_ptr<Order>& queued) { return queued.get() == &order; });
    changed_.wait(lock, [&] {
        return std::none_of(order.tasks.begin(), order.tasks.end(),
                            [](const std::shared_ptr<Task>& task) { return task->isRunning; });
    });
}

double BrickSampling::busyMs() const {
    const std::lock_guard lock(mutex_);
    return busyMs_;
}

// The first that no thread is at.
BrickSampling::Taken BrickSampling::nextTask() {
    for (const std::shared_ptr<Order>& order : queue_)
        for (const std::shared_ptr<Task>& task : order->tasks)
            if (!task->isDone && !task->isRunning) {
                task->isRunning = task->hasBegun = true;
                ++running_;
                return {order, task};
            }
    return {};
}

void BrickSampling::endPiece(const Taken& taken, bool isDone, Clock::time_point began) {
    --running_;
    busyMs_ += std::chrono::duration<double, std::milli>(Clock::now() - began).count();
    Task& task = *taken.task;
    task.isRunning = false;
    task.isDone = isDone;
    changed_.notify_all();
    if (!isDone) return;
    if (task.sampling) statistics_ += task.sampling->statistics();
    task.sampling.reset();
    if (--taken.order->left > 0) return;
    std::erase(queue_, taken.order);
    anyDone_ = true;
}

// Without the lock; true when the task is done.
bool BrickSampling::step(const Taken& taken, std::int64_t elements, const Execution& execution) {
    execution.throwIfCancelled();
    if (taken.task->sampling) return taken.task->sampling->step(elements, execution);
    taken.task->read();
    return true;
}

/// The threads of one call of work().
class BrickSampling::Crew {
  public:
    Crew(BrickSampling& sampling, Clock::time_point deadline, const Execution& execution,
         const std::function<void()>& whenDone)
        : sampling_(sampling), deadline_(deadline), execution_(execution), whenDone_(whenDone) {}

    void work() {
        const bool isCaller = std::this_thread::get_id() == caller_;
        try {
            while (isCaller ? leadOn() : followOn()) {
            }
        } catch (...) {
            end();
            throw;
        }
        if (isCaller) end();
    }

  private:
    void end() {
        const std::lock_guard lock(sampling_.mutex_);
        hasEnded_ = true;
        sampling_.changed_.notify_all();
    }
    bool isLate() const { return Clock::now() >= deadline_; }

    // The calling thread shows what is done and gives new work; it goes when another thread has gone, as
    // there may be work for it again.
    bool leadOn() {
        std::unique_lock lock(sampling_.mutex_);
        if (std::exchange(sampling_.anyDone_, false)) {
            lock.unlock();
            whenDone_();
            lock.lock();
            if (hasGone_ || isLate()) return false;
        }
        if (const Taken taken = sampling_.nextTask()) return piece(taken, lock);
        if (sampling_.running_ == 0 && !sampling_.anyDone_) return false;
        wait(lock);
        return !isLate();
    }

    bool followOn() {
        std::unique_lock lock(sampling_.mutex_);
        if (hasEnded_) return false;
        if (const Taken taken = sampling_.nextTask()) return piece(taken, lock);
        // Nobody but the caller gives work, and it may not be among these threads.
        hasGone_ = sampling_.running_ == 0;
        if (hasGone_) return false;
        wait(lock);
        return !isLate();
    }

    void wait(std::unique_lock<std::mutex>& lock) {
        sampling_.changed_.wait_until(lock,
                                      std::min(deadline_, Clock::now() + std::chrono::milliseconds(20)));
    }

    bool piece(const Taken& taken, std::unique_lock<std::mutex>& lock) {
        lock.unlock();
        bool isDone = false;
        const auto began = Clock::now();
        try {
            isDone = sampling_.step(taken, pieceElements(deadline_ - Clock::now()), execution_);
        } catch (...) {
            lock.lock();
            sampling_.endPiece(taken, false, began);
            throw;
        }
        lock.lock();
        sampling_.endPiece(taken, isDone, began);
        return !hasEnded_ && !isLate();
    }

    BrickSampling& sampling_;
    Clock::time_point deadline_;
    Execution execution_;
    const std::function<void()>& whenDone_;
    std::thread::id caller_ = std::this_thread::get_id();
    bool hasEnded_ = false, hasGone_ = false;
};

// A thread of its own. Pieces are short, so that an order that is dropped isn't waited for.
void BrickSampling::serve(const std::stop_token& stop) {
    const Execution single{.threads = 1};
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
        const Taken taken = failure_ ? Taken{} : nextTask();
        if (!taken) {
            changed_.wait(lock, stop, [&] { return !failure_ && hasTask(); });
            continue;
        }
        lock.unlock();
        bool isDone = false;
        const auto began = Clock::now();
        std::exception_ptr failure;
        try {
            isDone = step(taken, 2 * StoppableSampling::kPieceElements, single);
        } catch (...) {
            failure = std::current_exception();
        }
        lock.lock();
        if (failure) failure_ = failure;
        endPiece(taken, isDone, began);
    }
}

bool BrickSampling::hasTask() const {
    for (const std::shared_ptr<Order>& order : queue_)
        for (const std::shared_ptr<Task>& task : order->tasks)
            if (!task->isDone && !task->isRunning) return true;
    return false;
}

void BrickSampling::waitForThreads(Clock::time_point deadline, const Execution& execution,
                                   const std::function<void()>& whenDone) {
    std::unique_lock lock(mutex_);
    while (true) {
        if (failure_) {
            changed_.notify_all();
            std::rethrow_exception(std::exchange(failure_, nullptr));
        }
        if (std::exchange(anyDone_, false)) {
            lock.unlock();
            whenDone();
            lock.lock();
            continue;
        }
        if (queue_.empty() || Clock::now() >= deadline) return;
        changed_.wait_until(lock, std::min(deadline, Clock::now() + std::chrono::milliseconds(20)));
        execution.throwIfCancelled();
    }
}

void BrickSampling::work(Clock::time_point deadline, const Execution& execution,
                         const std::function<void()>& whenDone) {
    if (!threads_.empty()) return waitForThreads(deadline, execution, whenDone);
    Execution single = execution.withoutProgress();
    single.threads = 1;
    Crew crew(*this, deadline, single, whenDone);
    parallelFor(execution.withoutProgress(), execution.threadCount(), [&](std::int64_t) { crew.work(); });
}

}  // namespace tessera
