#include "benchmark/brick_cases.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/timer.h"
#include "benchmark/peer_resampler.h"
#include "job/report_text.h"
#include "refine/plan.h"
#include "refine/refine.h"
#include "refine/resample_tree.h"
#include "resample/statistic_names.h"

namespace tessera {

namespace {

const std::vector<int> kFirstField{0};

BrickCase caseOf(const BenchmarkVariant& variant, const TetMesh& mesh, Criteria criterion) {
    BrickCase bricks;
    bricks.variant = &variant;
    bricks.mesh = &mesh;
    bricks.refine.criterion = criterion;
    bricks.refine.bind = variant.bind;
    return bricks;
}

int channelsOf(const TetMesh& mesh) {
    return mesh.fields[0].components;
}

Execution executionOf(const BrickCase& bricks, const Execution& execution) {
    Execution own = execution.withoutProgress();
    own.threads = bricks.variant->threads;
    return own;
}

void addStatistics(const ResampleStatistics& statistics, CaseSample& sample) {
    sample.statistics = statistics;
    for (const auto& [name, ms] : statistics.stages())
        if (name != kTransferStage) sample.stagesMs.emplace_back(name, ms);
    // What a peer's samples take on their way isn't its sampling.
    sample.ms -= statistics.ms(kTransferStage);
}

/// Planned, bound and sampled; what is measured elsewhere isn't done.
CaseSample runPlanned(const BrickCase& bricks, const Execution& execution) {
    double planMs = 0, bindMs = 0;
    BrickTree tree;
    BrickStore store;
    CaseSample sample = timed([&] {
        Timer timer;
        tree = planBricks(*bricks.mesh, bricks.refine, execution, channelsOf(*bricks.mesh));
        planMs = timer.restart();
        const auto bound = bricks.variant->resampler->bind(*bricks.mesh, kFirstField, bricks.refine.bind);
        bindMs = timer.restart();
        ResampleStatistics statistics;
        store = resampleTree(tree, *bound, channelsOf(*bricks.mesh), execution, statistics);
        return statistics;
    });
    sample.stagesMs = {{"plan_ms", planMs}};
    if (bricks.variant->role == VariantRole::peer)
        sample.ms -= bindMs;  // it reads a file there
    else
        sample.stagesMs.emplace_back("bind_ms", bindMs);
    addStatistics(sample.statistics, sample);
    return sample;
}

CaseSample runByError(const BrickCase& bricks, const Execution& execution) {
    BrickResult result;
    CaseSample sample = timed([&] {
        result = makeBricks(bricks, *bricks.mesh, execution);
        return result.statistics;
    });
    sample.stagesMs = {{"plan_ms", result.times.planMs}, {"measure_ms", result.times.verifyMs}};
    addStatistics(sample.statistics, sample);
    return sample;
}

void findOut(BrickCase& bricks, const Execution& execution) {
    const BrickResult result = makeBricks(bricks, *bricks.mesh, execution);
    bricks.error = result.report.fields.at(0);
    bricks.stoppedBecause = result.stoppedBecause;
    bricks.measureMs = result.times.verifyMs;
    bricks.levels = result.tree.levelCount();
    bricks.spacingWorld = result.tree.spacingWorld();
    const std::int64_t edge = bricks.refine.brickCells;
    bricks.voxels = std::int64_t(result.tree.leafCount()) * edge * edge * edge;
    bricks.covered = result.store.coveredPoints();
}

}  // namespace

BrickCase uniformCase(const BenchmarkVariant& variant, const TetMesh& mesh, int points) {
    BrickCase bricks = caseOf(variant, mesh, Criterion::uniform);
    bricks.criterion = "uniform";
    bricks.asked = fmt::format("{} points", formatCount(points));
    bricks.refine.resolution = points;
    return bricks;
}

BrickCase elementSizeCase(const BenchmarkVariant& variant, const TetMesh& mesh, double samples) {
    BrickCase bricks = caseOf(variant, mesh, Criterion::elementSize);
    bricks.criterion = "element size";
    bricks.asked = fmt::format("{:g} points an edge", samples);
    bricks.refine.samplesPerElement = samples;
    return bricks;
}

BrickCase errorCase(const BenchmarkVariant& variant, const TetMesh& mesh, double bound) {
    BrickCase bricks = caseOf(variant, mesh, Criterion::error);
    bricks.criterion = "error";
    bricks.asked = fmt::format("error {:g} %", 100 * bound);
    bricks.refine.maxError = bricks.bound = bound;
    return bricks;
}

BrickCase focusCase(const BenchmarkVariant& variant, const TetMesh& mesh, int points) {
    BrickCase bricks = caseOf(variant, mesh, Criterion::focus);
    const Box3d bounds = mesh.boundsWorld();
    const Vec3d size = bounds.size();
    const double radius = std::max({size.x, size.y, size.z}) / 16;
    bricks.criterion = "focus";
    bricks.asked = fmt::format("{} points at the focus", formatCount(points));
    bricks.refine.resolution = points;
    bricks.refine.focus = {pointFocus(bounds.min + 0.5 * size, radius)};
    return bricks;
}

TimedCase timedCase(BrickCase& bricks, const std::string& ladder) {
    TimedCase one;
    one.what = fmt::format("{}, {}, {}", bricks.variant->name, bricks.criterion, bricks.asked);
    one.ladder = ladder;
    one.run = [&bricks](const Execution& execution) {
        const Execution own = executionOf(bricks, execution);
        return bricks.bound > 0 ? runByError(bricks, own) : runPlanned(bricks, own);
    };
    if (bricks.isErrorMeasured)
        one.prepare = [&bricks](const Execution& execution) {
            findOut(bricks, executionOf(bricks, execution));
        };
    return one;
}

BrickResult makeBricks(const BrickCase& bricks, const TetMesh& mesh, const Execution& execution) {
    return refineAndResample(mesh, kFirstField, *bricks.variant->resampler, bricks.refine, execution);
}

Json runJson(const BrickCase& bricks, const TimedCase& times) {
    Json stages = Json::object(), counts = Json::object();
    for (const auto& [name, ms] : times.samples.front().stagesMs)
        stages[std::string(name.substr(0, name.rfind("_ms")))] =
            times.medianOf([wanted = name](const CaseSample& sample) {
                for (const auto& [other, value] : sample.stagesMs)
                    if (other == wanted) return value;
                return 0.0;
            });
    for (const auto& [name, value] : times.samples.back().statistics.counts())
        counts[std::string(name)] = value;
    const double range = bricks.error.range;
    const auto share = [&](double error) { return range > 0 ? Json(error / range) : Json(nullptr); };
    Json json{{"variant", bricks.variant->name},
              {"criterion", bricks.criterion},
              {"asked", bricks.asked},
              {"resolution", bricks.refine.resolution > 0 ? Json(bricks.refine.resolution) : Json(nullptr)},
              {"bound", bricks.bound > 0 ? Json(bricks.bound) : Json(nullptr)},
              {"stopped_because", bricks.stoppedBecause},
              {"levels", bricks.levels},
              {"spacing", bricks.spacingWorld},
              {"voxels", bricks.voxels},
              {"covered", bricks.covered},
              {"ms", intervalJson(times.interval())},
              {"processor_ms", times.medianOf([](const CaseSample& s) { return s.processorMs; })},
              {"stages_ms", std::move(stages)},
              {"measure_ms", bricks.measureMs},
              {"counts", std::move(counts)},
              {"error",
               {{"max", share(bricks.error.max)},
                {"p999", share(bricks.error.p999)},
                {"rms", share(bricks.error.rms)}}}};
    json["picture_rms"] = bricks.pictureRms ? Json(*bricks.pictureRms) : Json(nullptr);
    json["peak_memory_bytes"] = bricks.peakMemoryBytes ? Json(*bricks.peakMemoryBytes) : Json(nullptr);
    return json;
}

}  // namespace tessera
