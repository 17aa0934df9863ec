#include "registry/cost_model.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

std::string secondsText(double ms) {
    if (ms < 1) return "less than 0.001 s";
    return "about " + (ms < 1e4 ? shortNumber(ms / 1e3, 2) : std::to_string(std::llround(ms / 1e3))) + " s";
}

std::string countText(std::int64_t count, const std::string& what) {
    return (count < 1'000'000 ? std::to_string(count) : shortNumber(double(count) / 1e6, 3) + " million") +
           " " + what;
}

}  // namespace

bool CostModel::isSane() const {
    constexpr double kMostMs = 1e7;
    for (const double value : {fixedMs, elementMs, pointMs})
        if (!(value >= 0 && value <= kMostMs)) return false;
    return fixedMs + elementMs + pointMs > 0;
}

CostModel fitCost(const TimedWork& little, const TimedWork& moreElements, const TimedWork& morePoints) {
    const double elements = double(moreElements.work.elements - little.work.elements);
    const double points = double(morePoints.work.points - little.work.points);
    CostModel cost;
    cost.elementMs = std::max(0.0, (moreElements.ms - little.ms) / elements);
    cost.pointMs = std::max(0.0, (morePoints.ms - little.ms) / points);
    cost.fixedMs = std::max(0.0, little.ms - cost.ms(little.work));
    return cost;
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
