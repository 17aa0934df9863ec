#include "benchmark/brick_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

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

void addStatistics(const ResampleStatistics& statistics, CaseSample& sample) {
    sample.statistics = statistics;
    // Where something is drawn, sampling is made of the stages that are told apart.
    const bool isDrawn = statistics.ms(stage::render) > 0;
    for (const auto& [name, ms] : statistics.stages())
        if (name != kTransferStage && !(isDrawn && name == stage::sample))
            sample.stagesMs.emplace_back(name, ms);
    // What a peer's samples take on their way isn't its sampling.
    sample.ms -= statistics.ms(kTransferStage);
}

/// What a resampler's bind takes, and the end of what it bound.
class TimedBinding : public Resampler {
  public:
    explicit TimedBinding(const Resampler& inner) : Resampler(inner.info()), inner_(inner) {}
    double ms() const { return ms_; }

    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options) const override {
        const Timer timer;
        auto bound = std::make_unique<Bound>(inner_.bind(mesh, fields, options), ms_);
        ms_ += timer.elapsedMs();
        return bound;
    }

  private:
    class Bound : public BoundResampler {
      public:
        Bound(std::unique_ptr<BoundResampler> inner, double& ms) : inner_(std::move(inner)), ms_(ms) {}
        ~Bound() override {
            const Timer timer;
            inner_.reset();
            ms_ += timer.elapsedMs();
        }
        std::string_view target() const override { return inner_->target(); }
        ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                    const BlockSink& sink, const Execution& execution) override {
            return inner_->resample(lattice, boxes, sink, execution);
        }

      private:
        std::unique_ptr<BoundResampler> inner_;
        double& ms_;
    };
    const Resampler& inner_;
    mutable double ms_ = 0;
};

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
    if (bricks.variant->role == VariantRole::peer) {
        // Its own sampling, as it says: neither our plan, nor its start and the mesh's way there.
        addStatistics(sample.statistics, sample);
        sample.ms = sample.statistics.ms(stage::sample);
        return sample;
    }
    sample.stagesMs = {{"plan_ms", planMs}, {"bind_ms", bindMs}};
    addStatistics(sample.statistics, sample);
    return sample;
}

CaseSample runByError(const BrickCase& bricks, const Execution& execution) {
    BrickResult result;
    const TimedBinding binding(*bricks.variant->resampler);
    const bool isPeer = bricks.variant->role == VariantRole::peer;
    CaseSample sample = timed([&] {
        result = refineAndResample(*bricks.mesh, kFirstField, isPeer ? binding : *bricks.variant->resampler,
                                   bricks.refine, execution);
        return result.statistics;
    });
    sample.ms -= binding.ms();
    sample.stagesMs = {{"plan_ms", result.times.planMs - std::min(result.times.planMs, binding.ms())},
                       {"measure_ms", result.times.verifyMs}};
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
        const Execution own = bricks.variant->executionFrom(execution);
        return bricks.bound > 0 ? runByError(bricks, own) : runPlanned(bricks, own);
    };
    if (bricks.isErrorMeasured)
        one.prepare = [&bricks](const Execution& execution) {
            findOut(bricks, bricks.variant->executionFrom(execution));
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
    const bool isPeer = bricks.variant->role == VariantRole::peer;  // in a process of its own
    const auto share = [&](double error) { return range > 0 ? Json(error / range) : Json(nullptr); };
    Json json{
        {"variant", bricks.variant->name},
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
        {"processor_ms",
         isPeer ? Json(nullptr) : Json(times.medianOf([](const CaseSample& s) { return s.processorMs; }))},
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
