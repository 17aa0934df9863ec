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

/// By which all cases of an algorithm together may differ from the run as a whole between two runs of one
/// build: three standard deviations on a virtual machine of two cores.
constexpr double kNoise = 0.15;
/// The same without a measure of the run as a whole, and of that itself.
constexpr double kNoiseAlone = 0.25;
/// Fewer ratios have no interval of 95 %.
constexpr std::size_t kFewestCases = 6;

/// A case that two documents may both have.
struct ComparedCase {
    std::string algorithm, family;  ///< family: "processor", "device", "peer"
    MedianInterval ms;
};

/// By what it is.
std::map<std::string, ComparedCase> casesOf(const Json& document) {
    std::map<std::string, ComparedCase> kinds, cases;
    for (const Json& variant : document.at("variants")) {
        if (variant.at("role") == "again") continue;
        const char* family = variant.at("role") == "peer"         ? "peer"
                             : variant.at("primitives").is_null() ? "processor"
                                                                  : "device";
        kinds[variant.at("name").get<std::string>()] = {
            variant.at("algorithm").get<std::string>(), family, {}};
    }
    const auto add = [&](const std::string& variant, const std::string& what, const Json& ms) {
        const auto found = kinds.find(variant);
        if (found == kinds.end()) return;
        ComparedCase one = found->second;
        one.ms = intervalFrom(ms);
        if (!(one.ms.median > 0)) throw InputError("a time isn't above 0");
        cases[fmt::format("{}, {}", variant, what)] = one;
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
    try {
        Json document = parseJson<Json>(readWholeFile(path));
        // All that is used later on.
        if (document.at("command") == "bench") {
            casesOf(document);
            intervalFrom(document.at("yardstick"));
            for (const char* key : {"mesh", "elements", "field"}) document.at("input").at(key);
            for (const char* key : {"threads", "processor", "opengl", "commit", "date"})
                document.at("machine").at(key);
            return document;
        }
    } catch (const Json::exception&) {
        // It isn't one, either.
    }
    throw InputError(fmt::format("{}: it is no report.json of tessera bench, or of another version", path));
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
    std::map<std::string, std::vector<double>> byAlgorithm, byFamily;
    std::map<std::string, std::string> familyOf;
    Json cases = Json::array();
    for (const auto& [name, one] : now) {
        const auto found = before.find(name);
        if (found == before.end()) continue;
        const double ratio = one.ms.median / found->second.ms.median;
        byAlgorithm[one.algorithm].push_back(ratio);
        byFamily[one.family].push_back(ratio);
        familyOf[one.algorithm] = one.family;
        cases.push_back({{"case", name},
                         {"algorithm", one.algorithm},
                         {"ratio", ratio},
                         {"apart", !one.ms.overlaps(found->second.ms)}});
    }
    const double yardstick =
        later.at("yardstick").is_null()
            ? 1
            : intervalFrom(later.at("yardstick")).median / intervalFrom(earlier.at("yardstick")).median;
    // A vote for each kind of code, so that a change to what several algorithms share can't outvote the rest.
    std::vector<double> votes;
    for (const auto& [family, ratios] : byFamily) votes.push_back(medianInterval(ratios).median);
    if (votes.size() == 2) votes.push_back(yardstick);
    const bool hasOthers = votes.size() > 2;
    const double common = votes.empty() ? 1 : medianInterval(votes).median;

    Json algorithms = Json::array();
    std::vector<std::string> sentences;
    for (auto& [algorithm, ratios] : byAlgorithm) {
        if (hasOthers)
            for (double& ratio : ratios) ratio /= common;
        const MedianInterval interval = medianInterval(ratios);
        const double limit = 1 + (hasOthers ? kNoise : kNoiseAlone);
        const bool isJudged = interval.count >= kFewestCases && familyOf[algorithm] != "peer";
        const bool isSlower = isJudged && interval.median > limit && interval.low > 1;
        const bool isFaster = isJudged && interval.median < 1 / limit && interval.high < 1;
        const char* verdict = !isJudged ? "not judged" : isSlower ? "slower" : isFaster ? "faster" : "equal";
        algorithms.push_back(
            {{"algorithm", algorithm}, {"ratio", intervalJson(interval)}, {"verdict", verdict}});
        if (isSlower || isFaster)
            sentences.push_back(fmt::format(
                "{} got {}: {:.3g} times the earlier time{}, the median of {} cases ({:.3g} to {:.3g}).",
                algorithm, verdict, interval.median, hasOthers ? " when that of the whole run is 1" : "",
                interval.count, interval.low, interval.high));
    }
    if (sentences.empty())
        sentences.push_back(
            fmt::format("No algorithm got faster or slower beyond noise: {} cases compared.", cases.size()));
    if (hasOthers && std::abs(std::log(common)) > std::log(1 + kNoiseAlone))
        sentences.push_back(
            fmt::format("The whole run took {:.3g} times the earlier time, a fixed piece of work {:.3g} "
                        "times: the machine was "
                        "busier or idler, or the whole build changed.",
                        common, yardstick));
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
