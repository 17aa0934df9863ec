#include "job/focus_trace.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>

#include "base/timer.h"
#include "files/atomic_file.h"
#include "job/algorithm_choice.h"
#include "job/focus_path.h"
#include "job/focus_trace_html.h"
#include "job/focus_trace_text.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/report_text.h"
#include "refine/plan_frame.h"
#include "schedule/brick_scheduler.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Notes when the leaf that holds a place becomes finer than it was, or is shown at all.
class BetterBrickWatch : public BrickTarget {
  public:
    /// From now on. @param finest the finest brick at the place. @param shown the leaf that holds it now.
    void begin(const DepthKey& finest, const std::optional<GrowingLeaf>& shown) {
        finest_ = finest;
        before_ = shown ? std::optional(shown->key.depth) : std::nullopt;
        betterMs_.reset();
        timer_.restart();
    }
    double elapsedMs() const { return timer_.elapsedMs(); }
    std::optional<double> betterMs() const { return betterMs_; }

    void publish(const Publication& publication) override {
        if (betterMs_) return;
        for (const ShownBrick& brick : publication.added) {
            const DepthKey& key = brick.leaf.key;
            if ((!before_ || key.depth > *before_) && ancestorKey(finest_, key.depth) == key)
                betterMs_ = timer_.elapsedMs();
        }
    }

  private:
    DepthKey finest_;
    std::optional<Depth> before_;
    std::optional<double> betterMs_;
    Timer timer_;
};

/// The work of traceFocus.
class FocusTraceRun {
  public:
    FocusTraceRun(const FocusTraceRequest& request, Job& job)
        : request_(request),
          job_(job),
          choice_(request.algorithm, request.bind, job),
          execution_(job.execution.withoutProgress()) {
        if (!request.output.empty()) format_ = chooseFormat(request.output, request.format, {"csv", "html"});
    }
    FocusTrace run();

  private:
    void checkUsage() const;
    void prepare(const Resampler& resampler);
    void follow();
    FocusStep step(const Vec3d& placeWorld);
    void write();

    const FocusTraceRequest& request_;
    Job& job_;
    AlgorithmChoice choice_;
    Execution execution_;
    std::string format_;  // empty: nothing is written
    std::vector<Vec3d> path_;
    FieldSelection selection_;
    BetterBrickWatch watch_;
    std::unique_ptr<BrickScheduler> scheduler_;
    std::optional<FocusErrors> errors_;
    FocusTrace trace_;
};

void FocusTraceRun::checkUsage() const {
    if (!(std::isfinite(request_.radiusWorld) && request_.radiusWorld > 0))
        throw InputError(fmt::format("--radius: expected a number above 0, got {}", request_.radiusWorld));
    if (request_.output.empty() && !request_.format.empty())
        throw InputError("--format is for standard output (-o -)");
    checkOutputPaths({request_.input, request_.path},
                     {{"--output", request_.output}, {"--json", job_.reportPath}});
    if (!request_.output.empty()) checkWritable(request_.output);
    checkReportPath(job_);
}

/// All that bricks are made from, and the coarsest of them in order.
void FocusTraceRun::prepare(const Resampler& resampler) {
    const TetMesh& mesh = trace_.file.mesh;
    selection_ = selectFields(mesh, request_.fields);
    Timer timer;
    job_.execution.report(Stage::planning, 0, 1);
    ScheduleOptions options;
    options.refine.criterion = Criterion::focus;
    options.refine.resolution = request_.resolution;
    options.refine.spacingWorld = request_.spacingWorld;
    options.refine.brickCells = request_.brickCells;
    options.refine.bind = request_.bind;
    options.refine.bind.index = std::make_shared<const SharedElementIndex>(mesh);
    options.refine.bind.index->get(job_.execution);
    options.budgetBytes = request_.budgetBytes;
    trace_.times.indexMs = timer.restart();
    scheduler_ =
        std::make_unique<BrickScheduler>(mesh, selection_.fields, resampler, options, watch_, execution_);
    trace_.times.buildMs = timer.elapsedMs();
    trace_.finestSpacingWorld = scheduler_->frame().spacingWorld(scheduler_->frame().maxDepth);
    for (std::size_t i = 0; i < selection_.fields.size() && !errors_; ++i) {
        const OutputField& output = selection_.outputs[i];
        if (output.location != "point") continue;
        errors_.emplace(mesh, selection_.fields[i], output.firstChannel, execution_);
        trace_.errorField = output.name;
    }
}

FocusStep FocusTraceRun::step(const Vec3d& placeWorld) {
    using Milliseconds = std::chrono::duration<double, std::milli>;
    const auto frame =
        std::chrono::duration_cast<BrickScheduler::Clock::duration>(Milliseconds(request_.frameMs));
    const DepthKey finest = finestBrickAt(scheduler_->frame(), placeWorld);
    const ScheduleCounts before = scheduler_->counts();
    FocusStep step;
    step.placeWorld = placeWorld;
    watch_.begin(finest, scheduler_->tree().findCovering(finest));
    step.moved = scheduler_->setFocus({pointFocus(placeWorld, request_.radiusWorld)});
    while (!scheduler_->update(BrickScheduler::Clock::now() + frame, execution_)) {
    }
    step.restMs = watch_.elapsedMs();
    step.betterMs = watch_.betterMs();
    const ScheduleCounts& after = scheduler_->counts();
    step.sampled = after.sampled - before.sampled;
    step.reused = after.reused - before.reused;
    step.dropped = after.dropped - before.dropped;
    const std::int64_t cells = request_.brickCells;
    step.leaves = std::int64_t(scheduler_->tree().leafCount());
    step.voxels = step.leaves * cells * cells * cells;
    step.bytes = scheduler_->bytes();
    if (const auto leaf = scheduler_->tree().findCovering(finest))
        step.spacingWorld = scheduler_->frame().spacingWorld(leaf->key.depth);
    if (errors_) step.error = errors_->measure(*scheduler_, placeWorld, request_.radiusWorld);
    step.cutShort = scheduler_->isCutShort();
    return step;
}

void FocusTraceRun::follow() {
    Timer timer;
    trace_.steps.clear();
    for (std::size_t i = 0; i < path_.size(); ++i) {
        job_.execution.report(Stage::sampling, std::int64_t(i), std::int64_t(path_.size()));
        trace_.steps.push_back(step(path_[i]));
    }
    job_.execution.report(Stage::sampling, std::int64_t(path_.size()), std::int64_t(path_.size()));
    trace_.times.traceMs = timer.elapsedMs();
}

void FocusTraceRun::write() {
    if (format_.empty()) return;
    job_.execution.report(Stage::writing, 0, 1);
    Timer timer;
    writeFileAtomically(request_.output,
                        format_ == "csv" ? focusTraceCsv(trace_) : focusTraceHtml(request_, trace_, job_));
    trace_.times.writeMs = timer.elapsedMs();
}

FocusTrace FocusTraceRun::run() {
    checkUsage();
    path_ = readFocusPath(request_.path);
    job_.execution.declare({{Stage::reading, 1},
                            {Stage::repairing, request_.repair ? 1.0 : 0.0},
                            {Stage::planning, 0.2},
                            {Stage::sampling, 2},
                            {Stage::writing, 0.01}});
    Timer timer;
    trace_.file = importMesh(request_.input, {sourceNames(request_.fields, {}), request_.timeStep},
                             request_.repair, job_);
    trace_.times.readMs = timer.elapsedMs();
    tellRepair(request_.input, trace_.file, job_);
    const TetMesh& mesh = trace_.file.mesh;
    RefineOptions finest;
    finest.resolution = request_.resolution;
    finest.spacingWorld = request_.spacingWorld;
    choice_.chooseFor({mesh.elementCount(), expectedPoints(mesh, trace_.file.boundsWorld, finest)});
    choice_.run([&](const Resampler& resampler) {
        prepare(resampler);
        follow();
    });
    trace_.algorithm = choice_.resampler().name();
    trace_.algorithmReason = choice_.reason();
    trace_.target = scheduler_->resamplerTarget();
    trace_.statistics = scheduler_->statistics();
    write();
    job_.say(focusTraceText(request_, trace_, job_));
    const auto cut = std::count_if(trace_.steps.begin(), trace_.steps.end(),
                                   [](const FocusStep& s) { return s.cutShort; });
    if (cut > 0)
        job_.fellShort(
            fmt::format("{}: at {} of {} steps bricks are coarser than wished for: --budget {} holds no more",
                        request_.input, cut, trace_.steps.size(), formatBytes(request_.budgetBytes)));
    scheduler_.reset();
    return std::move(trace_);
}

TimeFigures figuresOf(std::vector<double> ms) {
    if (ms.empty()) return {};
    std::sort(ms.begin(), ms.end());
    const auto at = [&](double share) {
        return ms[std::min(ms.size() - 1, std::size_t(share * double(ms.size())))];
    };
    return {ms.size(), at(0.5), at(0.99)};
}

Json figuresJson(const TimeFigures& figures) {
    if (figures.count == 0) return nullptr;
    return {{"count", figures.count}, {"median_ms", figures.medianMs}, {"p99_ms", figures.p99Ms}};
}

template <class Value>
Json jsonOrNull(const std::optional<Value>& value) {
    return value ? Json(*value) : Json(nullptr);
}

}  // namespace

FocusSummary summarize(const std::vector<FocusStep>& steps) {
    FocusSummary summary;
    std::vector<double> better, rest;
    for (std::size_t i = 1; i < steps.size(); ++i) {
        if (!steps[i].moved) {
            ++summary.tooSmall;
            continue;
        }
        ++summary.moves;
        rest.push_back(steps[i].restMs);
        if (steps[i].betterMs) better.push_back(*steps[i].betterMs);
    }
    summary.better = figuresOf(std::move(better));
    summary.rest = figuresOf(std::move(rest));
    return summary;
}

FocusTrace traceFocus(const FocusTraceRequest& request, Job& job) {
    return FocusTraceRun(request, job).run();
}

Json focusStepJson(const FocusStep& step, std::size_t number) {
    const bool compared = step.error.nodes > 0;
    return {{"step", number},
            {"x", step.placeWorld.x},
            {"y", step.placeWorld.y},
            {"z", step.placeWorld.z},
            {"moved", step.moved},
            {"better_ms", jsonOrNull(step.betterMs)},
            {"rest_ms", step.restMs},
            {"sampled", step.sampled},
            {"reused", step.reused},
            {"dropped", step.dropped},
            {"leaves", step.leaves},
            {"voxels", step.voxels},
            {"bytes", step.bytes},
            {"spacing", jsonOrNull(step.spacingWorld)},
            {"relative_max", compared ? Json(step.error.relativeMax) : Json(nullptr)},
            {"relative_rms", compared ? Json(step.error.relativeRms) : Json(nullptr)},
            {"nodes", step.error.nodes},
            {"nodes_near", step.error.nodesNear},
            {"cut_short", step.cutShort}};
}

Json focusTraceJson(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job) {
    const FocusSummary summary = summarize(trace.steps);
    Json steps = Json::array();
    for (const FocusStep& step : trace.steps) steps.push_back(focusStepJson(step, steps.size() + 1));
    Json json = documentHead("focus-trace");
    json["input"] = request.input;
    json["path"] = request.path;
    json["output"] = request.output.empty() ? Json(nullptr) : Json(request.output);
    json["algorithm"] = trace.algorithm;
    json["algorithm_reason"] = trace.algorithmReason;
    json["sample_format"] = nameOf(request.bind.format);
    json["target"] = trace.target;
    json["threads"] = job.execution.threadCount();
    json["stages"] = {{"read", trace.times.readMs},
                      {"index", trace.times.indexMs},
                      {"build", trace.times.buildMs},
                      {"trace", trace.times.traceMs},
                      {"write", trace.times.writeMs}};
    json["elements"] = trace.file.mesh.elementCount();
    json["radius"] = request.radiusWorld;
    json["finest_spacing"] = trace.finestSpacingWorld;
    json["brick_cells"] = request.brickCells;
    json["budget_bytes"] = request.budgetBytes;
    json["frame_ms"] = request.frameMs;
    json["error_field"] = trace.errorField.empty() ? Json(nullptr) : Json(trace.errorField);
    json["summary"] = {{"moves", summary.moves},
                       {"too_small", summary.tooSmall},
                       {"better", figuresJson(summary.better)},
                       {"rest", figuresJson(summary.rest)}};
    json["steps"] = std::move(steps);
    addRepair(json, trace.file);
    json["statistics"] = statisticsJson(trace.statistics);
    json["peak_memory_bytes"] = peakMemoryBytes(job);
    return json;
}

}  // namespace tessera
