#include "benchmark/benchmark_variants.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "benchmark/peer_resampler.h"
#include "gl/gl_platform.h"
#include "job/algorithm_list.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {

namespace {

class Lister {
  public:
    Lister(const BenchmarkRequest& request, const Execution& execution)
        : request_(request), execution_(execution), threads_(execution.threadCount()) {}

    VariantList run() {
        addMain();
        if (!list_.variants.empty()) {
            BenchmarkVariant again = list_.variants.front();
            again.name += " again";
            add(again.name, VariantRole::again, *again.resampler, again.bind, again.threads);
        }
        if (request_.algorithms.empty()) {
            const std::vector<BenchmarkVariant> all = list_.variants;
            for (const BenchmarkVariant& variant : all)
                if (variant.role == VariantRole::main) addVariations(variant);
            addPublished();
        }
        addPeers();
        return std::move(list_);
    }

  private:
    void add(const std::string& name, VariantRole role, const Resampler& resampler, const BindOptions& bind,
             int threads) {
        if (!names_.insert(name).second)
            throw InputError(fmt::format("two algorithms or peers have the name '{}'", name));
        list_.variants.push_back({name, role, &resampler, bind, threads});
    }
    void addMain() {
        AlgorithmList algorithms = listAlgorithms(request_.algorithms, request_.bind);
        for (const Contestant& c : algorithms.contestants)
            add(c.label, VariantRole::main, *c.resampler, c.options, threads_);
        list_.absent = std::move(algorithms.absent);
    }
    /// One thing changed at a time.
    void addVariations(const BenchmarkVariant& of) {
        const ResamplerInfo& info = of.resampler->info();
        if (threads_ > 1 && !info.isOnDevice)
            add(of.name + ", 1 thread", VariantRole::variation, *of.resampler, of.bind, 1);
        const std::vector<std::string> targets = of.resampler->targets();
        for (const std::string& target : targets) {
            BindOptions bind = of.bind;
            bind.target = target;
            if (target != (of.bind.target.empty() ? targets.front() : of.bind.target))
                addIfBound(of.name + ", " + target, of, bind);
        }
        for (const SampleFormat format : info.formats) {
            BindOptions bind = of.bind;
            bind.format = format;
            if (format != of.bind.format)
                addIfBound(fmt::format("{}, {}", of.name, nameOf(format)), of, bind);
        }
        if (!info.isOnDevice) return;
        for (int axis = 0; info.isSliced && axis < 3; ++axis) {
            BindOptions along = of.bind;
            along.sliceAxis = axis;
            addIfBound(fmt::format("{}, along {}", of.name, "xyz"[axis]), of, along);
        }
        BindOptions bind = of.bind;
        bind.primitives = Primitives::processor;
        addIfBound(of.name + ", processor", of, bind);
    }
    void addIfBound(const std::string& name, const BenchmarkVariant& of, const BindOptions& bind) {
        const std::string reason = whyNotBound(*of.resampler, bind);
        if (reason.empty())
            add(name, VariantRole::variation, *of.resampler, bind, threads_);
        else
            list_.absent.push_back(fmt::format("{} is left out: {}", name, reason));
    }
    void addPublished() {
        for (const Resampler* resampler : resamplers()) {
            if (resampler->info().meetsContract) continue;
            const BindOptions bind = bindOptionsFor(*resampler, request_.bind);
            const std::string reason = whyNotBound(*resampler, bind);
            if (reason.empty())
                add(resampler->name(), VariantRole::published, *resampler, bind, threads_);
            else
                list_.absent.push_back(fmt::format("{} is left out: {}", resampler->name(), reason));
        }
    }
    void addPeers() {
        std::vector<PeerCommand> commands;
        if (request_.hasVtk) {
            if (const auto vtk = vtkPeer(std::filesystem::path(request_.program).parent_path().string()))
                commands.push_back(*vtk);
            else
                list_.absent.push_back("VTK is left out: its program isn't beside this one");
        }
        commands.insert(commands.end(), request_.peers.begin(), request_.peers.end());
        for (PeerCommand& command : commands) {
            command.cancel = execution_.cancel;
            list_.peers.push_back(makePeer(command));
            add(command.name, VariantRole::peer, *list_.peers.back(), {}, threads_);
        }
    }

    const BenchmarkRequest& request_;
    const Execution& execution_;
    int threads_;
    VariantList list_;
    std::set<std::string> names_;
};

}  // namespace

std::string_view nameOf(VariantRole role) {
    switch (role) {
        case VariantRole::main:
            return "main";
        case VariantRole::again:
            return "again";
        case VariantRole::variation:
            return "variation";
        case VariantRole::published:
            return "published";
        case VariantRole::peer:
            return "peer";
    }
    return "main";
}

VariantList listVariants(const BenchmarkRequest& request, const Execution& execution) {
    return Lister(request, execution).run();
}

GlThread& deviceOf(const BindOptions& bind) {
    std::optional<GlPlatform> wanted;
    if (!bind.target.empty()) wanted = parseGlPlatform(bind.target);
    return sharedGlThread(chooseGlPlatform(wanted));
}

Json variantJson(const BenchmarkVariant& variant) {
    const ResamplerInfo& info = variant.resampler->info();
    const std::vector<std::string> targets = variant.resampler->targets();
    const std::string& target =
        variant.bind.target.empty() && !targets.empty() ? targets.front() : variant.bind.target;
    return {{"name", variant.name},
            {"algorithm", info.name},
            {"target", target},
            {"sample_format", nameOf(variant.bind.format)},
            {"threads", variant.threads},
            {"primitives", info.isOnDevice ? Json(nameOf(variant.bind.primitives)) : Json(nullptr)},
            {"slice_axis", variant.bind.sliceAxis ? Json(*variant.bind.sliceAxis) : Json(nullptr)},
            {"role", nameOf(variant.role)},
            {"note", info.description}};
}

}  // namespace tessera
