#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
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
    std::int64_t maxMemoryBytes = 0;  ///< that is aimed at; emulated ones take 60 MB each. 0: no bound

    /// Memory isn't bounded to less than 1 GiB.
    bool isRoomy() const { return maxMemoryBytes == 0 || maxMemoryBytes >= std::int64_t(1) << 30; }
};

/// What came of it.
struct GlTrialResult {
    std::string reason;    ///< why no OpenGL can be had from the platform; empty where it can
    bool isFault = false;  ///< the driver crashed or stalled
    std::string found{};   ///< what the trial's other side told; empty where it told a reason or nothing
};

/// Tries drivers, each in a process of its own, which is told one of the words and does what serveTrial's
/// caller does for that: all at once, or in turn where memory is bounded to less than 1 GiB; those after the
/// first then have what is left of the seconds, at least 1.5 of them. A program that knows nothing of trials
/// gives no reason and tells nothing.
/// @throws Cancelled.
std::vector<GlTrialResult> tryDrivers(const GlTrial& trial, std::span<const std::string> words);

/// The other side of tryDrivers, to be called before anything else in the program that it starts: calls `use`
/// with the word. It tells what that returns, some text; what that throws is the reason. Returns the exit
/// code; return it from main, as drivers tidy up behind it. @throws InputError when it wasn't started by
/// tryDrivers. @param arguments those behind GlTrial::arguments.
int serveTrial(std::span<const std::string> arguments,
               const std::function<std::string(const std::string&)>& use);

/// What tryGl finds begins with one of these: a device that the processor emulates, or another. driverText()
/// follows.
inline constexpr std::string_view kSoftwareFound = "software: ", kHardwareFound = "hardware: ";

/// tryDrivers for platforms: makes a context, compiles shaders, draws and reads back.
std::vector<GlTrialResult> tryGl(const GlTrial& trial, std::span<const GlPlatform> platforms);
/// serveTrial for platforms.
int serveGlTrial(std::span<const std::string> arguments);

}  // namespace tessera
