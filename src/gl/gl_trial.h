#pragma once

#include <atomic>
#include <span>
#include <string>
#include <vector>

#include "gl/gl_device.h"

namespace tessera {

/// The word by which the programs tessera and tessera_read_mesh call serveGlTrial.
inline constexpr const char* kTryGlCommand = "try-gl";

/// A program that calls serveGlTrial, which tries OpenGL in a separate process: a driver that crashes or
/// stalls there costs no more than a reason.
struct GlTrial {
    std::string executable;
    std::vector<std::string> arguments;  ///< before those that serveGlTrial gets
    double seconds = 20;                 ///< that it may take until the end
    const std::atomic<bool>* cancel = nullptr;
};

/// What came of it.
struct GlTrialResult {
    std::string reason;    ///< why no OpenGL can be had from the platform; empty where it can
    bool isFault = false;  ///< the driver crashed or stalled
};

/// Tries the platforms at once, each in a process of its own: makes a context, compiles shaders, draws and
/// reads back. A program that knows nothing of trials gives no reason. @throws Cancelled.
std::vector<GlTrialResult> tryGl(const GlTrial& trial, std::span<const GlPlatform> platforms);

/// The other side of tryGl, to be called before anything else in the program that it starts. Returns the exit
/// code; return it from main, as drivers tidy up behind it. @throws InputError when it wasn't started by
/// tryGl. @param arguments those behind GlTrial::arguments.
int serveGlTrial(std::span<const std::string> arguments);

}  // namespace tessera
