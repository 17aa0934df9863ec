#include "benchmark/machine_text.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <ctime>
#include <fstream>

#include "base/machine_memory.h"
#include "base/text.h"
#include "gl/gl_platform.h"
#include "gl/gl_thread.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// What stands behind a name at the begin of a line of a text file of the system's; empty when it isn't
/// there.
std::string valueIn(const char* path, const std::string& name) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
        if (!line.starts_with(name)) continue;
        std::string value = line.substr(std::min(line.size(), line.find_first_of(":=") + 1));
        value.erase(0, value.find_first_not_of(" \t\""));
        value.erase(value.find_last_not_of(" \t\"") + 1);
        return singleLine(value);
    }
    return {};
}

std::string systemText() {
    utsname names{};
    std::string text = valueIn("/etc/os-release", "PRETTY_NAME");
    if (::uname(&names) == 0)
        text += fmt::format("{}{} {}", text.empty() ? "" : ", ", names.sysname, names.release);
    return text;
}

Json textOrNull(const std::string& text) {
    return text.empty() ? Json(nullptr) : Json(text);
}

Json deviceJson(const BindOptions& bind) {
    try {
        const GlDeviceInfo& info = deviceOf(bind).info();
        return {{"renderer", info.renderer},
                {"vendor", info.vendor},
                {"version", info.version},
                {"platform", nameOf(info.platform)},
                {"emulated", info.isSoftware}};
    } catch (const GlError&) {
        return nullptr;
    }
}

}  // namespace

Json machineJson(int threads, std::span<const BenchmarkVariant> variants, const BindOptions& bind) {
    const bool hasDevice = std::any_of(variants.begin(), variants.end(), [](const BenchmarkVariant& v) {
        return v.resampler->info().isOnDevice;
    });
    const std::time_t now = std::time(nullptr);
    return {{"processor", textOrNull(valueIn("/proc/cpuinfo", "model name"))},
            {"threads", threads},
            {"memory_bytes", machineMemoryBytes()},
            {"system", textOrNull(systemText())},
#ifdef __clang__
            {"compiler", fmt::format("Clang {}", __clang_version__)},
#else
            {"compiler", fmt::format("GCC {}", __VERSION__)},
#endif
            {"build", TESSERA_BUILD_TYPE},
            {"commit", textOrNull(TESSERA_COMMIT)},
            {"date", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now))},
            {"opengl", hasDevice ? deviceJson(bind) : Json(nullptr)}};
}

}  // namespace tessera
