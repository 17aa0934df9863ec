#include <fmt/format.h>

#include <filesystem>

#include "base/error.h"
#include "base/timer.h"
#include "commands.h"
#include "gl_report.h"
#include "import_mesh.h"
#include "io/vdb_file.h"
#include "output_paths.h"
#include "report_text.h"

namespace tessera {

namespace {

Json documentHead(const std::string& path) {
    return {{"schema", 1},
            {"program", "tessera"},
            {"version", TESSERA_VERSION},
            {"command", "info"},
            {"input", path.empty() ? Json() : Json(path)}};
}

Json gridsJson(const VdbFile& file) {
    Json grids = Json::array();
    for (std::size_t g = 0; g < file.gridNames.size(); ++g)
        grids.push_back({{"name", file.gridNames[g]},
                         {"active_voxels", g < file.gridVoxels.size() ? file.gridVoxels[g] : 0}});
    return grids;
}

/// Prints what the file holds, and gives the same as a document when one is wanted.
Json showVdb(const InfoArguments& arguments, Session& session) {
    refuseReaderBounds(arguments.common.reader, arguments.path + " is no mesh");
    const VdbFile file = readVdb(arguments.path);
    std::vector<std::vector<std::string>> rows{{"grid", "active voxels"}};
    for (std::size_t g = 0; g < file.gridNames.size(); ++g)
        rows.push_back(
            {file.gridNames[g], g < file.gridVoxels.size() ? formatCount(file.gridVoxels[g]) : ""});
    const std::vector<LevelSummary> levels = summarizeLevels(file.tree, file.store);
    const Vec3d& origin = file.tree.originWorld();
    std::string text = fmt::format(
        "{}: OpenVDB file by Tessera {}, layout {}\n  from {}, algorithm {}, criterion {}\n"
        "  lattice origin ({:.9g}, {:.9g}, {:.9g}), finest spacing {:.9g}, bricks of {}^3 cells, {:.9g} file "
        "units per world unit\n",
        arguments.path, file.version, file.layout == VdbLayout::flat ? "flat" : "levels", file.sourceFile,
        file.algorithm, file.criterion, origin.x, origin.y, origin.z, file.tree.spacingWorld(),
        file.tree.brickCells(), file.unitScale);
    if (!file.target.empty()) text += fmt::format("  sampled on {}\n", file.target);
    if (!file.sampleFormat.empty()) text += fmt::format("  sampled in format {}\n", file.sampleFormat);
    if (!file.repair.empty()) text += fmt::format("  from a mesh that was repaired: {}\n", file.repair);
    if (file.boundsWorld) {
        const Box3d& b = *file.boundsWorld;
        text += fmt::format("  bounds ({:.9g}, {:.9g}, {:.9g}) to ({:.9g}, {:.9g}, {:.9g})\n", b.min.x,
                            b.min.y, b.min.z, b.max.x, b.max.y, b.max.z);
    }
    session.print(text + formatTable(rows) + levelsText(levels) + errorText(file.report));
    if (arguments.common.jsonPath.empty()) return {};
    Json json = documentHead(arguments.path);
    json["source"] = file.sourceFile;
    json["algorithm"] = file.algorithm;
    if (!file.target.empty()) json["target"] = file.target;
    if (!file.sampleFormat.empty()) json["sample_format"] = file.sampleFormat;
    if (!file.repair.empty()) json["repair"] = Json::parse(encodeRepair(decodeRepair(file.repair)));
    json["criterion"] = file.criterion;
    json["layout"] = file.layout == VdbLayout::flat ? "flat" : "levels";
    json["unit_scale"] = file.unitScale;
    if (const auto& b = file.boundsWorld)
        json["bounds"] = {{b->min.x, b->min.y, b->min.z}, {b->max.x, b->max.y, b->max.z}};
    json["grids"] = gridsJson(file);
    json.update(levelsJson(file.tree, levels));
    json["coverage"] = coverageJson(file.report);
    json["error"] = errorJson(file.report);
    return json;
}

Json showMesh(const InfoArguments& arguments, Session& session) {
    Timer timer;
    const std::optional<RepairOptions> repair = repairOptions(arguments.repair);
    const ImportedMesh file = importMesh(arguments.path, {{}, arguments.timeStep}, repair, session);
    StageTimes times;
    times.readMs = timer.elapsedMs();
    const Box3d bounds = file.mesh.boundsWorld();
    const std::vector<FieldSummary> fields = summarizeFields(file.mesh);
    const ClassLimits limits = repair ? repair->limits : ClassLimits{};
    const ClassCounts classes =
        file.repair ? file.repair->before : countClasses(file.mesh, limits, session.execution);
    session.print(importText(arguments.path, file.statistics, bounds) + classesText(classes, limits) +
                  fieldsText(fields));
    showRepair(arguments.path, file, repair, session);
    if (arguments.common.jsonPath.empty()) return {};
    Json json = documentHead(arguments.path);
    json["stages"] = stagesJson(times);
    json["mesh"] = meshJson(file.statistics, bounds, fields);
    json["classes"] = classesJson(classes, limits);
    if (file.repair) json["repair"] = repairJson(file, repair);
    return json;
}

}  // namespace

int runInfo(const InfoArguments& arguments) {
    if (arguments.path.empty() && !arguments.gl) throw InputError("info needs a file, or --gl");
    checkOutputPaths({arguments.path}, {{"--json", arguments.common.jsonPath}});
    Session session(arguments.common);
    session.progress.declare({{Stage::reading, 1}, {Stage::repairing, arguments.repair.repair ? 1.0 : 0.0}});
    Json json = documentHead(arguments.path);
    if (!arguments.path.empty()) {
        const bool isVdb = std::filesystem::path(arguments.path).extension() == ".vdb";
        json = isVdb ? showVdb(arguments, session) : showMesh(arguments, session);
    }
    if (arguments.gl) {
        session.print(glText());
        json["gl"] = glJson();
    }
    if (!arguments.common.jsonPath.empty()) writeJson(arguments.common.jsonPath, json);
    return 0;
}

}  // namespace tessera
