#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "gl/gl_device.h"
#include "gl/gl_functions.h"
#include "tessera/error.h"

namespace tessera {

class PlatformContext;

/// The device has no memory for what is asked of it.
class GlMemoryError : public GlError {
  public:
    using GlError::GlError;
};

/// How a context is made.
struct GlContextOptions {
    bool debug = false;  ///< ask the driver for a debug context: more messages, some of them slow to find
    /// Called once with the functions as they were loaded, before any is used but glGetIntegerv; puts others
    /// in their place, to record calls or to make them fail.
    void (*replace)(GlFunctions&) = nullptr;
};

/// The objects of one context that are alive. The context and its handles share it, so that a handle which is
/// destroyed late, or on another thread, is noticed instead of calling OpenGL without a context.
class GlObjects {
  public:
    using Deleter = void (*)(const GlFunctions& gl, std::uintptr_t name);

    const GlFunctions gl;

    explicit GlObjects(const GlFunctions& functions) : gl(functions) {}
    void add() noexcept;
    /// Deletes the object; on any thread but the context's it is kept for deleteStrays(), and after the
    /// context's end it is only counted.
    void remove(std::uintptr_t name, Deleter deleter) noexcept;
    std::int64_t liveCount() const;

  private:
    friend class GlContext;
    struct Stray {
        std::uintptr_t name;
        Deleter deleter;
    };
    /// Deletes what other threads dropped; returns how many there were.
    std::size_t deleteStrays();

    mutable std::mutex mutex_;
    std::thread::id thread_ = std::this_thread::get_id();
    bool isContextAlive_ = true;
    std::int64_t liveCount_ = 0;
    std::vector<Stray> strays_;
};

/// A headless OpenGL 4.5 core context, current on the thread that made it, for its whole life. Most code gets
/// one from GlThread.
class GlContext {
  public:
    /// @throws GlError with the reason when the platform gives no such context.
    explicit GlContext(GlPlatform platform, const GlContextOptions& options = {});
    ~GlContext();
    GlContext(const GlContext&) = delete;
    GlContext& operator=(const GlContext&) = delete;

    const GlFunctions& functions() const { return objects_->gl; }
    const GlDeviceInfo& info() const { return info_; }
    GlPlatform platform() const { return info_.platform; }

    /// Throws GlError with everything that went wrong since the last call: messages of OpenGL's debug output
    /// that are errors or undefined behaviour of high severity, and glGetError; GlMemoryError when there was
    /// no memory. Throws InternalError when a handle was destroyed on another thread.
    void throwIfFailed();
    /// Whether the device lost the context, which can't be used any more. Only drivers that can tell say so.
    bool isLost() noexcept;
    /// Forgets what went wrong since the last call.
    void discardFailures() noexcept;

    /// Brings the state that Tessera touches back to OpenGL's defaults, but pixel rows are packed (alignment
    /// of 1). GlThread calls it before every task.
    void resetState();

    /// Objects made through handles of this context and not yet destroyed.
    std::int64_t liveObjects() const { return objects_->liveCount(); }
    const std::shared_ptr<GlObjects>& objects() const { return objects_; }

  private:
    void listenToDebugOutput();

    std::unique_ptr<PlatformContext> platformContext_;
    std::shared_ptr<GlObjects> objects_;
    GlDeviceInfo info_;
    bool isLost_ = false;
    std::vector<std::string> messages_;  // collected by the debug callback
};

}  // namespace tessera
