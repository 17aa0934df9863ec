#include "registry/cost_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// What the coefficients of a model count.
std::array<double, 4> countsOf(const WorkSize& work) {
    const double elements = double(work.elements), points = double(work.points);
    return {1, elements, points, std::cbrt(elements * elements * points)};
}

std::string secondsText(double ms) {
    if (ms < 1) return "less than 0.001 s";
    return "about " + (ms < 1e4 ? shortNumber(ms / 1e3, 2) : std::to_string(std::llround(ms / 1e3))) + " s";
}

std::string countText(std::int64_t count, const std::string& what) {
    return (count < 1'000'000 ? std::to_string(count) : shortNumber(double(count) / 1e6, 3) + " million") +
           " " + what;
}

}  // namespace

double CostModel::ms(const WorkSize& work) const {
    const auto counts = countsOf(work);
    return fixedMs * counts[0] + elementMs * counts[1] + pointMs * counts[2] + sliceMs * counts[3];
}

bool CostModel::isSane() const {
    constexpr double kMostMs = 1e7;
    for (const double value : {fixedMs, elementMs, pointMs, sliceMs})
        if (!(value >= 0 && value <= kMostMs)) return false;
    return fixedMs + elementMs + pointMs + sliceMs > 0;
}

CostModel fitCost(std::span<const TimedWork> timed) {
    // One coefficient after the other, so that none gets negative; each in units of what it counts at most.
    constexpr int kRounds = 20000;
    std::array<double, 4> unit{};
    for (const TimedWork& one : timed)
        for (std::size_t k = 0; k < unit.size(); ++k) unit[k] = std::max(unit[k], countsOf(one.work)[k]);
    std::vector<std::array<double, 4>> rows;
    for (const TimedWork& one : timed) {
        rows.push_back(countsOf(one.work));
        for (std::size_t k = 0; k < unit.size(); ++k) rows.back()[k] /= unit[k] * one.ms;
    }
    std::array<double, 4> found{};
    std::vector<double> missing(rows.size(), 1);  // of each time, as a share of it
    for (int round = 0; round < kRounds; ++round)
        for (std::size_t k = 0; k < found.size(); ++k) {
            double slope = 0, squares = 0;
            for (std::size_t i = 0; i < rows.size(); ++i) {
                slope += rows[i][k] * missing[i];
                squares += rows[i][k] * rows[i][k];
            }
            const double step = std::max(-found[k], slope / squares);
            found[k] += step;
            for (std::size_t i = 0; i < rows.size(); ++i) missing[i] -= step * rows[i][k];
        }
    return {found[0] / unit[0], found[1] / unit[1], found[2] / unit[2], found[3] / unit[3]};
}

ResamplerChoice chooseByCost(std::span<const Candidate> candidates, const WorkSize& work) {
    std::vector<const Candidate*> fit;
    std::string unfit;
    for (const Candidate& candidate : candidates) {
        if (candidate.whyNot.empty())
            fit.push_back(&candidate);
        else
            unfit += (unfit.empty() ? "" : "; ") + candidate.resampler->name() + " " + candidate.whyNot;
    }
    if (fit.empty()) throw InputError("no algorithm can be chosen automatically: " + unfit);
    std::stable_sort(fit.begin(), fit.end(), [&](const Candidate* a, const Candidate* b) {
        return a->cost.ms(work) < b->cost.ms(work);
    });
    ResamplerChoice choice{fit[0]->resampler, "auto chose " + fit[0]->resampler->name(), {}};
    for (std::size_t i = 1; i < fit.size(); ++i) choice.others.push_back(fit[i]->resampler);
    if (fit.size() == 1) {
        choice.reason += unfit.empty() ? ", the only one there is" : ": " + unfit;
        return choice;
    }
    choice.reason += ": " + secondsText(fit[0]->cost.ms(work)) + " for " +
                     countText(work.elements, "elements") + " and " + countText(work.points, "points");
    for (std::size_t i = 1; i < fit.size(); ++i)
        choice.reason +=
            (i == 1 ? "; " : ", ") + fit[i]->resampler->name() + " " + secondsText(fit[i]->cost.ms(work));
    if (!unfit.empty()) choice.reason += "; " + unfit;
    return choice;
}

}  // namespace tessera
