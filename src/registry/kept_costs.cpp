#include "registry/kept_costs.h"

#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/text.h"
#include "files/atomic_file.h"
#include "files/input_file.h"
#include "files/json_parse.h"
#include "gl/gl_platform.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostBytes = 256 << 10;

std::string processorName() {
    std::ifstream lines("/proc/cpuinfo");
    for (std::string line; std::getline(lines, line);)
        if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
    return "processor";
}

std::string driverOf(const std::string& target) {
    for (const GlPlatform platform : glPlatforms())
        if (nameOf(platform) == target) return "; " + glDriver(platform);
    return {};
}

}  // namespace

std::string costKey(const Resampler& resampler, const BindOptions& options, const Execution& execution) {
    const std::string target = options.target.empty() ? resampler.targets().front() : options.target;
    return singleLine(
        "tessera " TESSERA_VERSION "; " + processorName() + ", " +
        std::to_string(std::thread::hardware_concurrency()) + " threads, " +
        std::to_string(execution.threadCount()) + " used; " + resampler.name() + " " + target + " " +
        std::string(nameOf(options.format)) +
        (resampler.info().isOnDevice
             ? ", primitives by the " + std::string(nameOf(options.primitives)) + driverOf(target)
             : std::string()));
}

std::string costsPath() {
    const auto variable = [](const char* name) {
        const char* value = std::getenv(name);
        return fs::path(value ? value : "");
    };
    fs::path folder = variable("XDG_CACHE_HOME");
    if (!folder.is_absolute()) folder = variable("HOME") / ".cache";
    return folder.is_absolute() ? (folder / "tessera" / "algorithm_times.json").string() : std::string();
}

KeptCosts readCosts(const std::string& path) {
    KeptCosts kept;
    try {
        const auto file = parseJson<nlohmann::json>(readWholeFile(path, kMostBytes));
        for (const auto& [key, entry] : file.items()) {
            const CostModel cost{entry.at("fixed_ms"), entry.at("element_ms"), entry.at("point_ms"),
                                 entry.at("slice_ms")};
            if (cost.isSane()) kept.emplace(key, cost);
        }
    } catch (const std::exception&) {  // measured anew, then
        return {};
    }
    return kept;
}

void keepCosts(const std::string& path, const KeptCosts& added) {
    try {
        fs::create_directories(fs::path(path).parent_path());
        nlohmann::json file = nlohmann::json::object();
        KeptCosts all = added;
        all.merge(readCosts(path));
        for (const auto& [key, cost] : all)
            file[key] = {{"fixed_ms", cost.fixedMs},
                         {"element_ms", cost.elementMs},
                         {"point_ms", cost.pointMs},
                         {"slice_ms", cost.sliceMs}};
        const std::string text = file.dump(1) + "\n";
        writeFileAtomically(path, text.size() < kMostBytes ? text : "{}");
    } catch (const std::exception&) {  // the next program measures anew
    }
}

}  // namespace tessera
