#include "job/resample_files.h"

#include <fmt/format.h>

#include <map>
#include <set>
#include <utility>

#include "base/timer.h"
#include "files/atomic_file.h"
#include "job/algorithm_choice.h"
#include "job/import_mesh.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/report_text.h"
#include "job/resample_step.h"
#include "job/series_steps.h"
#include "job/vdb_contents.h"
#include "refine/plan.h"
#include "refine/plan_frame.h"
#include "schedule/schedule_bricks.h"
#include "tessera/error.h"
#include "vdb/vdb_metadata.h"

namespace tessera {

namespace {

std::vector<ResampleStep> listSteps(const ResampleRequest& request) {
    std::vector<SeriesStep> sources = listSeries(request.inputs);
    // Of a .pvd file --time-step names a step.
    if (request.inputs.size() == 1 && isCollectionName(request.inputs[0]) && request.timeStep >= 0)
        sources = {chosenStep(request.inputs[0], request.timeStep)};
    if (request.times) sources = stepsWithin(sources, *request.times);
    if (sources.size() > 1 && !request.output.empty() && !takesNumber(request.output))
        throw InputError(fmt::format(
            "{} steps need as many outputs: the output needs #### or %04d for the step's number, got '{}'",
            sources.size(), request.output));
    std::vector<ResampleStep> steps;
    for (const SeriesStep& source : sources)
        steps.push_back({source, nameOf(source), numberedName(request.output, source.number)});
    return steps;
}

void checkOutputs(const std::vector<ResampleStep>& steps, const ResampleRequest& request, const Job& job) {
    std::vector<std::string> inputs = request.inputs;
    inputs.push_back(request.like);
    std::vector<OutputPath> outputs;
    for (const ResampleStep& step : steps) {
        inputs.insert(inputs.end(), step.source.files.begin(), step.source.files.end());
        if (!request.dryRun) outputs.push_back({"--output", step.output});
    }
    outputs.push_back({"--json", job.reportPath});
    checkOutputPaths(inputs, outputs);
    checkReportPath(job);
    if (request.dryRun) return;
    for (const ResampleStep& step : steps) checkWritable(step.output);
}

/// The work of resampleFiles: the request, and what the steps of a series share.
class ResampleRun {
  public:
    ResampleRun(const ResampleRequest& request, Job& job)
        : request_(request), job_(job), choice_(request.algorithm, request.refine.bind, job) {
        request_.write.boundsWorld = request_.refine.boundsWorld;
        request_.write.layers = request_.shape.layers;
        request_.write.repair = encodeRepair(request_.repair);
    }
    Json run();

  private:
    void takeLattice();
    void declareStages() const;
    ImportedMesh read(const ResampleStep& step);
    void surveySeries(const std::vector<ResampleStep>& steps);
    void surveySpacing(const TetMesh& mesh);
    Json runStep(const ResampleStep& step);
    Json documentOf(const ResampleStep& step) const;
    void sayImport(const ResampleStep& step, const ImportedMesh& file, const StepPlan& plan);
    void fellShort(const ResampleStep& step, const std::vector<std::string>& sentences);

    ResampleRequest request_;
    Job& job_;
    AlgorithmChoice choice_;
    StageTimes allTimes_;
    Json series_;
    bool isSeries_ = false;
    std::optional<FixedFrame> seriesFrame_;
    std::set<std::string> saidWarnings_;             // of imports
    std::map<std::string, std::size_t> stepsShort_;  // by what was said: how many steps it holds for
};

Json ResampleRun::run() {
    const std::vector<ResampleStep> steps = listSteps(request_);
    checkOutputs(steps, request_, job_);
    isSeries_ = steps.size() > 1 || !steps[0].source.collection.empty();
    if (steps.size() > 1 && !request_.log.empty())
        throw InputError("--resume keeps the bricks of one mesh, and this is a series of " +
                         std::to_string(steps.size()) + " steps");
    if (!request_.like.empty()) takeLattice();
    declareStages();
    if (steps.size() > 1) surveySeries(steps);
    Json reports = Json::array();
    for (std::size_t i = 0; i < steps.size(); ++i) {
        if (steps.size() > 1)
            job_.execution.beginStep(fmt::format("step {} of {}", i + 1, steps.size()), 1,
                                     double(steps.size() - 1 - i));
        reports.push_back(runStep(steps[i]));
    }
    for (const auto& [what, count] : stepsShort_)
        if (count > 1)
            job_.fellShort(fmt::format("{} more {} like this: {}", count - 1,
                                       count == 2 ? "step is" : "steps are", what));
    if (steps.size() == 1) return reports[0];
    Json document = documentHead("resample");
    document["stages"] = stagesJson(allTimes_);
    document["peak_memory_bytes"] = peakMemoryBytes(job_);
    document["series"] = series_;
    document["steps"] = std::move(reports);
    return document;
}

void ResampleRun::takeLattice() {
    request_.refine.frame = openVdbLattice(request_.like, job_);
    // The file's spacing is the finest; what the caller gave beside it would contradict it.
    if (request_.refine.resolution > 0 || request_.refine.spacingWorld > 0)
        throw InputError("--like sets the spacing: --resolution and --spacing can't be given with it");
}

/// Weights are rough shares of a usual run's time.
void ResampleRun::declareStages() const {
    const bool byError = request_.refine.criterion.has(Criterion::error);
    std::vector<ExpectedStage> stages{{Stage::reading, 0.4}};
    if (request_.repair) stages.push_back({Stage::repairing, 0.4});
    stages.push_back({Stage::planning, 0.1});
    stages.push_back({Stage::sampling, 1});
    if (byError) stages.push_back({Stage::checking, 0.5});
    if (byError || !request_.dryRun) stages.push_back({Stage::measuring, 0.4});
    if (!request_.dryRun) {
        if (request_.shape.layout == VdbLayout::flat || request_.shape.layers > 0)
            stages.push_back({Stage::extending, 0.3});
        stages.push_back({Stage::writing, 0.7});
    }
    job_.execution.declare(std::move(stages));
}

ImportedMesh ResampleRun::read(const ResampleStep& step) {
    const int timeStep = step.source.collection.empty() ? request_.timeStep : -1;
    const ReadOptions options =
        readOptions(step.source, sourceNames(request_.fields, request_.errorFields), timeStep);
    return importMesh(step.source.files[0], options, request_.repair, job_);
}

/// One lattice and one value range for all steps need a look at all of them first.
void ResampleRun::surveySeries(const std::vector<ResampleStep>& steps) {
    const bool frameGiven = request_.refine.frame.has_value();
    SeriesSummary summary;
    for (std::size_t i = 0; i < steps.size(); ++i) {
        // A look is a reading and a plan; by the error it is all but the writing.
        const double look = request_.refine.criterion.has(Criterion::error) ? 0.75 : 0.25;
        job_.execution.beginStep(fmt::format("looking at step {} of {}", i + 1, steps.size()), look,
                                 double(steps.size()) + look * double(steps.size() - 1 - i));
        const TetMesh mesh = read(steps[i]).mesh;
        summary.add(steps[i].source, mesh);
        if (!frameGiven) surveySpacing(mesh);
    }
    if (!frameGiven) request_.refine.frame = seriesFrame_;
    request_.refine.resolution = 0;  // the frame holds the spacing from here on
    request_.refine.spacingWorld = 0;
    series_ = summary.json();
    std::string text =
        fmt::format("series of {} steps, finest spacing {:.6g}\n{}", steps.size(),
                    request_.refine.frame->spacingWorld, fieldsText(summary.fields(), job_.textWidth));
    for (const std::string& note : summary.notes()) text += "  " + note + "\n";
    job_.say(text);
}

/// The finest step decides the spacing for all: the first one is often a field at rest, which any spacing
/// shows well.
void ResampleRun::surveySpacing(const TetMesh& mesh) {
    choice_.chooseFor({mesh.elementCount(), expectedPoints(mesh, mesh.boundsWorld(), request_.refine)});
    const StepPlan plan = planStep(mesh, request_, choice_.resampler());
    const FieldSelection& selection = plan.selection;
    const BrickTree tree =
        plan.refine.criterion.has(Criterion::error) || plan.refine.criterion.has(Criterion::visibility)
            ? choice_
                  .run([&](const Resampler& resampler) {
                      return makeBricks(mesh, selection.fields, resampler, plan.refine, job_.execution);
                  })
                  .tree
            : planBricks(mesh, plan.refine, job_.execution, selection.channels);
    if (!seriesFrame_ || tree.spacingWorld() < seriesFrame_->spacingWorld)
        seriesFrame_ = FixedFrame{tree.originWorld(), tree.spacingWorld()};
}

Json ResampleRun::runStep(const ResampleStep& step) {
    StageTimes times;
    Timer timer;
    const ImportedMesh file = read(step);
    times.readMs = timer.elapsedMs();
    choice_.chooseFor(
        {file.mesh.elementCount(), expectedPoints(file.mesh, file.boundsWorld, request_.refine)});
    const StepPlan plan = planStep(file.mesh, request_, choice_.resampler());
    checkOutputFields(plan.selection.outputs, request_.shape.hasSurface());
    sayImport(step, file, plan);
    const auto resample = [&](const Resampler& resampler) {
        request_.write.algorithm = resampler.name();
        return resampleStep(step, file.mesh, plan, request_, resampler, times, job_.execution);
    };
    // A log holds bricks of one algorithm.
    const StepResult result = request_.log.empty() ? choice_.run(resample) : resample(choice_.resampler());
    Json report = documentOf(step);
    // A dry run says what falls short first, others when the file is there.
    if (request_.dryRun) fellShort(step, shortfalls(result, request_));
    std::string text = stepText(result, request_, job_.textWidth);
    if (!request_.dryRun)
        text += stagesText(times) + fmt::format("{}: {}, {} active voxels; peak memory {}\n", step.output,
                                                formatBytes(result.file.fileBytes),
                                                formatCount(result.file.activeVoxels),
                                                formatBytes(peakMemoryBytes(job_)));
    job_.say(text);
    if (!request_.dryRun) fellShort(step, shortfalls(result, request_));
    report["stages"] = stagesJson(times);
    report["mesh"] = meshJson(file.statistics, file.boundsWorld, summarizeFields(file.mesh));
    addRepair(report, file);
    report.update(stepJson(result, request_));
    report["peak_memory_bytes"] = peakMemoryBytes(job_);
    allTimes_ += times;
    return report;
}

Json ResampleRun::documentOf(const ResampleStep& step) const {
    Json report = documentHead("resample");
    report["input"] = step.source.files[0];
    report["output"] = request_.dryRun ? Json(nullptr) : Json(step.output);
    report["algorithm"] = choice_.resampler().name();
    report["algorithm_reason"] = choice_.reason();
    report["sample_format"] = nameOf(request_.refine.bind.format);
    report["criterion"] = request_.write.criterion;
    report["layout"] = request_.shape.layout == VdbLayout::flat ? "flat" : "levels";
    report["threads"] = job_.execution.threadCount();
    if (isSeries_) report.update(stepJson(step.source));
    if (!request_.program.empty()) report["for"] = request_.program;
    return report;
}

/// Of a series a warning is said once.
void ResampleRun::sayImport(const ResampleStep& step, const ImportedMesh& file, const StepPlan& plan) {
    ImportStatistics shown = file.statistics;
    std::erase_if(shown.warnings, [this](const std::string& w) { return !saidWarnings_.insert(w).second; });
    job_.say(importText(step.input, shown, file.boundsWorld) +
             (step.source.time ? fmt::format("  time {}\n", *step.source.time) : std::string()) +
             plan.namesText);
    tellRepair(step.input, file, job_);
}

/// Said of the first step of a series at once, of the others together at the end. A script that looks at the
/// exit code alone would take the file for what was asked for.
void ResampleRun::fellShort(const ResampleStep& step, const std::vector<std::string>& sentences) {
    for (const std::string& what : sentences) {
        const std::string kind = what.substr(0, what.find_first_of(":0123456789"));
        if (++stepsShort_[kind] == 1) job_.fellShort(step.input + ": " + what);
    }
}

}  // namespace

Json resampleFiles(const ResampleRequest& request, Job& job) {
    return ResampleRun(request, job).run();
}

}  // namespace tessera
