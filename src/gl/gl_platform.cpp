#include "gl/gl_platform.h"

#include <array>
#include <exception>
#include <mutex>
#include <thread>

#include "gl/gl_context.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::array kPlatforms{GlPlatform::eglDevice, GlPlatform::eglSurfaceless, GlPlatform::osmesa};

/// What came of creating a context.
struct Probe {
    std::string reason;
    GlDeviceInfo info;
};

Probe runProbe(GlPlatform platform) {
    Probe probe;
    // On a thread of its own: the caller may have a context current.
    std::thread([&] {
        try {
            probe.info = GlContext(platform).info();
        } catch (const std::exception& error) {
            probe.reason = error.what();
        }
    }).join();
    return probe;
}

const Probe& probeOf(GlPlatform platform) {
    struct Slot {
        std::once_flag once;
        Probe probe;
    };
    static auto& slots = *new std::array<Slot, kPlatforms.size()>;  // usable until the process ends
    Slot& slot = slots[static_cast<std::size_t>(platform)];
    std::call_once(slot.once, [&] { slot.probe = runProbe(platform); });
    return slot.probe;
}

}  // namespace

std::span<const GlPlatform> glPlatforms() {
    return kPlatforms;
}

std::string_view nameOf(GlPlatform platform) {
    constexpr std::array<std::string_view, kPlatforms.size()> names{"egl-device", "egl-surfaceless",
                                                                    "osmesa"};
    return names[static_cast<std::size_t>(platform)];
}

GlPlatform parseGlPlatform(std::string_view name) {
    std::string names;
    for (const GlPlatform platform : kPlatforms) {
        if (nameOf(platform) == name) return platform;
        names += (names.empty() ? "" : ", ") + std::string(nameOf(platform));
    }
    throw InputError("no OpenGL platform is called '" + std::string(name) + "'; there are " + names);
}

const std::string& unavailableReason(GlPlatform platform) {
    return probeOf(platform).reason;
}

const GlDeviceInfo& glDeviceInfo(GlPlatform platform) {
    const Probe& probe = probeOf(platform);
    if (!probe.reason.empty())
        throw GlError("no OpenGL from " + std::string(nameOf(platform)) + ": " + probe.reason);
    return probe.info;
}

const std::vector<GlPlatform>& availableGlPlatforms() {
    static const auto& platforms = *new std::vector<GlPlatform>([] {
        const auto isThere = [](GlPlatform platform) { return unavailableReason(platform).empty(); };
        const bool hasDevice = isThere(GlPlatform::eglDevice);
        const bool isSoftwareDevice = hasDevice && glDeviceInfo(GlPlatform::eglDevice).isSoftware;
        std::vector<GlPlatform> found;
        if (hasDevice && !isSoftwareDevice) found.push_back(GlPlatform::eglDevice);
        for (const GlPlatform platform : {GlPlatform::eglSurfaceless, GlPlatform::osmesa})
            if (isThere(platform)) found.push_back(platform);
        if (isSoftwareDevice) found.push_back(GlPlatform::eglDevice);
        return found;
    }());
    return platforms;
}

GlPlatform chooseGlPlatform(std::optional<GlPlatform> wanted) {
    if (wanted) return glDeviceInfo(*wanted).platform;
    if (!availableGlPlatforms().empty()) return availableGlPlatforms().front();
    std::string reasons;
    for (const GlPlatform platform : kPlatforms)
        reasons += (reasons.empty() ? "" : "; ") + std::string(nameOf(platform)) + ": " +
                   unavailableReason(platform);
    throw GlError("there is no OpenGL 4.5 here (" + reasons + ")");
}

}  // namespace tessera
