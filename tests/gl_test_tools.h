#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "gl/gl_platform.h"

namespace tessera {

/// TESSERA_REQUIRE_GL=1 asks for Mesa's two platforms; a device that EGL enumerates is nobody's promise.
inline bool isGlRequired(GlPlatform platform) {
    const char* value = std::getenv("TESSERA_REQUIRE_GL");
    return value && std::string(value) == "1" && platform != GlPlatform::eglDevice;
}

/// "egl-device" as part of a test's name.
inline std::string testNameOf(GlPlatform platform) {
    std::string name(nameOf(platform));
    for (char& letter : name)
        if (letter == '-') letter = '_';
    return name;
}

}  // namespace tessera

/// Skips the test with the reason when the platform is not available, or fails when it is required.
#define TESSERA_NEEDS_GL(platform)                                                                   \
    do {                                                                                             \
        const std::string& reason = ::tessera::unavailableReason(platform);                          \
        if (!reason.empty() && ::tessera::isGlRequired(platform))                                    \
            FAIL() << ::tessera::nameOf(platform) << " is required and not available: " << reason;   \
        if (!reason.empty()) GTEST_SKIP() << "no " << ::tessera::nameOf(platform) << ": " << reason; \
    } while (false)
