#include "benchmark/analyse_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "benchmark/median_interval.h"
#include "benchmark/quoted_text.h"
#include "job/report_text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::array kBounds{0.1, 0.05, 0.02, 0.01};

/// Errors that differ by less are equal: what algorithms differ in place makes as much.
constexpr double kCloser = 0.995;

/// Student's t for a two-sided interval of 95 %, by degrees of freedom from 1.
constexpr std::array kStudent{12.71, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};

double studentOf(std::size_t freedom) {
    return freedom == 0 ? std::numeric_limits<double>::infinity()
                        : kStudent[std::min(freedom, kStudent.size()) - 1];
}

double numberOr(const Json& value, double otherwise) {
    return value.is_number() ? value.get<double>() : otherwise;
}

/// What the runs of one variant and one way of choosing bricks have, from the largest error to the least.
struct Rung {
    const Json* run = nullptr;
    double error = 0;
};

std::vector<Rung> ladderOf(const Json& runs, const std::string& variant, const std::string& criterion,
                           const std::string& measure) {
    std::vector<Rung> ladder;
    for (const Json& run : runs)
        if (run["variant"] == variant && run["criterion"] == criterion && run["error"][measure].is_number())
            ladder.push_back({&run, run["error"][measure].get<double>()});
    std::stable_sort(ladder.begin(), ladder.end(), [](const Rung& a, const Rung& b) {
        return (*a.run)["voxels"].get<double>() < (*b.run)["voxels"].get<double>();
    });
    return ladder;
}

/// Of two values at errors e0 > e1, that at an error between: straight in the logarithms.
double between(double v0, double v1, double share) {
    return v0 > 0 && v1 > 0 ? std::exp(std::log(v0) + share * (std::log(v1) - std::log(v0))) : v1;
}

Json noneJson(const char* how) {
    return {{"ms", nullptr}, {"voxels", nullptr}, {"resolution", nullptr}, {"how", how}};
}

Json measuredJson(const Json& run, const char* how) {
    return {{"ms", run["ms"]}, {"voxels", run["voxels"]}, {"resolution", run["resolution"]}, {"how", how}};
}

Json reachJson(const std::vector<Rung>& ladder, double bound, bool isLargest) {
    // Refinement by error was asked for a bound on the largest error.
    for (const Rung& rung : ladder)
        if (isLargest && numberOr((*rung.run)["bound"], 0) == bound && rung.error <= bound)
            return measuredJson(*rung.run, "measured");
    // Errors needn't fall with every step: the first from which on all are within the bound.
    std::size_t first = ladder.size();
    while (first > 0 && ladder[first - 1].error <= bound) --first;
    if (first == ladder.size()) {
        // Refinement by error gets to any bound that it is asked for: a finer one wasn't tried.
        const bool isByError = std::any_of(ladder.begin(), ladder.end(),
                                           [](const Rung& rung) { return (*rung.run)["bound"].is_number(); });
        return noneJson(isByError && std::none_of(ladder.begin(), ladder.end(),
                                                  [&](const Rung& rung) {
                                                      return numberOr((*rung.run)["bound"], 0) <= bound;
                                                  })
                            ? "not tried"
                            : "not reached");
    }
    if (first == 0) return measuredJson(*ladder[0].run, "coarsest tried");
    const Rung &coarse = ladder[first - 1], &fine = ladder[first];
    const double share = fine.error > 0 ? (std::log(coarse.error) - std::log(bound)) /
                                              (std::log(coarse.error) - std::log(fine.error))
                                        : 1;
    const auto at = [&](const Json& a, const Json& b) {
        return between(a.get<double>(), b.get<double>(), share);
    };
    const Json &ms0 = (*coarse.run)["ms"], &ms1 = (*fine.run)["ms"];
    const Json &r0 = (*coarse.run)["resolution"], &r1 = (*fine.run)["resolution"];
    return {{"ms",
             {{"median", at(ms0["median"], ms1["median"])},
              {"low", at(ms0["low"], ms1["low"])},
              {"high", at(ms0["high"], ms1["high"])},
              {"count", ms1["count"]}}},
            {"voxels", std::int64_t(std::llround(at((*coarse.run)["voxels"], (*fine.run)["voxels"])))},
            {"resolution", r0.is_number() && r1.is_number() ? Json(at(r0, r1)) : Json(nullptr)},
            {"how", "between two resolutions"}};
}

/// In the order in which they come.
std::vector<std::string> variantsOf(const Json& runs) {
    std::vector<std::string> names;
    for (const Json& run : runs) {
        const std::string name = run["variant"];
        if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
    return names;
}

std::map<std::string, std::string> rolesOf(const Json& variants) {
    std::map<std::string, std::string> roles;
    for (const Json& variant : variants) roles[variant["name"]] = variant["role"];
    return roles;
}

Json fitJson(const std::string& variant, const Json& points) {
    std::vector<double> x, y;
    for (const Json& point : points) {
        x.push_back(point["x"].get<double>());
        y.push_back(point["ms"]["median"].get<double>());
    }
    Json json{{"variant", variant}, {"exponent", nullptr}, {"factor_ms", nullptr}, {"points", points}};
    if (x.size() < 2) return json;
    const PowerFit fit = fitPower(x, y);
    const bool isBounded = std::isfinite(fit.low) && std::isfinite(fit.high);
    json["exponent"] = {{"value", fit.exponent},
                        {"low", isBounded ? Json(fit.low) : Json(nullptr)},
                        {"high", isBounded ? Json(fit.high) : Json(nullptr)}};
    json["factor_ms"] = fit.factor;
    return json;
}

std::string secondsText(double ms) {
    return ms < 1000 ? fmt::format("{:.3g} ms", ms) : fmt::format("{:.3g} s", ms / 1000);
}

std::string voxelsText(double voxels) {
    return voxels < 1e6 ? fmt::format("{:.3g} thousand voxels", voxels / 1e3)
                        : fmt::format("{:.3g} million voxels", voxels / 1e6);
}

/// The quickest of the entries of equal_error that stand for a bound, of variants of a role.
const Json* quickest(const Json& entries, double bound, const std::string& criterion,
                     const std::map<std::string, std::string>& roles, const std::string& role) {
    const Json* best = nullptr;
    for (const Json& entry : entries) {
        const auto found = roles.find(entry["variant"].get<std::string>());
        if (entry["measure"] != "max" || entry["bound"] != bound || entry["criterion"] != criterion ||
            !entry["ms"].is_object() || found == roles.end() || found->second != role)
            continue;
        if (!best || entry["ms"]["median"].get<double>() < (*best)["ms"]["median"].get<double>())
            best = &entry;
    }
    return best;
}

/// The command that makes such bricks; nothing where the mesh is no file.
std::string commandFor(const Json& document, const Json& entry, const std::string& how) {
    const std::string mesh = document["input"]["file"].is_string() ? document["input"]["file"] : "";
    if (mesh.empty()) return {};
    std::string algorithm;
    for (const Json& variant : document["variants"])
        if (variant["name"] == entry["variant"]) algorithm = variant["algorithm"];
    const std::string where = document["input"]["location"] == "cell" ? "cell:" : "point:";
    return fmt::format(" (tessera resample {} -o out.vdb --field {} --algorithm {} {})", shellWord(mesh),
                       shellWord(where + document["input"]["field"].get<std::string>()), algorithm, how);
}

std::string adviceForBound(const Json& document, double bound) {
    const auto roles = rolesOf(document["variants"]);
    const Json& entries = document["equal_error"];
    const Json* uniform = quickest(entries, bound, "uniform", roles, "main");
    const Json* byError = quickest(entries, bound, "error", roles, "main");
    if (!uniform && !byError) return {};
    const auto costs = [&](const Json& entry) {
        return fmt::format("{} and {} by {}", secondsText(entry["ms"]["median"].get<double>()),
                           voxelsText(entry["voxels"].get<double>()), entry["variant"].get<std::string>());
    };
    const bool isUniform = uniform && (!byError || (*uniform)["ms"]["median"].get<double>() * 1.1 <
                                                       (*byError)["ms"]["median"].get<double>());
    if (isUniform) {
        const double resolution = std::ceil(numberOr((*uniform)["resolution"], 0));
        const std::string how = fmt::format("--refine uniform --resolution {:.0f}", resolution);
        const std::string lattice =
            (*uniform)["how"] == "coarsest tried"
                ? fmt::format("the coarsest lattice that was tried, {:.0f} points, is enough", resolution)
                : fmt::format("a uniform lattice of {:.0f} points is the quickest", resolution);
        std::string text = fmt::format("For a largest error of {:g} %, {}: {}{}.", 100 * bound, lattice,
                                       costs(*uniform), commandFor(document, *uniform, how));
        if (byError) text += fmt::format(" Bricks by error take {}.", costs(*byError));
        return text;
    }
    std::string text = fmt::format(
        "For a largest error of {:g} %, take bricks by error: {}{}.", 100 * bound, costs(*byError),
        commandFor(document, *byError, fmt::format("--refine error --max-error {:g}%", 100 * bound)));
    text += uniform ? fmt::format(" A uniform lattice takes {}.", costs(*uniform))
                    : std::string(" No uniform lattice that was tried is so close.");
    return text;
}

/// The algorithms against the first one, where they were run on the same lattice.
std::string adviceOnAlgorithm(const Json& document) {
    const auto roles = rolesOf(document["variants"]);
    double finest = 0;
    for (const Json& run : document["runs"])
        if (run["criterion"] == "uniform" && roles.at(run["variant"]) == "main")
            finest = std::max(finest, numberOr(run["resolution"], 0));
    std::vector<std::pair<double, std::string>> mains, peers;
    for (const Json& run : document["runs"]) {
        if (run["criterion"] != "uniform" || numberOr(run["resolution"], 0) != finest) continue;
        const std::string role = roles.at(run["variant"]);
        if (role == "main") mains.emplace_back(run["ms"]["median"].get<double>(), run["variant"]);
    }
    if (mains.size() < 2) return {};
    std::sort(mains.begin(), mains.end());
    std::string text = fmt::format("{} is the quickest algorithm here: {} for {:.0f} points", mains[0].second,
                                   secondsText(mains[0].first), finest);
    for (std::size_t i = 1; i < mains.size(); ++i)
        text += fmt::format("{} {} takes {:.2g} times that", i == 1 ? ";" : ",", mains[i].second,
                            mains[i].first / mains[0].first);
    return text + ".";
}

std::string adviceOnPeers(const Json& document) {
    const auto roles = rolesOf(document["variants"]);
    std::string text;
    for (const Json& variant : document["variants"]) {
        if (variant["role"] != "peer") continue;
        const Json* finest = nullptr;
        for (const Json& run : document["runs"])
            if (run["variant"] == variant["name"] && run["criterion"] == "uniform" &&
                (!finest || numberOr(run["resolution"], 0) > numberOr((*finest)["resolution"], 0)))
                finest = &run;
        if (!finest) continue;
        double best = std::numeric_limits<double>::infinity();
        for (const Json& run : document["runs"])
            if (run["criterion"] == "uniform" && run["resolution"] == (*finest)["resolution"] &&
                roles.at(run["variant"]) == "main")
                best = std::min(best, run["ms"]["median"].get<double>());
        if (!std::isfinite(best)) continue;
        text += fmt::format("{}At {:.0f} points {} takes {}, {:.3g} times the quickest algorithm.",
                            text.empty() ? "" : " ", numberOr((*finest)["resolution"], 0),
                            variant["name"].get<std::string>(),
                            secondsText((*finest)["ms"]["median"].get<double>()),
                            (*finest)["ms"]["median"].get<double>() / best);
    }
    return text;
}

}  // namespace

PowerFit fitPower(const std::vector<double>& x, const std::vector<double>& y) {
    const auto n = double(x.size());
    double meanX = 0, meanY = 0;
    for (std::size_t i = 0; i < x.size(); ++i) meanX += std::log(x[i]) / n, meanY += std::log(y[i]) / n;
    double xx = 0, xy = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        xx += (std::log(x[i]) - meanX) * (std::log(x[i]) - meanX);
        xy += (std::log(x[i]) - meanX) * (std::log(y[i]) - meanY);
    }
    PowerFit fit;
    fit.exponent = xx > 0 ? xy / xx : 0;
    fit.factor = std::exp(meanY - fit.exponent * meanX);
    double rest = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
        const double off = std::log(y[i]) - std::log(fit.factor) - fit.exponent * std::log(x[i]);
        rest += off * off;
    }
    const std::size_t freedom = x.size() - std::min<std::size_t>(x.size(), 2);
    const double error = freedom > 0 && xx > 0 ? std::sqrt(rest / double(freedom) / xx) : 1;
    fit.low = fit.exponent - studentOf(freedom) * error;
    fit.high = fit.exponent + studentOf(freedom) * error;
    return fit;
}

Json equalErrorJson(const Json& runs) {
    Json all = Json::array();
    for (const char* measure : {"max", "rms"})
        for (const double bound : kBounds)
            for (const std::string& variant : variantsOf(runs))
                for (const char* criterion : {"uniform", "error"}) {
                    const std::vector<Rung> ladder = ladderOf(runs, variant, criterion, measure);
                    // A single lattice says nothing about others.
                    if (ladder.empty() || (ladder.size() == 1 && criterion == std::string("uniform")))
                        continue;
                    Json entry{{"measure", measure},
                               {"bound", bound},
                               {"variant", variant},
                               {"criterion", criterion}};
                    entry.update(reachJson(ladder, bound, measure == std::string("max")));
                    all.push_back(std::move(entry));
                }
    return all;
}

Json paretoJson(const Json& runs, const Json& variants) {
    const auto roles = rolesOf(variants);
    Json json = Json::object();
    for (const char* measure : {"max", "rms"}) {
        std::vector<std::size_t> order;
        for (std::size_t i = 0; i < runs.size(); ++i)
            if (runs[i]["error"][measure].is_number() && roles.at(runs[i]["variant"]) != "again")
                order.push_back(i);
        const auto ms = [&](std::size_t i) { return runs[i]["ms"]["median"].get<double>(); };
        std::stable_sort(order.begin(), order.end(),
                         [&](std::size_t a, std::size_t b) { return ms(a) < ms(b); });
        double least = std::numeric_limits<double>::infinity();
        json[measure] = Json::array();
        for (const std::size_t i : order) {
            const double error = runs[i]["error"][measure].get<double>();
            if (error >= kCloser * least) continue;
            least = error;
            json[measure].push_back(i);
        }
    }
    return json;
}

Json scalingJson(const Json& points) {
    Json all = Json::array();
    for (const std::string& variant : variantsOf(points)) {
        Json own = Json::array();
        for (const Json& point : points)
            if (point["variant"] == variant) {
                own.push_back(point);
                own.back().erase("variant");
            }
        all.push_back(fitJson(variant, own));
    }
    return all;
}

Json resolutionScalingJson(const Json& runs) {
    Json points = Json::array();
    for (const Json& run : runs)
        if (run["criterion"] == "uniform")
            points.push_back({{"variant", run["variant"]}, {"x", run["resolution"]}, {"ms", run["ms"]}});
    Json all = scalingJson(points), several = Json::array();
    for (Json& one : all)
        if (one["points"].size() > 1) several.push_back(std::move(one));
    return several;
}

Json rooflineJson(const Json& runs, const Json& variants, double meshBytes, int channels,
                  const std::vector<MachineRates>& rates) {
    Json machine = Json::array(), all = Json::array();
    for (const MachineRates& r : rates)
        machine.push_back({{"threads", r.threads},
                           {"fill_gb_s", r.fill},
                           {"copy_gb_s", r.copy},
                           {"first_touch_gb_s", r.touchSmall},
                           {"first_touch_large_pages_gb_s", r.touchLarge},
                           {"steps_a_ms", r.stepsMs}});
    std::map<std::string, int> threads;
    for (const Json& variant : variants) threads[variant["name"]] = variant["threads"];
    for (const Json& run : runs) {
        if (run["criterion"] != "uniform") continue;
        const auto own = std::find_if(rates.begin(), rates.end(), [&](const MachineRates& r) {
            return r.threads == threads[run["variant"]];
        });
        if (own == rates.end()) continue;
        const double written = run["covered"].get<double>() * (4.0 * channels + 1.0 / 8);
        const double least = meshBytes / 1e6 / own->copy + written / 1e6 / own->fill;
        const double ms = run["ms"]["median"].get<double>();
        all.push_back({{"variant", run["variant"]},
                       {"resolution", run["resolution"]},
                       {"least_bytes", meshBytes + written},
                       {"least_ms", least},
                       {"ms", ms},
                       {"times_least", ms / least},
                       {"gb_s", (meshBytes + written) / 1e6 / ms}});
    }
    return {{"machine", std::move(machine)}, {"runs", std::move(all)}};
}

std::vector<std::string> adviceOn(const Json& document) {
    std::vector<std::string> sentences;
    const auto add = [&](std::string text) {
        if (!text.empty()) sentences.push_back(std::move(text));
    };
    add(adviceOnAlgorithm(document));
    for (const double bound : {0.1, 0.05, 0.01}) add(adviceForBound(document, bound));
    add(adviceOnPeers(document));
    return sentences;
}

}  // namespace tessera
