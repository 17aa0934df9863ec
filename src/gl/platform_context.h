#pragma once

#include <memory>
#include <string>

#include "gl/gl_device.h"
#include "gl/gl_functions.h"

namespace tessera {

/// What a platform has to give: an OpenGL 4.5 core context that needs no display. Internal to this layer.
class PlatformContext {
  public:
    virtual ~PlatformContext() = default;
    /// On the calling thread; a context is current on one thread at a time.
    virtual void makeCurrent() = 0;
    virtual void releaseCurrent() noexcept = 0;
    virtual GlProcAddress getProcAddress(const char* name) const = 0;
    /// The library and the device, in words.
    virtual std::string detail() const = 0;
    virtual bool isSoftwareDevice() const = 0;
};

}  // namespace tessera
