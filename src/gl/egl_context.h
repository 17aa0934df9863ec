#pragma once

#include <memory>

#include "gl/platform_context.h"

namespace tessera {

/// Each throws GlError with the reason, in one sentence, when the platform gives no such context.
std::unique_ptr<PlatformContext> createEglDeviceContext(bool debug);
std::unique_ptr<PlatformContext> createEglSurfacelessContext(bool debug);

}  // namespace tessera
