#include "benchmark/compare_benchmarks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/median_interval.h"
#include "files/input_file.h"
#include "files/json_parse.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// By which all cases of an algorithm together may differ from the other algorithms' between two runs of one
/// build: three standard deviations on a virtual machine of two cores.
constexpr double kNoise = 0.12;
/// The same without others to compare with, and of all algorithms together.
constexpr double kNoiseAlone = 0.25;
/// So many algorithms tell together how much slower the machine was.
constexpr std::size_t kFewestOthers = 4;

/// A case that two documents may both have.
struct ComparedCase {
    std::string algorithm, what;
    MedianInterval ms;
};

/// By what it is.
std::map<std::string, ComparedCase> casesOf(const Json& document) {
    std::map<std::string, std::string> algorithms;
    for (const Json& variant : document.at("variants"))
        if (variant.at("role") != "again")
            algorithms[variant.at("name").get<std::string>()] = variant.at("algorithm").get<std::string>();
    std::map<std::string, ComparedCase> cases;
    const auto add = [&](const std::string& variant, const std::string& what, const Json& ms) {
        const auto found = algorithms.find(variant);
        if (found == algorithms.end()) return;
        const std::string name = fmt::format("{}, {}", variant, what);
        cases[name] = {found->second, name, intervalFrom(ms)};
    };
    for (const Json& run : document.at("runs"))
        add(run.at("variant"),
            fmt::format("{}, {}", run.at("criterion").get<std::string>(), run.at("asked").get<std::string>()),
            run.at("ms"));
    for (const Json& fit : document.at("scaling").at("elements"))
        for (const Json& point : fit.at("points"))
            add(fit.at("variant"), fmt::format("{} elements", point.at("x").get<std::int64_t>()),
                point.at("ms"));
    for (const Json& warm : document.at("warm"))
        add(warm.at("variant"),
            fmt::format("bound already, {} to {}", warm.at("case").get<std::string>(),
                        warm.at("to").get<std::string>()),
            warm.at("ms"));
    return cases;
}

}  // namespace

Json readBenchmark(const std::string& path) {
    Json document;
    try {
        document = parseJson<Json>(readWholeFile(path));
    } catch (const Json::exception&) {
        // Something that isn't JSON is none, either.
    }
    if (!document.is_object() || document.value("command", "") != "bench" || !document.contains("runs"))
        throw InputError(fmt::format("{}: it is no report.json of tessera bench", path));
    return document;
}

void checkComparable(const Json& earlier, const Json& later) {
    for (const char* key : {"mesh", "elements", "field"})
        if (earlier.at("input").at(key) != later.at("input").at(key))
            throw InputError(fmt::format("--compare: the earlier report has {} {}, this one {}", key,
                                         earlier["input"][key].dump(), later["input"][key].dump()));
    if (earlier.at("machine").at("threads") != later.at("machine").at("threads"))
        throw InputError(
            fmt::format("--compare: the earlier report was made with {} threads, this one with {}",
                        earlier["machine"]["threads"].dump(), later["machine"]["threads"].dump()));
}

Json compareBenchmarks(const Json& earlier, const Json& later) {
    checkComparable(earlier, later);
    const std::map<std::string, ComparedCase> before = casesOf(earlier), now = casesOf(later);
    std::map<std::string, std::vector<double>> byAlgorithm;
    Json cases = Json::array();
    for (const auto& [name, one] : now) {
        const auto found = before.find(name);
        if (found == before.end()) continue;
        const double ratio = one.ms.median / found->second.ms.median;
        byAlgorithm[one.algorithm].push_back(ratio);
        cases.push_back({{"case", name},
                         {"algorithm", one.algorithm},
                         {"ratio", ratio},
                         {"apart", !one.ms.overlaps(found->second.ms)}});
    }
    std::vector<double> medians;
    for (const auto& [algorithm, ratios] : byAlgorithm) medians.push_back(medianInterval(ratios).median);
    const bool hasOthers = medians.size() >= kFewestOthers;
    const double common = medians.empty() ? 1 : medianInterval(medians).median;
    const double yardstick =
        intervalFrom(later.at("yardstick")).median / intervalFrom(earlier.at("yardstick")).median;

    Json algorithms = Json::array();
    std::vector<std::string> sentences;
    for (auto& [algorithm, ratios] : byAlgorithm) {
        if (hasOthers)
            for (double& ratio : ratios) ratio /= common;
        const MedianInterval interval = medianInterval(ratios);
        const double limit = 1 + (hasOthers ? kNoise : kNoiseAlone);
        const bool isSlower = interval.median > limit && interval.low > 1;
        const bool isFaster = interval.median < 1 / limit && interval.high < 1;
        const char* verdict = isSlower ? "slower" : isFaster ? "faster" : "equal";
        algorithms.push_back(
            {{"algorithm", algorithm}, {"ratio", intervalJson(interval)}, {"verdict", verdict}});
        if (isSlower || isFaster)
            sentences.push_back(fmt::format(
                "{} got {}: {:.3g} times the earlier time{}, the median of {} cases ({:.3g} to {:.3g}).",
                algorithm, verdict, interval.median, hasOthers ? " when all algorithms' is 1" : "",
                interval.count, interval.low, interval.high));
    }
    if (sentences.empty())
        sentences.push_back(
            fmt::format("No algorithm got faster or slower beyond noise: {} cases compared.", cases.size()));
    if (hasOthers && std::abs(std::log(common)) > std::log(1 + kNoiseAlone))
        sentences.push_back(fmt::format(
            "All together took {:.3g} times the earlier time, a fixed piece of work {:.3g} times: {}.",
            common, yardstick,
            std::abs(std::log(common / yardstick)) > std::log(1 + kNoiseAlone)
                ? "the build as a whole got slower or faster, or the machine differs"
                : "the machine was busier or idler"));
    for (const char* key : {"processor", "opengl"})
        if (earlier.at("machine").at(key) != later.at("machine").at(key))
            sentences.push_back(fmt::format("The earlier report is from another machine or driver: {}.",
                                            earlier["machine"][key].dump()));
    return {{"commit", earlier.at("machine").at("commit")},
            {"date", earlier.at("machine").at("date")},
            {"common", common},
            {"yardstick", yardstick},
            {"algorithms", std::move(algorithms)},
            {"cases", std::move(cases)},
            {"sentences", std::move(sentences)}};
}

}  // namespace tessera
