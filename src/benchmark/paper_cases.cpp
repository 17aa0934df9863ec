#include "benchmark/paper_cases.h"

#include <fmt/format.h>

#include <algorithm>

#include "benchmark/peer_resampler.h"
#include "compare/sampling_grid.h"
#include "mesh/mirror.h"
#include "resample/statistic_names.h"

namespace tessera {

namespace {

/// Whole grids up to this many points are sampled as one box, as the paper did; larger ones in parts.
constexpr std::int64_t kWholeGridPoints = std::int64_t(1) << 24;
constexpr int kPartEdge = 256;

constexpr const char* kLegend =
    "Published: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive "
    "Visualization of Unstructured Grids, IEEE Visualization 2001, figures 9 to 11 (Athlon 900 MHz, GeForce2 "
    "GTS; reading slices back not included). Their bluntfin had 220K tetrahedra. WestSingle and WestM/C are "
    "their versions of an earlier method, not part of Tessera. Here: wall clock of sampling, reading "
    "back included, by what is bound to the mesh already; peers build their search structures each time. "
    "Ael: active list and generation of polygons or instances. Rnd: upload and rendering. Stages "
    "may overlap. Polygons: before they are grown; the paper slices along z, Tessera along the axis with the "
    "fewest pairs of element and slice.";

std::int64_t pointsOf(const PaperGrid& grid) {
    return std::int64_t(grid.points.x) * grid.points.y * grid.points.z;
}

bool isTimed(const BenchmarkVariant& variant) {
    if (variant.role == VariantRole::main) return !variant.resampler->info().isOnDevice;
    if (variant.role == VariantRole::variation)
        return variant.bind.primitives == Primitives::processor && variant.resampler->name() != "compute";
    return variant.role == VariantRole::published || variant.role == VariantRole::peer;
}

}  // namespace

PaperCases::PaperCases(const TetMesh& mesh, const std::string& meshName,
                       std::span<const BenchmarkVariant> variants, int mostPoints, std::size_t mostSets) {
    for (const BenchmarkVariant& variant : variants)
        if (isTimed(variant)) variants_.push_back(&variant);
    const std::span<const PaperDataSet> all = paperDataSets();
    for (const PaperDataSet& published : all.first(std::min(mostSets, all.size()))) {
        DataSet set;
        set.published = &published;
        set.name = std::string(published.prefix) + meshName;
        set.mesh = mesh;
        for (const int axis : published.mirrorAxes)
            set.mesh = withMirrorImage(set.mesh, axis, set.mesh.boundsWorld().min[axis]);
        set.bound.resize(variants_.size());
        bool isUsed = false;
        for (const PaperGrid& grid : published.grids) {
            if (std::max({grid.points.x, grid.points.y, grid.points.z}) > mostPoints) continue;
            const SamplingGrid sampling = spanningGrid(set.mesh.boundsWorld(), grid.points);
            for (std::size_t v = 0; v < variants_.size(); ++v)
                cases_.push_back({sets_.size(), v, &grid, sampling.lattice,
                                  pointsOf(grid) <= kWholeGridPoints
                                      ? std::vector{sampling.points}
                                      : cutIntoBoxes(sampling.points, kPartEdge)});
            isUsed = true;
        }
        if (isUsed) sets_.push_back(std::move(set));
    }
}

std::vector<TimedCase> PaperCases::timedCases() {
    std::vector<TimedCase> all;
    for (const Case& one : cases_) {
        DataSet& set = sets_[one.set];
        const BenchmarkVariant& variant = *variants_[one.variant];
        auto& bound = set.bound[one.variant];
        TimedCase timedOne;
        timedOne.what = fmt::format("{}, {} on {} x {} x {}", variant.name, set.name, one.grid->points.x,
                                    one.grid->points.y, one.grid->points.z);
        timedOne.ladder = fmt::format("paper, {}, {}", variant.name, set.name);
        timedOne.work = double(pointsOf(*one.grid));
        timedOne.prepare = [&set, &variant, &bound](const Execution&) {
            const std::vector<int> fields{0};
            if (!bound) bound = variant.resampler->bind(set.mesh, fields, variant.bind);
        };
        timedOne.run = [&one, &variant, &bound](const Execution& execution) {
            const Execution own = variant.executionFrom(execution);
            CaseSample sample = timed([&] {
                return bound->resample(
                    one.lattice, one.boxes, [](std::size_t, const Block&) {}, own);
            });
            sample.ms -= sample.statistics.ms(kTransferStage);
            return sample;
        };
        all.push_back(std::move(timedOne));
    }
    return all;
}

Json PaperCases::json(std::span<const TimedCase> times) const {
    const auto measuredJson = [&](const BenchmarkVariant& variant, const TimedCase& one) {
        const auto stageMs = [&](std::string_view name) {
            return one.medianOf([&](const CaseSample& s) { return s.statistics.ms(name); });
        };
        const ResampleStatistics& last = one.samples.back().statistics;
        const std::int64_t pairs = last.count(counted::elementSlicePairs);
        Json json{{"algorithm", variant.resampler->name()}, {"total_ms", one.interval().median}};
        json["ms"] = intervalJson(one.interval());
        // Without slices there are no stages but the list and the rest.
        json["ael_ms"] = variant.role == VariantRole::peer
                             ? Json(nullptr)
                             : Json(stageMs(stage::bin) + stageMs(stage::generate));
        json["rnd_ms"] = pairs > 0 ? Json(stageMs(stage::upload) + stageMs(stage::render)) : Json(nullptr);
        json["read_back_ms"] = pairs > 0 ? Json(stageMs(stage::readBack)) : Json(nullptr);
        json["polygons"] = pairs > 0 ? Json(last.count(counted::polygons)) : Json(nullptr);
        json["pairs"] = pairs > 0 ? Json(pairs) : Json(nullptr);
        return json;
    };
    const auto orNull = [](const auto& value) { return value ? Json(*value) : Json(nullptr); };
    Json sets = Json::array();
    for (std::size_t s = 0; s < sets_.size(); ++s) {
        Json grids = Json::array();
        for (const PaperGrid& grid : sets_[s].published->grids) {
            Json measured = Json::object(), published = Json::object();
            for (std::size_t c = 0; c < cases_.size(); ++c)
                if (cases_[c].set == s && cases_[c].grid == &grid && times[c].isTimed())
                    measured[variants_[cases_[c].variant]->name] =
                        measuredJson(*variants_[cases_[c].variant], times[c]);
            if (measured.empty()) continue;
            for (const PaperRow& row : grid.rows)
                published[std::string(row.paperName)] = {{"algorithm", row.algorithm},
                                                         {"ael_s", orNull(row.aelSeconds)},
                                                         {"rnd_s", orNull(row.rndSeconds)},
                                                         {"tot_s", row.totSeconds},
                                                         {"polygons_k", orNull(row.polygonsK)}};
            grids.push_back({{"points", {grid.points.x, grid.points.y, grid.points.z}},
                             {"measured", std::move(measured)},
                             {"published", std::move(published)}});
        }
        if (grids.empty()) continue;
        sets.push_back({{"name", sets_[s].name},
                        {"elements", sets_[s].mesh.elementCount()},
                        {"figures", sets_[s].published->figures},
                        {"published_elements_k", sets_[s].published->elementsK},
                        {"grids", std::move(grids)}});
    }
    return {{"legend", kLegend}, {"data_sets", std::move(sets)}};
}

}  // namespace tessera
