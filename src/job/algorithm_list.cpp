#include "job/algorithm_list.h"

#include <fmt/format.h>

#include <algorithm>

#include "job/algorithm_choice.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {

namespace {

constexpr std::int64_t kBlocksBytes = std::int64_t(1) << 30;
constexpr int kSmallestEdge = 32;

Contestant contestantOf(const std::string& entry, const BindOptions& options) {
    const std::size_t colon = entry.find(':');
    Contestant contestant;
    contestant.label = entry;
    contestant.resampler = &findResampler(entry.substr(0, colon));
    contestant.options = bindOptionsFor(*contestant.resampler, options);
    if (colon == std::string::npos) return contestant;
    std::string word = entry.substr(colon + 1);
    const std::size_t second = word.find(':');
    const std::string last = second == std::string::npos ? word : word.substr(second + 1);
    for (const Primitives primitives : {Primitives::device, Primitives::processor})
        if (contestant.resampler->info().isOnDevice && last == nameOf(primitives)) {
            contestant.options.primitives = primitives;
            if (second == std::string::npos) return contestant;
            word.resize(second);
        }
    contestant.options.target = word;
    const std::vector<std::string> targets = contestant.resampler->targets();
    if (std::find(targets.begin(), targets.end(), contestant.options.target) == targets.end()) {
        if (contestant.resampler->info().isOnDevice) checkGlTarget(contestant.options.target);
        throw InputError(fmt::format("--algorithms: {} has no target '{}'; there are: {}",
                                     contestant.resampler->name(), contestant.options.target,
                                     fmt::join(targets, ", ")));
    }
    return contestant;
}

}  // namespace

BindOptions bindOptionsFor(const Resampler& resampler, BindOptions options) {
    // Where every target gives the same bits there are no devices to choose from.
    if (resampler.info().targetsAgree) options.target.clear();
    const std::vector<SampleFormat>& formats = resampler.info().formats;
    if (std::find(formats.begin(), formats.end(), options.format) == formats.end())
        options.format = formats.front();
    return options;
}

AlgorithmList listAlgorithms(const std::string& names, const BindOptions& options) {
    AlgorithmList list;
    if (names.empty()) {
        for (const Resampler* resampler : resamplers()) {
            if (!resampler->info().meetsContract) continue;  // methods as published: only by name
            const std::string reason = whyNotBound(*resampler, bindOptionsFor(*resampler, options));
            if (reason.empty())
                list.contestants.push_back(contestantOf(std::string(resampler->name()), options));
            else
                list.absent.push_back(fmt::format("{} is left out: {}", resampler->name(), reason));
        }
        return list;
    }
    for (std::size_t begin = 0; begin <= names.size();) {
        const std::size_t end = std::min(names.find(',', begin), names.size());
        if (end == begin)
            throw InputError(fmt::format("--algorithms: expected name,name:target,..., got '{}'", names));
        list.contestants.push_back(contestantOf(names.substr(begin, end - begin), options));
        begin = end + 1;
    }
    return list;
}

std::string whyNotBound(const Resampler& resampler, const BindOptions& options) {
    const std::string reason = resampler.unavailableReason();
    if (!reason.empty()) return reason;
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.tets = {{0, 1, 2, 3}};
    try {
        resampler.bind(mesh, {}, options);
    } catch (const InputError& error) {
        return error.what();
    } catch (const GlError& error) {
        return error.what();
    }
    return {};
}

std::string lossyFormat(const BindOptions& options) {
    return options.format == SampleFormat::r32f ? std::string() : std::string(nameOf(options.format));
}

int affordableBoxEdge(int edge, int channels, std::size_t algorithms) {
    const auto bytes = [&](std::int64_t e) {
        return e * e * e * (4 * std::int64_t(channels) + 8) * std::int64_t(algorithms);
    };
    while (edge / 2 >= kSmallestEdge && bytes(edge) > kBlocksBytes) edge /= 2;
    return edge;
}

}  // namespace tessera
