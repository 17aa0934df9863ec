#pragma once

#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <type_traits>
#include <utility>

#include "gl/gl_context.h"

namespace tessera {

/// A context on a thread of its own, behind a queue. Tasks run one at a time, in the order in which they
/// came, from any number of threads. Each begins with GlContext::resetState() and ends with throwIfFailed().
class GlThread {
  public:
    /// Waits until the context stands. @throws GlError with the reason when it can't be had.
    explicit GlThread(GlPlatform platform, const GlContextOptions& options = {});
    /// Runs what is queued, then ends the context and the thread.
    ~GlThread();
    GlThread(const GlThread&) = delete;
    GlThread& operator=(const GlThread&) = delete;

    /// Runs task(GlContext&) on the OpenGL thread, waits, and returns its result by value. What the task
    /// throws is thrown here; when it throws nothing and OpenGL failed, GlError is. From inside a task it
    /// runs at once.
    template <class Task>
    auto run(Task&& task) -> std::decay_t<std::invoke_result_t<Task&, GlContext&>> {
        using Result = std::invoke_result_t<Task&, GlContext&>;
        if constexpr (std::is_void_v<Result>) {
            runAndWait([&](GlContext& context) { task(context); });
        } else {
            std::optional<std::decay_t<Result>> result;
            runAndWait([&](GlContext& context) { result.emplace(task(context)); });
            return std::move(*result);
        }
    }

    /// Queues the task and returns at once. The future gives its result or what it threw; dropping the future
    /// drops the failure. A handle may not be its result: the future could die on another thread.
    template <class Task>
    auto post(Task&& task) -> std::future<std::decay_t<std::invoke_result_t<Task&, GlContext&>>> {
        using Result = std::decay_t<std::invoke_result_t<Task&, GlContext&>>;
        auto promise = std::make_shared<std::promise<Result>>();
        auto future = promise->get_future();
        auto shared = std::make_shared<std::decay_t<Task>>(std::forward<Task>(task));
        enqueue([this, promise = std::move(promise), shared = std::move(shared)]() mutable {
            std::exception_ptr failure;
            std::conditional_t<std::is_void_v<Result>, bool, std::optional<Result>> result{};
            try {
                perform([&](GlContext& context) {
                    if constexpr (std::is_void_v<Result>)
                        (*shared)(context);
                    else
                        result.emplace((*shared)(context));
                });
            } catch (...) {
                failure = std::current_exception();
            }
            shared.reset();  // what the task holds ends on this thread, before its caller goes on
            if (failure)
                promise->set_exception(std::move(failure));
            else if constexpr (std::is_void_v<Result>)
                promise->set_value();
            else
                promise->set_value(std::move(*result));
        });
        return future;
    }

    /// Deletes an object with handles on the OpenGL thread, and waits. Of a device that is lost nothing more
    /// is to be learnt: what OpenGL says meanwhile is dropped.
    template <class Object>
    void dispose(Object* object) noexcept {
        if (isThisThread()) {
            delete object;
            return;
        }
        try {
            run([object](GlContext& context) {
                delete object;
                context.discardFailures();
            });
        } catch (...) {  // it is deleted all the same
        }
    }

    GlPlatform platform() const { return info_.platform; }
    const GlDeviceInfo& info() const { return info_; }
    bool isThisThread() const { return std::this_thread::get_id() == thread_.get_id(); }

  private:
    void runAndWait(const std::function<void(GlContext&)>& task);
    void perform(const std::function<void(GlContext&)>& task);  // on the OpenGL thread
    void enqueue(std::function<void()> job);
    void serve(GlPlatform platform, const GlContextOptions& options, std::promise<void> started);

    std::mutex mutex_;
    std::condition_variable arrived_;
    std::deque<std::function<void()>> jobs_;
    bool isEnding_ = false;
    GlContext* context_ = nullptr;  // only the OpenGL thread looks at it
    GlDeviceInfo info_;
    std::thread thread_;
};

/// The process's own thread for a platform, made when first asked for; lives until the process ends.
/// @throws GlError when the platform is not available.
GlThread& sharedGlThread(GlPlatform platform);

}  // namespace tessera
