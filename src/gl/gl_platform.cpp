#include "gl/gl_platform.h"

#include <algorithm>
#include <array>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "gl/gl_context.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::array kPlatforms{GlPlatform::eglDevice, GlPlatform::eglSurfaceless, GlPlatform::osmesa};

/// What a trial, or creating a context, found.
struct Probe {
    std::string reason;
    bool isFault = false;
    bool isSoftware = false;
    std::string driver{};
};

/// What creating a context told; a reason, where it failed.
struct OpenedDevice {
    std::string reason;
    GlDeviceInfo info;
};

OpenedDevice openDevice(GlPlatform platform) {
    OpenedDevice device;
    // On a thread of its own: the caller may have a context current.
    std::thread([&] {
        try {
            device.info = GlContext(platform).info();
        } catch (const std::exception& error) {
            device.reason = error.what();
        }
    }).join();
    return device;
}

/// What is known of the platforms in this process.
class Probes {
  public:
    void setTrial(GlTrial trial) {
        const std::lock_guard lock(mutex_);
        trial_ = std::move(trial);
    }

    bool isRoomy() {
        const std::lock_guard lock(mutex_);
        return !trial_ || trial_->isRoomy();
    }

    /// Finds out what isn't known yet. Only the first call for a platform takes time.
    void probe(std::span<const GlPlatform> platforms) {
        const std::lock_guard lock(mutex_);
        std::vector<GlPlatform> unknown;
        for (const GlPlatform platform : platforms)
            if (!slot(platform)) unknown.push_back(platform);
        std::vector<GlTrialResult> results(unknown.size());
        if (trial_ && !unknown.empty()) results = tryGl(*trial_, unknown);
        for (std::size_t i = 0; i < unknown.size(); ++i) {
            GlTrialResult& result = results[i];
            const bool isSoftware = result.found.starts_with(kSoftwareFound);
            if (isSoftware || result.found.starts_with(kHardwareFound)) {
                slot(unknown[i]) = {{}, false, isSoftware, result.found.substr(result.found.find(' ') + 1)};
            } else if (result.reason.empty()) {
                const OpenedDevice& device = opened(unknown[i]);
                slot(unknown[i]) = {device.reason, false, device.info.isSoftware, driverText(device.info)};
            } else {
                slot(unknown[i]) = {std::move(result.reason), result.isFault};
            }
        }
    }

    /// Opens a device that is there in this process; only the first call for a platform takes time.
    const OpenedDevice& open(GlPlatform platform) {
        const std::lock_guard lock(mutex_);
        return opened(platform);
    }

    /// What was found; it doesn't change any more. Null before.
    const Probe* find(GlPlatform platform) {
        const std::lock_guard lock(mutex_);
        const std::optional<Probe>& known = slot(platform);
        return known ? &*known : nullptr;
    }

  private:
    std::optional<Probe>& slot(GlPlatform platform) { return slots_[static_cast<std::size_t>(platform)]; }

    const OpenedDevice& opened(GlPlatform platform) {
        std::optional<OpenedDevice>& device = opened_[static_cast<std::size_t>(platform)];
        if (!device) device = openDevice(platform);
        return *device;
    }

    std::mutex mutex_;
    std::optional<GlTrial> trial_;
    std::array<std::optional<Probe>, kPlatforms.size()> slots_;
    std::array<std::optional<OpenedDevice>, kPlatforms.size()> opened_;
};

Probes& probes() {
    static Probes& all = *new Probes;  // usable until the process ends
    return all;
}

const Probe& probeOf(GlPlatform platform) {
    probes().probe(std::span(&platform, 1));
    return *probes().find(platform);
}

/// "egl-device, osmesa: the driver crashed", each reason once, as far as platforms were probed.
/// @param isTold which of them.
std::string reasonsOf(bool (*isTold)(const Probe&)) {
    std::vector<std::pair<std::string, std::string>> named;  // names, and their reason
    for (const GlPlatform platform : kPlatforms) {
        const Probe* probe = probes().find(platform);
        if (!probe || !isTold(*probe)) continue;
        const auto same = std::find_if(named.begin(), named.end(),
                                       [&](const auto& entry) { return entry.second == probe->reason; });
        if (same == named.end())
            named.emplace_back(nameOf(platform), probe->reason);
        else
            same->first += ", " + std::string(nameOf(platform));
    }
    std::string text;
    for (const auto& [names, reason] : named) text += (text.empty() ? "" : "; ") + names + ": " + reason;
    return text;
}

void throwReason(GlPlatform platform, const std::string& reason) {
    if (!reason.empty()) throw GlError("no OpenGL from " + std::string(nameOf(platform)) + ": " + reason);
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

void tryGlFirst(GlTrial trial) {
    probes().setTrial(std::move(trial));
}

bool isGlRoomy() {
    return probes().isRoomy();
}

const std::string& unavailableReason(GlPlatform platform) {
    return probeOf(platform).reason;
}

std::string noGlReason() {
    probes().probe(kPlatforms);
    return "there is no OpenGL 4.5 here (" +
           reasonsOf([](const Probe& probe) { return !probe.reason.empty(); }) + ")";
}

std::string glFaults() {
    const std::string reasons = reasonsOf([](const Probe& probe) { return probe.isFault; });
    return reasons.empty() ? reasons : "no OpenGL from " + reasons;
}

void throwIfUnavailable(GlPlatform platform) {
    throwReason(platform, unavailableReason(platform));
}

const std::string& openGlDevice(GlPlatform platform) {
    const std::string& reason = unavailableReason(platform);
    return reason.empty() ? probes().open(platform).reason : reason;
}

const GlDeviceInfo& glDeviceInfo(GlPlatform platform) {
    throwReason(platform, openGlDevice(platform));
    return probes().open(platform).info;
}

bool isSoftwareGl(GlPlatform platform) {
    return probeOf(platform).isSoftware;
}

const std::string& glDriver(GlPlatform platform) {
    return probeOf(platform).driver;
}

const std::vector<GlPlatform>& availableGlPlatforms() {
    static const auto& platforms = *new std::vector<GlPlatform>([] {
        probes().probe(kPlatforms);
        const auto isThere = [](GlPlatform platform) { return unavailableReason(platform).empty(); };
        const bool hasDevice = isThere(GlPlatform::eglDevice);
        const bool isSoftwareDevice = hasDevice && isSoftwareGl(GlPlatform::eglDevice);
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
    if (wanted) {
        throwIfUnavailable(*wanted);
        return *wanted;
    }
    if (availableGlPlatforms().empty()) throw GlError(noGlReason());
    for (const GlPlatform platform : availableGlPlatforms())
        if (openGlDevice(platform).empty()) return platform;
    return glDeviceInfo(availableGlPlatforms().front()).platform;  // throws why the best one can't be opened
}

}  // namespace tessera
