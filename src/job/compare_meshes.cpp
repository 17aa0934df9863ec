#include "job/compare_meshes.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "job/algorithm_list.h"
#include "job/compare_text.h"
#include "job/import_mesh.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/report_text.h"

namespace tessera {

namespace {

constexpr const char* kLegend =
    "holes: well inside an element, not covered. spills: covered, further from the\n"
    "mesh than the algorithm's bound. wrong values: explained by no element there\n"
    "within clause 4 of the contract; 'of allowed' is the largest share of it that a\n"
    "right value used. undecided: right as far as double can tell. at the boundary:\n"
    "within 2^-8 voxel of it.\n"
    "Thick elements: from 1/16 voxel on. In thinner ones a place off by 2^-8 voxel is\n"
    "worth much of the element's values, so pointwise differences there can be large,\n"
    "however exact the sampling is. Cell fields jump: on a shared face either\n"
    "element's value is right.\n";

/// The work of compareMeshes.
class CompareRun {
  public:
    CompareRun(const CompareRequest& request, Job& job)
        : request_(request), job_(job), list_(listAlgorithms(request.algorithms, request.bind)) {
        result_.absent = list_.absent;
    }

    Comparison run() {
        if (request_.markdown) job_.say(markdownHead());
        job_.execution.declare({{Stage::reading, 1},
                                {Stage::repairing, request_.repair ? 1.0 : 0.0},
                                {Stage::sampling, 1},
                                {Stage::comparing, 2}});
        const std::size_t count = request_.meshes.size();
        for (std::size_t m = 0; m < count; ++m) {
            if (count > 1)
                job_.execution.beginStep(fmt::format("mesh {} of {}", m + 1, count), 1,
                                         double(count - 1 - m));
            result_.meshes.push_back(compareOn(request_.meshes[m]));
        }
        if (!request_.markdown) sayEnd();
        return std::move(result_);
    }

  private:
    Json compareOn(const std::string& path) {
        const ImportedMesh file =
            importMesh(path, {sourceNames(request_.fields, {}), request_.timeStep}, request_.repair, job_);
        const FieldSelection selection = selectFields(file.mesh, request_.fields);
        const Box3d bounds = file.boundsWorld;
        const SamplingGrid grid = request_.spacing ? cubicGridOfSpacing(bounds, *request_.spacing)
                                                   : cubicGrid(bounds, request_.resolution.value_or(128));
        CompareOptions options;
        options.runs = request_.runs;
        options.boxEdge = affordableBoxEdge(request_.boxEdge, selection.channels, list_.contestants.size());
        const CompareReport report =
            compareResamplers(file.mesh, selection.fields, list_.contestants, grid, options, job_.execution);
        const std::string name = std::filesystem::path(path).filename().string();
        for (const std::string& sentence : disagreements(report))
            result_.problems.push_back(name + ": " + sentence);
        job_.say(request_.markdown ? markdownRows(name, report)
                                   : importText(path, file.statistics, bounds) +
                                         compareText(report, job_.textWidth) + "\n");
        tellRepair(path, file, job_);
        Json json{{"input", path}, {"mesh", meshJson(file.statistics, bounds, summarizeFields(file.mesh))}};
        addRepair(json, file);
        json.update(compareJson(report));
        return json;
    }

    void sayEnd() const {
        std::string text = kLegend;
        text += fmt::format("Times: wall clock, {} threads, median of {} {}; stages may overlap.\n",
                            job_.execution.threadCount(), request_.runs, request_.runs == 1 ? "run" : "runs");
        for (const std::string& sentence : result_.absent) text += sentence + "\n";
        job_.say(text + (result_.problems.empty() ? "the algorithms agree\n" : ""));
    }

    const CompareRequest& request_;
    Job& job_;
    AlgorithmList list_;
    Comparison result_;
};

}  // namespace

Comparison compareMeshes(const CompareRequest& request, Job& job) {
    checkOutputPaths(request.meshes, {{"--json", job.reportPath}});
    return CompareRun(request, job).run();
}

Json comparisonJson(const Comparison& comparison, const Job& job) {
    Json json = documentHead("compare");
    json["threads"] = job.execution.threadCount();
    json["agrees"] = comparison.problems.empty();
    json["absent"] = comparison.absent;
    json["meshes"] = comparison.meshes;
    return json;
}

}  // namespace tessera
