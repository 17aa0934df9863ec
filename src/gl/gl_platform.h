#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gl/gl_device.h"

namespace tessera {

/// Every platform, in the order of their names in listings.
std::span<const GlPlatform> glPlatforms();

/// "egl-device", "egl-surfaceless", "osmesa".
std::string_view nameOf(GlPlatform platform);

/// @throws InputError, listing the names there are.
GlPlatform parseGlPlatform(std::string_view name);

/// Why no OpenGL 4.5 core context can be had from this platform, in one sentence; empty when it can. Found
/// out by creating one, once a process. May be called from any thread, and leaves the caller's context alone.
const std::string& unavailableReason(GlPlatform platform);

/// The device that an available platform gives.
/// @throws GlError with the reason when it is not available.
const GlDeviceInfo& glDeviceInfo(GlPlatform platform);

/// The available platforms, best first: egl-device when it is real hardware, egl-surfaceless, osmesa, and
/// egl-device when it is software.
const std::vector<GlPlatform>& availableGlPlatforms();

/// The platform asked for or, when none is, the best one.
/// @throws GlError with every reason that matters when there is none.
GlPlatform chooseGlPlatform(std::optional<GlPlatform> wanted = {});

}  // namespace tessera
