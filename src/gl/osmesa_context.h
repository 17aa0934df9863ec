#pragma once

#include <memory>

#include "gl/platform_context.h"

namespace tessera {

/// Throws GlError with the reason, in one sentence, when there is no such context.
std::unique_ptr<PlatformContext> createOsmesaContext();

}  // namespace tessera
