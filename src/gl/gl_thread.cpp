#include "gl/gl_thread.h"

#include <array>

#include "base/check.h"
#include "gl/gl_platform.h"

namespace tessera {

GlThread::GlThread(GlPlatform platform, const GlContextOptions& options) {
    std::promise<void> started;
    std::future<void> standing = started.get_future();
    thread_ = std::thread([this, platform, options, started = std::move(started)]() mutable {
        serve(platform, options, std::move(started));
    });
    try {
        standing.get();
    } catch (...) {
        thread_.join();
        throw;
    }
}

GlThread::~GlThread() {
    {
        const std::lock_guard lock(mutex_);
        isEnding_ = true;
    }
    arrived_.notify_one();
    thread_.join();
}

void GlThread::serve(GlPlatform platform, const GlContextOptions& options, std::promise<void> started) {
    std::optional<GlContext> context;
    try {
        context.emplace(platform, options);
        info_ = context->info();
        context_ = &*context;
    } catch (...) {
        started.set_exception(std::current_exception());
        return;
    }
    started.set_value();
    for (;;) {
        std::function<void()> job;
        {
            std::unique_lock lock(mutex_);
            arrived_.wait(lock, [&] { return isEnding_ || !jobs_.empty(); });
            if (jobs_.empty()) return;
            job = std::move(jobs_.front());
            jobs_.pop_front();
        }
        job();
    }
}

void GlThread::perform(const std::function<void(GlContext&)>& task) {
    try {
        context_->resetState();
        task(*context_);
    } catch (...) {
        // Of a lost device all that was read back is garbage, and so is what a task makes of it.
        if (context_->isLost()) context_->throwIfFailed();
        // The task's own exception says more than what OpenGL noticed on the way.
        context_->discardFailures();
        throw;
    }
    context_->throwIfFailed();
}

void GlThread::enqueue(std::function<void()> job) {
    {
        const std::lock_guard lock(mutex_);
        TESSERA_CHECK(!isEnding_, "a task was queued on an OpenGL thread that is ending");
        jobs_.push_back(std::move(job));
    }
    arrived_.notify_one();
}

void GlThread::runAndWait(const std::function<void(GlContext&)>& task) {
    if (isThisThread()) {
        task(*context_);
        context_->throwIfFailed();
        return;
    }
    std::mutex mutex;
    std::condition_variable finished;
    bool isDone = false;
    std::exception_ptr failure;
    enqueue([&] {
        std::exception_ptr caught;
        try {
            perform(task);
        } catch (...) {
            caught = std::current_exception();
        }
        // The caller is the exception's only owner when it wakes, and may leave as soon as the lock is free.
        const std::lock_guard lock(mutex);
        failure = std::move(caught);
        isDone = true;
        finished.notify_one();
    });
    std::unique_lock lock(mutex);
    finished.wait(lock, [&] { return isDone; });
    if (failure) std::rethrow_exception(std::exchange(failure, nullptr));
}

GlThread& sharedGlThread(GlPlatform platform) {
    // Never destroyed: at exit other static objects, and Mesa's own, may already be gone. An idle thread that
    // waits for a task harms nobody.
    struct Slot {
        std::mutex mutex;
        GlThread* thread = nullptr;
    };
    static auto& slots = *new std::array<Slot, 3>;
    Slot& slot = slots[static_cast<std::size_t>(platform)];
    const std::lock_guard lock(slot.mutex);
    if (!slot.thread) slot.thread = new GlThread(chooseGlPlatform(platform));
    return *slot.thread;
}

}  // namespace tessera
