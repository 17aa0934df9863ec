#include <fmt/format.h>

#include <filesystem>
#include <map>

#include "base/timer.h"
#include "commands.h"
#include "field_selection.h"
#include "files/atomic_file.h"
#include "import_mesh.h"
#include "memory_plan.h"
#include "output_paths.h"
#include "predict_cost.h"
#include "program_presets.h"
#include "refine/brick_result.h"
#include "refine/measure_error.h"
#include "refine/plan.h"
#include "refine/refine.h"
#include "refine/refine_options.h"
#include "report_text.h"
#include "series_steps.h"
#include "tessera/error.h"
#include "tessera/registry.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_metadata.h"
#include "vdb/vdb_read.h"

namespace tessera {

namespace {

/// One mesh of a run and the file it becomes.
struct Step {
    SeriesStep source;
    std::string input;  ///< what messages call the mesh
    std::string output;
};

std::vector<Step> listSteps(const ResampleArguments& arguments) {
    std::vector<SeriesStep> sources = listSeries(arguments.inputs);
    // Of a .pvd file --time-step names a step.
    if (arguments.inputs.size() == 1 && isCollectionName(arguments.inputs[0]) && arguments.timeStep >= 0)
        sources = {chosenStep(arguments.inputs[0], arguments.timeStep)};
    if (!arguments.times.empty()) sources = stepsWithin(sources, parseTimes(arguments.times));
    if (sources.size() > 1 && !arguments.output.empty() && !takesNumber(arguments.output))
        throw InputError(fmt::format(
            "{} steps need as many outputs: the output needs #### or %04d for the step's number, got '{}'",
            sources.size(), arguments.output));
    std::vector<Step> steps;
    for (const SeriesStep& source : sources)
        steps.push_back({source, nameOf(source), numberedName(arguments.output, source.number)});
    return steps;
}

void checkOutputs(const std::vector<Step>& steps, const ResampleArguments& arguments) {
    const std::string& json = arguments.common.jsonPath;
    std::vector<std::string> inputs = arguments.inputs;
    inputs.push_back(arguments.like);
    std::vector<OutputPath> outputs;
    for (const Step& step : steps) {
        inputs.insert(inputs.end(), step.source.files.begin(), step.source.files.end());
        if (!arguments.dryRun) outputs.push_back({"--output", step.output});
    }
    outputs.push_back({"--json", json});
    checkOutputPaths(inputs, outputs);
    if (!json.empty() && json != "-") checkWritable(json);
    if (arguments.dryRun) return;
    for (const Step& step : steps) checkWritable(step.output);
}

/// The run of `tessera resample`: settings, and what the steps of a series share.
class ResampleRun {
  public:
    explicit ResampleRun(const ResampleArguments& arguments)
        : arguments_(arguments),
          settings_(checkedSettings(arguments)),
          repair_(repairOptions(arguments.repair)),
          choice_(chooseResampler(arguments.algorithm.name, settings_.refine.bind)),
          resampler_(*choice_.resampler),
          session_(arguments.common, arguments.dryRun ? std::string() : arguments.output) {
        settings_.write.algorithm = resampler_.name();
        if (!choice_.reason.empty()) session_.print(choice_.reason + "\n");
    }
    int run();

  private:
    ImportedMesh read(const Step& step);
    RefineOptions stepOptions(const TetMesh& mesh, const FieldSelection& selection);
    VdbWriteOptions writeOptions() const;
    OutputShape outputShape() const;
    void surveySeries(const std::vector<Step>& steps);
    void surveySpacing(const TetMesh& mesh);
    Json runStep(const Step& step);
    Json dryRun(const Step& step, const MeshFile& file, const FieldSelection& selection,
                const RefineOptions& options, StageTimes& times);
    void fellShort(const Step& step, const std::string& what);
    void warnUnbounded(const Step& step, const BrickResult& result);
    void declareStages();
    std::string flatNote(const BrickTree& tree, int channels) const;
    Json sampleAndWrite(const Step& step, const MeshFile& file, const FieldSelection& selection,
                        const RefineOptions& options, StageTimes& times);
    VdbWriteResult write(const Step& step, const MeshFile& file, const FieldSelection& selection,
                         BrickResult& result, StageTimes& times);
    void printResult(const Step& step, const BrickResult& result, const std::vector<LevelSummary>& levels,
                     const VdbWriteResult& written, const StageTimes& times);

    const ResampleArguments& arguments_;
    ResampleSettings settings_;
    std::optional<RepairOptions> repair_;
    ResamplerChoice choice_;
    const Resampler& resampler_;
    Session session_;
    StageTimes allTimes_;
    Json series_;
    bool isSeries_ = false;
    std::optional<FixedFrame> seriesFrame_;
    SampleBudget budget_;                            // of the step at hand
    std::map<std::string, std::size_t> stepsShort_;  // by what was said: how many steps it holds for
};

int ResampleRun::run() {
    const std::vector<Step> steps = listSteps(arguments_);
    checkOutputs(steps, arguments_);
    isSeries_ = steps.size() > 1 || !steps[0].source.collection.empty();
    if (!arguments_.like.empty()) {
        settings_.refine.frame = readVdbLattice(arguments_.like);
        // The file's spacing is the finest; what the caller gave beside it would contradict it.
        if (settings_.refine.resolution > 0 || settings_.refine.spacingWorld > 0)
            throw InputError("--like sets the spacing: --resolution and --spacing can't be given with it");
    }
    declareStages();
    if (steps.size() > 1) surveySeries(steps);
    Json reports = Json::array();
    for (std::size_t i = 0; i < steps.size(); ++i) {
        if (steps.size() > 1)
            session_.progress.beginStep("step", i + 1, steps.size(), 1, double(steps.size() - 1 - i));
        reports.push_back(runStep(steps[i]));
    }
    for (const auto& [what, count] : stepsShort_)
        if (count > 1)
            session_.warnFellShort(fmt::format("{} more {} like this: {}", count - 1,
                                               count == 2 ? "step is" : "steps are", what));
    if (arguments_.common.jsonPath.empty()) return session_.exitCode();
    if (steps.size() == 1) {
        writeJson(arguments_.common.jsonPath, reports[0]);
        return session_.exitCode();
    }
    Json document{{"schema", 1},
                  {"program", "tessera"},
                  {"version", TESSERA_VERSION},
                  {"command", "resample"},
                  {"stages", stagesJson(allTimes_)},
                  {"peak_memory_bytes", session_.peakMemoryBytes()},
                  {"series", series_}};
    document["steps"] = std::move(reports);
    writeJson(arguments_.common.jsonPath, document);
    return session_.exitCode();
}

/// Weights are rough shares of a usual run's time.
void ResampleRun::declareStages() {
    std::vector<ExpectedStage> stages{{Stage::reading, 0.4}};
    if (repair_) stages.push_back({Stage::repairing, 0.4});
    stages.push_back({Stage::planning, 0.1});
    stages.push_back({Stage::sampling, 1});
    if (settings_.refine.criterion == Criterion::error) stages.push_back({Stage::checking, 0.5});
    if (settings_.refine.criterion == Criterion::error || !arguments_.dryRun)
        stages.push_back({Stage::measuring, 0.4});
    if (!arguments_.dryRun) {
        if (settings_.write.layout == VdbLayout::flat || arguments_.extendLayers.value_or(0) > 0)
            stages.push_back({Stage::extending, 0.3});
        stages.push_back({Stage::writing, 0.7});
    }
    session_.progress.declare(std::move(stages));
}

ImportedMesh ResampleRun::read(const Step& step) {
    const int timeStep = step.source.collection.empty() ? arguments_.timeStep : -1;
    const ReadOptions options =
        readOptions(step.source, sourceNames(settings_.fields, settings_.errorFields), timeStep);
    return importMesh(step.source.files[0], options, repair_, session_);
}

RefineOptions ResampleRun::stepOptions(const TetMesh& mesh, const FieldSelection& selection) {
    RefineOptions options = settings_.refine;
    if (options.maxMemoryBytes > 0) {
        budget_ = sampleBudget(options.maxMemoryBytes, mesh, selection.channels,
                               settings_.write.layout == VdbLayout::flat);
        options.maxMemoryBytes = budget_.levelsBytes;
    }
    for (const std::string& name : settings_.errorFields)
        options.errorFields.push_back(findSelected(mesh, selection.fields, name));
    return options;
}

VdbWriteOptions ResampleRun::writeOptions() const {
    VdbWriteOptions options = settings_.write;
    options.boundsWorld = settings_.refine.boundsWorld;
    options.layers = settings_.shape.layers;
    options.repair = encodeRepair(repair_);
    return options;
}

OutputShape ResampleRun::outputShape() const {
    OutputShape shape = settings_.shape;
    shape.maxFlatBytes = budget_.flatBytes;
    return shape;
}

/// One lattice and one value range for all steps need a look at all of them first.
void ResampleRun::surveySeries(const std::vector<Step>& steps) {
    const bool frameGiven = settings_.refine.frame.has_value();
    SeriesSummary summary;
    for (std::size_t i = 0; i < steps.size(); ++i) {
        // A look is a reading and a plan; by the error it is all but the writing.
        const double look = settings_.refine.criterion == Criterion::error ? 0.75 : 0.25;
        session_.progress.beginStep("looking at step", i + 1, steps.size(), look,
                                    double(steps.size()) + look * double(steps.size() - 1 - i));
        const TetMesh mesh = read(steps[i]).mesh;
        summary.add(steps[i].source, mesh);
        if (!frameGiven) surveySpacing(mesh);
    }
    if (!frameGiven) settings_.refine.frame = seriesFrame_;
    settings_.refine.resolution = 0;  // the frame holds the spacing from here on
    settings_.refine.spacingWorld = 0;
    series_ = summary.json();
    std::string text = fmt::format("series of {} steps, finest spacing {:.6g}\n{}", steps.size(),
                                   settings_.refine.frame->spacingWorld, fieldsText(summary.fields()));
    for (const std::string& note : summary.notes()) text += "  " + note + "\n";
    session_.print(text);
}

/// The finest step decides the spacing for all: the first one is often a field at rest, which any spacing
/// shows well.
void ResampleRun::surveySpacing(const TetMesh& mesh) {
    const FieldSelection selection = selectFields(mesh, settings_.fields);
    const RefineOptions options = stepOptions(mesh, selection);
    const BrickTree tree =
        options.criterion == Criterion::error
            ? refineAndResample(mesh, selection.fields, resampler_, options, session_.execution).tree
            : planBricks(mesh, options, session_.execution, selection.channels);
    if (!seriesFrame_ || tree.spacingWorld() < seriesFrame_->spacingWorld)
        seriesFrame_ = FixedFrame{tree.originWorld(), tree.spacingWorld()};
}

Json ResampleRun::runStep(const Step& step) {
    StageTimes times;
    Timer timer;
    const ImportedMesh file = read(step);
    times.readMs = timer.elapsedMs();
    FieldSelection selection = selectFields(file.mesh, settings_.fields);
    const std::string names = nameFields(selection.outputs, settings_.fields, arguments_.program);
    checkOutputFields(selection.outputs);
    const RefineOptions options = stepOptions(file.mesh, selection);
    ImportStatistics shown = file.statistics;
    shown.warnings = session_.unsaid(shown.warnings);
    session_.print(importText(step.input, shown, file.mesh.boundsWorld()) +
                   (step.source.time ? fmt::format("  time {}\n", *step.source.time) : std::string()) +
                   names);
    showRepair(step.input, file, repair_, session_);

    Json report{{"schema", 1},
                {"program", "tessera"},
                {"version", TESSERA_VERSION},
                {"command", "resample"},
                {"input", step.source.files[0]},
                {"output", arguments_.dryRun ? Json(nullptr) : Json(step.output)},
                {"algorithm", resampler_.name()},
                {"algorithm_reason", choice_.reason},
                {"sample_format", nameOf(settings_.refine.bind.format)},
                {"criterion", arguments_.refine},
                {"layout", settings_.write.layout == VdbLayout::flat ? "flat" : "levels"},
                {"threads", session_.execution.threadCount()}};
    if (isSeries_) report.update(stepJson(step.source));
    if (!arguments_.program.empty()) report["for"] = arguments_.program;
    Json rest = arguments_.dryRun ? dryRun(step, file, selection, options, times)
                                  : sampleAndWrite(step, file, selection, options, times);
    report["stages"] = stagesJson(times);
    report["mesh"] = meshJson(file.statistics, file.mesh.boundsWorld(), summarizeFields(file.mesh));
    if (file.repair) report["repair"] = repairJson(file, repair_);
    report.update(rest);
    report["peak_memory_bytes"] = session_.peakMemoryBytes();
    allTimes_ += times;
    return report;
}

/// Said of the first step of a series at once, of the others together at the end.
void ResampleRun::fellShort(const Step& step, const std::string& what) {
    const std::string kind = what.substr(0, what.find_first_of(":0123456789"));
    if (++stepsShort_[kind] == 1) session_.warnFellShort(step.input + ": " + what);
}

/// A script that looks at the exit code alone would take the file for one within the bound.
void ResampleRun::warnUnbounded(const Step& step, const BrickResult& result) {
    if (!result.bounded) fellShort(step, "the error is not within the bound: " + result.stoppedBecause);
}

/// Empty when a flat file has the finest spacing of the tree, or none is asked for.
std::string ResampleRun::flatNote(const BrickTree& tree, int channels) const {
    if (settings_.write.layout != VdbLayout::flat) return {};
    return planFlatGrid(tree, channels, outputShape()).note;
}

Json ResampleRun::dryRun(const Step& step, const MeshFile& file, const FieldSelection& selection,
                         const RefineOptions& options, StageTimes& times) {
    Timer timer;
    BrickTree tree;
    std::vector<std::string> notes;
    if (options.criterion == Criterion::error) {
        // The error decides, and only sampling tells it; nothing is written, and the samples are dropped.
        BrickResult result =
            refineAndResample(file.mesh, selection.fields, resampler_, options, session_.execution);
        warnUnbounded(step, result);
        tree = std::move(result.tree);
        notes = std::move(result.notes);
    } else {
        tree = planBricks(file.mesh, options, session_.execution, selection.channels, &notes);
    }
    times.planMs = timer.elapsedMs();
    for (const std::string& note : notes) fellShort(step, note);
    if (const std::string note = flatNote(tree, selection.channels); !note.empty()) fellShort(step, note);
    const std::size_t saidNotes = notes.size();
    PlanEstimate estimate = estimatePlan(tree, selection.channels);
    const FlatGridPlan flat = planFlatGrid(tree, selection.channels, outputShape());
    estimate.flatPoints = flat.points;
    estimate.flatBytes = flat.bytes;
    if (!flat.note.empty()) notes.push_back(flat.note);
    session_.execution.report(Stage::sampling, 0, 1);
    const CostPrediction cost = predictCost(file.mesh, selection.fields, tree, estimate, selection.channels,
                                            resampler_, options.bind, session_.execution);
    std::string text = estimateText(estimate, cost.levelsMs, cost.flatMs);
    if (notes.size() > saidNotes && settings_.write.layout != VdbLayout::flat)
        text += "  " + notes.back() + "\n";
    session_.print(text + "  nothing was written\n");
    Json json = levelsJson(tree, summarizeLevels(tree, {}));
    json["notes"] = notes;
    json["estimate"] = estimateJson(estimate, cost.levelsMs, cost.flatMs);
    json["estimate"]["flat"]["level"] = flat.level;
    return json;
}

VdbWriteResult ResampleRun::write(const Step& step, const MeshFile& file, const FieldSelection& selection,
                                  BrickResult& result, StageTimes& times) {
    Timer timer;
    shapeForFile(file.mesh, selection.fields, selection.outputs, resampler_, settings_.refine.bind,
                 outputShape(), result, session_.execution);
    times.extendMs = timer.restart();
    session_.execution.report(Stage::writing, 0, 1);
    VdbWriteOptions options = writeOptions();
    const SeriesStep& source = step.source;
    options.sourceFile = std::filesystem::path(source.files.size() > 1 ? source.collection : source.files[0])
                             .filename()
                             .string();
    options.time = source.time;
    // Where every target gives the same bits, naming one would make the file depend on the processor.
    if (!resampler_.info().targetsAgree) options.target = result.target;
    VdbWriteResult written =
        settings_.format->write(step.output, selection.outputs, result, options, session_.execution);
    times.writeMs = timer.elapsedMs();
    return written;
}

/// The bound is judged by what the file shows.
void judgeFile(const TetMesh& mesh, const FieldSelection& selection, const RefineOptions& options,
               BrickResult& result) {
    if (!result.bounded) return;
    std::string exceeded = exceededBound(mesh, selection.fields, options, result.report);
    if (exceeded.empty() && result.report.incomplete > 0)
        exceeded = fmt::format("{} places beside voxels that it doesn't hold (--extend 1 adds them)",
                               formatCount(result.report.incomplete));
    if (exceeded.empty()) return;
    result.bounded = false;
    result.stoppedBecause =
        "the samples keep to the bound, but the file, which is coarser or less precise, has " + exceeded;
}

Json ResampleRun::sampleAndWrite(const Step& step, const MeshFile& file, const FieldSelection& selection,
                                 const RefineOptions& options, StageTimes& times) {
    BrickResult result =
        refineAndResample(file.mesh, selection.fields, resampler_, options, session_.execution);
    times.planMs = result.times.planMs;
    times.resampleMs = result.times.resampleMs;
    times.verifyMs = result.times.verifyMs;
    for (std::size_t f = 0; f < selection.outputs.size() && f < result.report.fields.size(); ++f)
        result.report.fields[f].name =
            selection.outputs[f].name;  // grid names are unique, names in the mesh need not be
    const std::vector<LevelSummary> levels = summarizeLevels(result.tree, result.store);
    const std::int64_t sampleBytes = result.store.memoryBytes();
    const std::string flat = flatNote(result.tree, selection.channels);
    const VdbWriteResult written = write(step, file, selection, result, times);
    if (options.criterion == Criterion::error) judgeFile(file.mesh, selection, options, result);
    printResult(step, result, levels, written, times);
    if (options.criterion == Criterion::error) warnUnbounded(step, result);
    for (const std::string& note : result.notes) fellShort(step, note);
    if (!flat.empty()) fellShort(step, flat);

    Json json = levelsJson(result.bricks ? *result.bricks : result.tree, levels);
    json["coverage"] = coverageJson(result.report);
    json["error"] = errorJson(result.report);
    if (result.samplesReport) json["samples_error"] = errorJson(*result.samplesReport);
    if (options.criterion == Criterion::error)
        json["refinement"] = {{"max_error", options.maxError},
                              {"relative", options.maxErrorIsRelative},
                              {"measure", arguments_.errorMeasure},
                              {"bounded", result.bounded},
                              {"stopped_because", result.stoppedBecause},
                              {"rounds", result.rounds}};
    json["notes"] = result.notes;
    if (!flat.empty()) json["notes"].push_back(flat);
    json["target"] = result.target;
    json["statistics"] = statisticsJson(result.statistics);
    json["write"] = writeResultJson(written, result.flatLevel);
    json["sample_bytes"] = sampleBytes;
    return json;
}

void ResampleRun::printResult(const Step& step, const BrickResult& result,
                              const std::vector<LevelSummary>& levels, const VdbWriteResult& written,
                              const StageTimes& times) {
    std::string text = levelsText(levels) + errorText(result.report);
    if (result.samplesReport)
        text += "  the samples before they became the file's voxels:\n" + errorText(*result.samplesReport);
    if (settings_.refine.criterion == Criterion::error && result.bounded)
        text += "  the error is within the bound\n";
    for (const std::string& note : written.notes) text += "  " + note + "\n";
    text += stagesText(times);
    text +=
        fmt::format("{}: {}, {} active voxels; peak memory {}\n", step.output, formatBytes(written.fileBytes),
                    formatCount(written.activeVoxels), formatBytes(session_.peakMemoryBytes()));
    session_.print(text);
}

}  // namespace

int runResample(const ResampleArguments& arguments) {
    const ResampleArguments settled = settleProgram(arguments);
    return ResampleRun(settled).run();
}

}  // namespace tessera
