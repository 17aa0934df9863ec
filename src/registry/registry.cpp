#include "tessera/registry.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "compute/compute_resampler.h"
#include "gl/gl_platform.h"
#include "hybrid/hybrid_resampler.h"
#include "registry/cost_model.h"
#include "registry/kept_costs.h"
#include "registry/measure_cost.h"
#include "slicing/slicing_resampler.h"
#include "software/software_resampler.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// What auto takes may be off by this much in place: as exact as graphics devices are.
constexpr double kExactEnoughVoxels = 0x1p-8;

std::string joined(const auto& names, const auto& text) {
    std::string list;
    for (const auto& name : names) list += (list.empty() ? "" : ", ") + std::string(text(name));
    return list;
}

const Resampler& named(std::span<const Resampler* const> candidates, std::string_view name) {
    for (const Resampler* resampler : candidates)
        if (resampler->name() == name) return *resampler;
    throw InputError("no algorithm named " + std::string(name) +
                     "; there are: " + joined(candidates, [](const Resampler* r) { return r->name(); }));
}

const Resampler& available(const Resampler& resampler) {
    const std::string reason = resampler.unavailableReason();
    if (reason.empty()) return resampler;
    const std::string line = "algorithm " + std::string(resampler.name()) + " can't run here: " + reason;
    if (resampler.info().isOnDevice) throw GlError(line);  // the machine's fault
    throw InputError(line);
}

bool has(const auto& list, const auto& item) {
    return std::find(list.begin(), list.end(), item) != list.end();
}

/// Empty when the resampler has the options, else the rest of a sentence that begins with its name.
std::string whyNot(const Resampler& resampler, const BindOptions& options, bool checkTarget) {
    const auto& formats = resampler.info().formats;
    if (!has(formats, options.format))
        return "samples in " + joined(formats, [](SampleFormat format) { return nameOf(format); }) +
               " only, not in " + std::string(nameOf(options.format));
    const auto targets = resampler.targets();
    if (checkTarget && !options.target.empty() && !has(targets, options.target))
        return "has no target " + options.target + ", only " +
               joined(targets, [](const std::string& target) { return target; });
    return {};
}

std::string whyUnfit(const Resampler& resampler, const BindOptions& options) {
    const std::string unavailable = resampler.unavailableReason();
    if (!unavailable.empty()) return "can't run here (" + unavailable + ")";
    if (!resampler.info().meetsContract) return "is a method as it was published";
    if (resampler.info().placeBoundVoxels > kExactEnoughVoxels) return "is not exact enough";
    return whyNot(resampler, options, true);
}

constexpr double kMeasuringMs = 200;  // of all algorithms together

std::ptrdiff_t fitOnes(const std::vector<Candidate>& candidates) {
    return std::count_if(candidates.begin(), candidates.end(),
                         [](const Candidate& candidate) { return candidate.whyNot.empty(); });
}

/// From the user's cache, or by measuring. One that fails meanwhile can't be chosen.
void findCosts(std::vector<Candidate>& candidates, const BindOptions& options, const Execution& execution) {
    const auto needsNoDriver = [](const Candidate& candidate) {
        return candidate.whyNot.empty() && !candidate.resampler->info().isOnDevice;
    };
    const bool sparesDrivers =
        !isGlRoomy() && std::any_of(candidates.begin(), candidates.end(), needsNoDriver);
    const double budgetMs = kMeasuringMs / double(fitOnes(candidates));
    const std::string path = costsPath();
    const KeptCosts kept = readCosts(path);
    KeptCosts measured;
    for (Candidate& candidate : candidates) {
        if (!candidate.whyNot.empty()) continue;
        const std::string key = costKey(*candidate.resampler, options, execution);
        if (const auto known = kept.find(key); known != kept.end()) {
            candidate.cost = known->second;
            continue;
        }
        if (sparesDrivers && candidate.resampler->info().isOnDevice) {
            candidate.whyNot = "isn't measured where so little memory is allowed";
            continue;
        }
        const auto leaveOut = [&](const std::exception& error) {
            candidate.whyNot = "failed when it was measured (" + std::string(error.what()) + ")";
        };
        try {
            candidate.cost = measureCost(*candidate.resampler, options, budgetMs, execution);
            measured[key] = candidate.cost;
        } catch (const GlError& error) {
            leaveOut(error);
        } catch (const InputError& error) {  // of one that the caller registered
            leaveOut(error);
        }
    }
    if (!measured.empty()) keepCosts(path, measured);
}

std::vector<const Resampler*>& registered() {
    static const SoftwareResampler software;
    static const SlicingResampler slicing;
    static const HybridResampler hybrid;
    static const ComputeResampler compute;
    static const Slicing2001Resampler slicing2001;
    static const Hybrid2001Resampler hybrid2001;
    static std::vector<const Resampler*> all{&software, &slicing,     &hybrid,
                                             &compute,  &slicing2001, &hybrid2001};
    return all;
}

}  // namespace

std::span<const Resampler* const> resamplers() {
    return registered();
}

void registerResampler(std::unique_ptr<const Resampler> resampler) {
    const std::string& name = resampler->name();
    const auto isNamed = [&](const Resampler* other) { return other->name() == name; };
    if (name == "auto" || std::any_of(registered().begin(), registered().end(), isNamed))
        throw InputError("there is an algorithm named " + name + " already");
    registered().push_back(resampler.get());
    static std::vector<std::unique_ptr<const Resampler>> kept;
    kept.push_back(std::move(resampler));
}

const Resampler& findResampler(std::string_view name) {
    return available(named(resamplers(), name));
}

const Resampler& namedResampler(std::string_view name) {
    return named(resamplers(), name);
}

ResamplerChoice chooseResampler(std::string_view name, const BindOptions& options, const WorkSize& work,
                                const Execution& execution) {
    return chooseResampler(resamplers(), name, options, work, execution);
}

ResamplerChoice chooseResampler(std::span<const Resampler* const> candidates, std::string_view name,
                                const BindOptions& options, const WorkSize& work,
                                const Execution& execution) {
    if (name != "auto") {
        const Resampler& resampler = available(named(candidates, name));
        // Where targets are devices, binding says best why one can't be had.
        const std::string reason = whyNot(resampler, options, resampler.info().targetsAgree);
        if (!reason.empty()) throw InputError("algorithm " + std::string(name) + " " + reason);
        return {&resampler, {}, {}};
    }
    std::vector<Candidate> judged;
    for (const Resampler* resampler : candidates)
        judged.push_back({resampler, whyUnfit(*resampler, options)});
    if (fitOnes(judged) > 1) findCosts(judged, options, execution);
    return chooseByCost(judged, work);
}

std::optional<ResamplerChoice> chooseInstead(const ResamplerChoice& failed, const std::string& failure) {
    if (failed.reason.empty() || !failed.resampler->info().isOnDevice) return std::nullopt;
    for (const Resampler* other : failed.others)
        if (!other->info().isOnDevice)
            return ResamplerChoice{other,
                                   failed.resampler->name() + " failed here (" + failure +
                                       "), so auto goes on with " + other->name(),
                                   {}};
    return std::nullopt;
}

}  // namespace tessera
