#include <fmt/format.h>

#include <filesystem>

#include "algorithm_list.h"
#include "commands.h"
#include "compare_text.h"
#include "field_selection.h"
#include "import_mesh.h"
#include "output_paths.h"
#include "report_text.h"

namespace tessera {

namespace {

constexpr int kExitDisagree = 1;
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

class CompareRun {
  public:
    explicit CompareRun(const CompareArguments& arguments)
        : arguments_(arguments),
          repair_(repairOptions(arguments.repair)),
          list_(listAlgorithms(arguments.algorithms, arguments.algorithm)),
          session_(arguments.common) {
        if (arguments.fields.empty()) return;
        choices_ = parseFields(arguments.fields);
    }

    int run() {
        Json meshes = Json::array();
        if (arguments_.markdown) session_.print(markdownHead());
        session_.progress.declare({{Stage::reading, 1},
                                   {Stage::repairing, repair_ ? 1.0 : 0.0},
                                   {Stage::sampling, 1},
                                   {Stage::comparing, 2}});
        const std::size_t count = arguments_.meshes.size();
        for (std::size_t m = 0; m < count; ++m) {
            if (count > 1) session_.progress.beginStep("mesh", m + 1, count, 1, double(count - 1 - m));
            meshes.push_back(compareOn(arguments_.meshes[m]));
        }
        if (!arguments_.markdown) printEnd();
        Json json{{"schema", 1},
                  {"program", "tessera"},
                  {"version", TESSERA_VERSION},
                  {"command", "compare"},
                  {"threads", session_.execution.threadCount()},
                  {"agrees", problems_.empty()},
                  {"absent", list_.absent},
                  {"meshes", std::move(meshes)}};
        if (!arguments_.common.jsonPath.empty()) writeJson(arguments_.common.jsonPath, json);
        for (const std::string& problem : problems_) session_.warnFellShort(problem);
        return problems_.empty() ? 0 : kExitDisagree;
    }

  private:
    Json compareOn(const std::string& path) {
        const ImportedMesh file =
            importMesh(path, {sourceNames(choices_, {}), arguments_.timeStep}, repair_, session_);
        const FieldSelection selection = selectFields(file.mesh, choices_);
        const Box3d bounds = file.mesh.boundsWorld();
        const SamplingGrid grid = arguments_.spacing ? cubicGridOfSpacing(bounds, *arguments_.spacing)
                                                     : cubicGrid(bounds, arguments_.resolution.value_or(128));
        CompareOptions options;
        options.runs = arguments_.runs;
        options.boxEdge = affordableBoxEdge(arguments_.boxEdge, selection.channels, list_.contestants.size());
        const CompareReport report = compareResamplers(file.mesh, selection.fields, list_.contestants, grid,
                                                       options, session_.execution);
        const std::string name = std::filesystem::path(path).filename().string();
        for (const std::string& sentence : disagreements(report)) problems_.push_back(name + ": " + sentence);
        session_.print(arguments_.markdown
                           ? markdownRows(name, report)
                           : importText(path, file.statistics, bounds) + compareText(report) + "\n");
        showRepair(path, file, repair_, session_);
        Json json{{"input", path}, {"mesh", meshJson(file.statistics, bounds, summarizeFields(file.mesh))}};
        if (file.repair) json["repair"] = repairJson(file, repair_);
        json.update(compareJson(report));
        return json;
    }

    void printEnd() {
        std::string text = kLegend;
        text += fmt::format("Times: wall clock, {} threads, median of {} {}; stages may overlap.\n",
                            session_.execution.threadCount(), arguments_.runs,
                            arguments_.runs == 1 ? "run" : "runs");
        for (const std::string& sentence : list_.absent) text += sentence + "\n";
        session_.print(text + (problems_.empty() ? "the algorithms agree\n" : ""));
    }

    const CompareArguments& arguments_;
    std::optional<RepairOptions> repair_;
    AlgorithmList list_;
    Session session_;
    std::vector<FieldChoice> choices_;
    std::vector<std::string> problems_;
};

}  // namespace

int runCompare(const CompareArguments& arguments) {
    checkOutputPaths(arguments.meshes, {{"--json", arguments.common.jsonPath}});
    return CompareRun(arguments).run();
}

}  // namespace tessera
