#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gl/gl_device.h"
#include "gl/gl_trial.h"

namespace tessera {

/// Every platform, in the order of their names in listings.
std::span<const GlPlatform> glPlatforms();

/// "egl-device", "egl-surfaceless", "osmesa".
std::string_view nameOf(GlPlatform platform);

/// @throws InputError, listing the names there are.
GlPlatform parseGlPlatform(std::string_view name);

/// From now on a platform is tried by this program before this process uses it for the first time.
void tryGlFirst(GlTrial trial);

/// There is memory for drivers that may not be needed: GlTrial::isRoomy(), or there is no trial.
bool isGlRoomy();

/// Why no OpenGL 4.5 core context can be had from this platform, in one sentence; empty when it can. Found
/// out once a process, by the trial, or where none is set by creating one. May be called from any thread, and
/// leaves the caller's context alone. @throws Cancelled as the trial does.
const std::string& unavailableReason(GlPlatform platform);

/// Why none of the platforms can be had: "there is no OpenGL 4.5 here (osmesa: ...)".
std::string noGlReason();
/// A sentence about the platforms whose drivers crashed or stalled when they were tried; empty without one.
/// Tries none.
std::string glFaults();

/// @throws GlError with the reason when the platform is not available.
void throwIfUnavailable(GlPlatform platform);

/// The processor emulates the device of an available platform.
bool isSoftwareGl(GlPlatform platform);

/// driverText() of an available platform's device.
const std::string& glDriver(GlPlatform platform);

/// Opens the device in this process; only the first call for a platform takes time. Why that isn't possible,
/// which it may not be though a trial found it available; else empty.
const std::string& openGlDevice(GlPlatform platform);

/// The device that an available platform gives. Opens it in this process.
/// @throws GlError with the reason when it is not available.
const GlDeviceInfo& glDeviceInfo(GlPlatform platform);

/// The available platforms, all of them tried at once, best first: egl-device when it is real hardware,
/// egl-surfaceless, osmesa, and egl-device when it is software.
const std::vector<GlPlatform>& availableGlPlatforms();

/// The platform asked for or, when none is, the best one of those that can be opened in this process.
/// @throws GlError with every reason that matters when there is none.
GlPlatform chooseGlPlatform(std::optional<GlPlatform> wanted = {});

}  // namespace tessera
