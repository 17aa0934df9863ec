#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "job/predict_cost.h"
#include "job/resample_request.h"
#include "job/run_report.h"

namespace tessera {

/// One mesh of a run and the file it becomes.
struct ResampleStep {
    SeriesStep source;
    std::string input;  ///< what messages call the mesh
    std::string output;
};

/// What a request means for one mesh.
struct StepPlan {
    FieldSelection selection;
    std::string namesText;  ///< lines that say which grids got a program's names
    RefineOptions refine;
    OutputShape shape;
};
/// Throws InputError when the mesh lacks a field, or the memory for samples is too small.
StepPlan planStep(const TetMesh& mesh, const ResampleRequest& request, const Resampler& resampler);

/// What became of a step.
struct StepResult {
    BrickResult bricks;                ///< a dry run: no samples, and a report only with an error bound
    std::vector<LevelSummary> levels;  ///< of the samples
    FlatGridPlan flat;                 ///< where the layout is flat, and in a dry run
    std::int64_t sampleBytes = 0;
    VdbWriteResult file;
    PlanEstimate estimate;  ///< a dry run alone, as the cost
    CostPrediction cost;
};

/// Samples the mesh and writes its file, or in a dry run only plans, which for an error bound takes samples.
/// @param times gets what each stage took. Throws what refining and writing do.
StepResult resampleStep(const ResampleStep& step, const TetMesh& mesh, const StepPlan& plan,
                        const ResampleRequest& request, const Resampler& resampler, StageTimes& times,
                        const Execution& execution);

/// @param width columns that tables keep to.
std::string stepText(const StepResult& result, const ResampleRequest& request, std::size_t width);
Json stepJson(const StepResult& result, const ResampleRequest& request);
/// Sentences: what isn't as it was asked for.
std::vector<std::string> shortfalls(const StepResult& result, const ResampleRequest& request);

}  // namespace tessera
