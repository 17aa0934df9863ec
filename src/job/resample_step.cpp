#include "job/resample_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "base/machine_memory.h"
#include "base/timer.h"
#include "cache/brick_log.h"
#include "job/memory_plan.h"
#include "job/program_presets.h"
#include "job/report_text.h"
#include "mesh_files/find_field.h"
#include "refine/measure_error.h"
#include "refine/plan.h"
#include "refine/plan_frame.h"
#include "refine/refine.h"
#include "schedule/schedule_bricks.h"

namespace tessera {

namespace {

/// What decides is known only of samples.
bool needsSamples(const RefineOptions& options) {
    return options.criterion.has(Criterion::error) || options.criterion.has(Criterion::visibility);
}

void dryRun(const TetMesh& mesh, const StepPlan& plan, const Resampler& resampler, StepResult& result,
            StageTimes& times, const Execution& execution) {
    Timer timer;
    const FieldSelection& selection = plan.selection;
    BrickResult& bricks = result.bricks;
    if (needsSamples(plan.refine)) {
        // The error decides, and only sampling tells it; nothing is written, and the samples are dropped.
        bricks = makeBricks(mesh, selection.fields, resampler, plan.refine, execution);
        bricks.store = {};
    } else {
        bricks.tree = planBricks(mesh, plan.refine, execution, selection.channels, &bricks.notes);
    }
    times.planMs = timer.elapsedMs();
    result.levels = summarizeLevels(bricks.tree, {});
    result.flat = planFlatGrid(bricks.tree, selection.channels, plan.shape);
    result.estimate = estimatePlan(bricks.tree, selection.channels);
    result.estimate.flatPoints = result.flat.points;
    result.estimate.flatBytes = result.flat.bytes;
    execution.report(Stage::sampling, 0, 1);
    result.cost = predictCost(mesh, selection.fields, bricks.tree, result.estimate, selection.channels,
                              resampler, plan.refine.bind, execution);
}

std::shared_ptr<BrickArchive> openLog(const TetMesh& mesh, const StepPlan& plan, const Resampler& resampler,
                                      const std::string& path, const Execution& execution) {
    if (path.empty()) return nullptr;
    const Box3d box = meshBounds(mesh, execution);
    checkOptions(mesh, box, plan.refine);
    std::string algorithm = resampler.name();
    if (!resampler.info().targetsAgree)
        algorithm += fmt::format(
            " {}", plan.refine.bind.target.empty() ? resampler.targets().front() : plan.refine.bind.target);
    if (plan.refine.bind.format != SampleFormat::r32f)
        algorithm += fmt::format(" {}", nameOf(plan.refine.bind.format));
    return std::make_shared<BrickLog>(
        path, BrickLog::describe(mesh, plan.selection.fields, algorithm, chooseFrame(box, plan.refine)),
        plan.refine.brickCells, plan.selection.channels);
}

void sample(const TetMesh& mesh, const StepPlan& plan, const Resampler& resampler, const std::string& log,
            StepResult& result, StageTimes& times, const Execution& execution) {
    BrickResult& bricks = result.bricks;
    bricks = makeBricks(mesh, plan.selection.fields, resampler, plan.refine, execution,
                        openLog(mesh, plan, resampler, log, execution));
    times.planMs = bricks.times.planMs;
    times.resampleMs = bricks.times.resampleMs;
    times.verifyMs = bricks.times.verifyMs;
    // Grid names are unique, names in the mesh need not be.
    const std::vector<OutputField>& outputs = plan.selection.outputs;
    for (std::size_t f = 0; f < outputs.size() && f < bricks.report.fields.size(); ++f)
        bricks.report.fields[f].name = outputs[f].name;
    result.levels = summarizeLevels(bricks.tree, bricks.store);
    result.sampleBytes = bricks.store.memoryBytes();
    if (plan.shape.layout == VdbLayout::flat)
        result.flat = planFlatGrid(bricks.tree, plan.selection.channels, plan.shape);
}

void write(const ResampleStep& step, const TetMesh& mesh, const StepPlan& plan,
           const ResampleRequest& request, const Resampler& resampler, StepResult& result, StageTimes& times,
           const Execution& execution) {
    Timer timer;
    shapeForFile(mesh, plan.selection.fields, plan.selection.outputs, resampler, plan.refine.bind, plan.shape,
                 result.bricks, execution);
    times.extendMs = timer.restart();
    execution.report(Stage::writing, 0, 1);
    VdbWriteOptions options = request.write;
    const SeriesStep& source = step.source;
    options.sourceFile = std::filesystem::path(source.files.size() > 1 ? source.collection : source.files[0])
                             .filename()
                             .string();
    options.time = source.time;
    // Where every target gives the same bits, naming one would make the file depend on the processor.
    if (!resampler.info().targetsAgree) options.target = result.bricks.target;
    result.file =
        request.format->write(step.output, plan.selection.outputs, result.bricks, options, execution);
    times.writeMs = timer.elapsedMs();
}

/// The bound is judged by what the file shows.
void judgeFile(const TetMesh& mesh, const StepPlan& plan, BrickResult& bricks) {
    if (!isBoundedEverywhere(plan.refine) || !bricks.bounded) return;
    std::string exceeded = exceededBound(mesh, plan.selection.fields, plan.refine, bricks.report);
    if (exceeded.empty() && bricks.report.incomplete > 0)
        exceeded = fmt::format("{} places beside voxels that it doesn't hold (--extend 1 adds them)",
                               formatCount(bricks.report.incomplete));
    if (exceeded.empty()) return;
    bricks.bounded = false;
    bricks.stoppedBecause =
        "the samples keep to the bound, but the file, which is coarser or less precise, has " + exceeded;
}

}  // namespace

StepPlan planStep(const TetMesh& mesh, const ResampleRequest& request, const Resampler& resampler) {
    StepPlan plan{selectFields(mesh, request.fields), {}, request.refine, request.shape};
    plan.namesText = nameFields(plan.selection.outputs, request.fields, request.program);
    const WorkMemory work = resampler.workMemory(plan.selection.channels);
    const MemoryShares shares =
        shareMemory(request.refine.maxMemoryBytes, mesh, plan.shape.layout == VdbLayout::flat, work);
    plan.refine.bind.workBytes = shares.workBytes;
    if (request.refine.maxMemoryBytes > 0) {
        plan.refine.maxMemoryBytes = shares.levelsBytes;
        plan.shape.maxFlatBytes = shares.flatBytes;
    } else {
        plan.refine.defaultMemoryBytes = shares.levelsBytes;
        plan.shape.maxFlatBytes = std::min(shares.flatBytes, machineMemoryBytes() / 4);
    }
    for (const std::string& name : request.errorFields)
        plan.refine.errorFields.push_back(findField(mesh, plan.selection.fields, name));
    return plan;
}

StepResult resampleStep(const ResampleStep& step, const TetMesh& mesh, const StepPlan& plan,
                        const ResampleRequest& request, const Resampler& resampler, StageTimes& times,
                        const Execution& execution) {
    StepResult result;
    if (request.dryRun) {
        dryRun(mesh, plan, resampler, result, times, execution);
        return result;
    }
    sample(mesh, plan, resampler, request.log, result, times, execution);
    write(step, mesh, plan, request, resampler, result, times, execution);
    judgeFile(mesh, plan, result.bricks);
    return result;
}

std::string stepText(const StepResult& result, const ResampleRequest& request, std::size_t width) {
    if (request.dryRun) {
        std::string text = estimateText(result.estimate, result.cost, width);
        // Of a flat layout it is a shortfall.
        if (!result.flat.note.empty() && request.shape.layout != VdbLayout::flat)
            text += "  " + result.flat.note + "\n";
        return text + "  nothing was written\n";
    }
    const BrickResult& bricks = result.bricks;
    std::string text = levelsText(result.levels, width) + errorText(bricks.report, width);
    if (bricks.samplesReport)
        text +=
            "  the samples before they became the file's voxels:\n" + errorText(*bricks.samplesReport, width);
    if (isBoundedEverywhere(request.refine) && bricks.bounded) text += "  the error is within the bound\n";
    for (const std::string& note : result.file.notes) text += "  " + note + "\n";
    return text;
}

Json stepJson(const StepResult& result, const ResampleRequest& request) {
    const BrickResult& bricks = result.bricks;
    const RefineOptions& refine = request.refine;
    Json json = levelsJson(bricks.bricks ? *bricks.bricks : bricks.tree, result.levels);
    Json notes = bricks.notes;
    if (!result.flat.note.empty()) notes.push_back(result.flat.note);
    if (request.dryRun) {
        json["notes"] = notes;
        json["estimate"] = estimateJson(result.estimate, result.cost);
        json["estimate"]["flat"]["level"] = result.flat.level;
        return json;
    }
    json["coverage"] = coverageJson(bricks.report);
    json["error"] = errorJson(bricks.report);
    if (bricks.samplesReport) json["samples_error"] = errorJson(*bricks.samplesReport);
    if (refine.criterion.has(Criterion::error))
        json["refinement"] = {{"max_error", refine.maxError},
                              {"relative", refine.maxErrorIsRelative},
                              {"measure", refine.measure == ErrorMeasure::rms ? "rms" : "max"},
                              {"bounded", bricks.bounded},
                              {"stopped_because", bricks.stoppedBecause},
                              {"rounds", bricks.rounds}};
    json["notes"] = notes;
    json["target"] = bricks.target;
    json["statistics"] = statisticsJson(bricks.statistics);
    json["write"] = writeResultJson(result.file, bricks.flatLevel);
    json["sample_bytes"] = result.sampleBytes;
    return json;
}

std::vector<std::string> shortfalls(const StepResult& result, const ResampleRequest& request) {
    std::vector<std::string> sentences;
    if (request.refine.criterion.has(Criterion::error) && !result.bricks.bounded)
        sentences.push_back("the error is not within the bound: " + result.bricks.stoppedBecause);
    sentences.insert(sentences.end(), result.bricks.notes.begin(), result.bricks.notes.end());
    if (request.shape.layout == VdbLayout::flat && !result.flat.note.empty())
        sentences.push_back(result.flat.note);
    return sentences;
}

}  // namespace tessera
