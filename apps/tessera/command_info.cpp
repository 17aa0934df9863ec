#include <fmt/format.h>

#include <bit>
#include <filesystem>

#include "base/timer.h"
#include "commands.h"
#include "gl_report.h"
#include "import_mesh.h"
#include "output_paths.h"
#include "report_text.h"
#include "series_steps.h"
#include "tessera/error.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_read.h"

namespace tessera {

namespace {

Json documentHead(const std::vector<std::string>& inputs) {
    return {{"schema", 1},
            {"program", "tessera"},
            {"version", TESSERA_VERSION},
            {"command", "info"},
            {"input", inputs.empty()       ? Json()
                      : inputs.size() == 1 ? Json(inputs[0])
                                           : Json(inputs)}};
}

bool isVdb(const std::string& path) {
    return std::filesystem::path(path).extension() == ".vdb";
}

Json gridsJson(const VdbFile& file) {
    Json grids = Json::array();
    for (std::size_t g = 0; g < file.gridNames.size(); ++g)
        grids.push_back({{"name", file.gridNames[g]},
                         {"active_voxels", g < file.gridVoxels.size() ? file.gridVoxels[g] : 0}});
    return grids;
}

std::int64_t extendedPoints(const BrickStore& store) {
    std::int64_t count = 0;
    for (const auto& [key, tile] : store.extension())
        for (const std::uint64_t word : tile.coverage) count += std::popcount(word);
    return count;
}

/// Bricks of each level and the voxels in them, or a flat grid and what it was made of.
std::string voxelsText(const VdbFile& file) {
    const std::int64_t extended = extendedPoints(file.store);
    if (!file.bricks) {
        std::string text = levelsText(summarizeLevels(file.tree, file.store));
        if (extended > 0) text += fmt::format("  {} voxels outside the mesh\n", formatCount(extended));
        return text;
    }
    std::string text =
        fmt::format("  one grid of spacing {:.9g}: {} voxels in the mesh, {} outside\n",
                    file.tree.spacingWorld(), formatCount(file.store.coveredPoints()), formatCount(extended));
    const char* separator = "  from bricks ";
    for (const LevelSummary& level : summarizeLevels(*file.bricks, {})) {
        text +=
            fmt::format("{}of spacing {:.6g}: {}", separator, level.spacingWorld, formatCount(level.bricks));
        separator = ", ";
    }
    return file.bricks->leafCount() > 0 ? text + "\n" : text;
}

/// Prints what the file holds, and gives the same as a document when one is wanted.
Json showVdb(const InfoArguments& arguments, Session& session) {
    const std::string& path = arguments.paths[0];
    refuseReaderBounds(arguments.common.reader, path + " is no mesh");
    const VdbFile file = readVdb(path);
    std::vector<std::vector<std::string>> rows{{"grid", "active voxels"}};
    for (std::size_t g = 0; g < file.gridNames.size(); ++g)
        rows.push_back(
            {file.gridNames[g], g < file.gridVoxels.size() ? formatCount(file.gridVoxels[g]) : ""});
    const Vec3d& origin = file.tree.originWorld();
    std::string text = fmt::format(
        "{}: OpenVDB file by Tessera {}, layout {}\n  from {}, algorithm {}, criterion {}\n"
        "  lattice origin ({:.9g}, {:.9g}, {:.9g}), finest spacing {:.9g}, bricks of {}^3 cells, {:.9g} file "
        "units per world unit\n",
        path, file.version, file.layout == VdbLayout::flat ? "flat" : "levels", file.sourceFile,
        file.algorithm, file.criterion, origin.x, origin.y, origin.z, file.tree.spacingWorld(),
        file.tree.brickCells(), file.unitScale);
    if (!file.target.empty()) text += fmt::format("  sampled on {}\n", file.target);
    if (!file.sampleFormat.empty()) text += fmt::format("  sampled in format {}\n", file.sampleFormat);
    if (!file.repair.empty()) text += fmt::format("  from a mesh that was repaired: {}\n", file.repair);
    if (file.time) text += fmt::format("  time {}\n", *file.time);
    if (file.voxelShift != 0)
        text +=
            fmt::format("  the grids are shifted by {:.9g} of a voxel along x, y and z\n", file.voxelShift);
    if (file.boundsWorld) {
        const Box3d& b = *file.boundsWorld;
        text += fmt::format("  bounds ({:.9g}, {:.9g}, {:.9g}) to ({:.9g}, {:.9g}, {:.9g})\n", b.min.x,
                            b.min.y, b.min.z, b.max.x, b.max.y, b.max.z);
    }
    text += formatTable(rows) + voxelsText(file) + errorText(file.report);
    if (file.samplesReport)
        text += "  the samples before they became the file's voxels:\n" + errorText(*file.samplesReport);
    session.print(text);
    if (arguments.common.jsonPath.empty()) return {};
    Json json = documentHead(arguments.paths);
    json["source"] = file.sourceFile;
    if (file.time) json["time"] = *file.time;
    json["algorithm"] = file.algorithm;
    if (!file.target.empty()) json["target"] = file.target;
    if (!file.sampleFormat.empty()) json["sample_format"] = file.sampleFormat;
    if (!file.repair.empty()) json["repair"] = Json::parse(encodeRepair(decodeRepair(file.repair)));
    json["criterion"] = file.criterion;
    json["layout"] = file.layout == VdbLayout::flat ? "flat" : "levels";
    json["unit_scale"] = file.unitScale;
    if (file.voxelShift != 0) json["voxel_shift"] = file.voxelShift;
    if (const auto& b = file.boundsWorld)
        json["bounds"] = {{b->min.x, b->min.y, b->min.z}, {b->max.x, b->max.y, b->max.z}};
    json["grids"] = gridsJson(file);
    if (file.bricks) {
        json.update(levelsJson(*file.bricks, summarizeLevels(*file.bricks, {})));
        json["voxels"] = {{"total", file.store.coveredPoints() + extendedPoints(file.store)},
                          {"covered_total", file.store.coveredPoints()}};
        json["grid"] = {{"level", file.flatLevel}, {"spacing", file.tree.spacingWorld()}};
    } else {
        json.update(levelsJson(file.tree, summarizeLevels(file.tree, file.store)));
    }
    json["extended_voxels"] = extendedPoints(file.store);
    json["coverage"] = coverageJson(file.report);
    json["error"] = errorJson(file.report);
    if (file.samplesReport) json["samples_error"] = errorJson(*file.samplesReport);
    return json;
}

Json showMesh(const InfoArguments& arguments, const std::string& path, Session& session) {
    Timer timer;
    const std::optional<RepairOptions> repair = repairOptions(arguments.repair);
    const ImportedMesh file = importMesh(path, {{}, arguments.timeStep}, repair, session);
    StageTimes times;
    times.readMs = timer.elapsedMs();
    const Box3d bounds = file.mesh.boundsWorld();
    const std::vector<FieldSummary> fields = summarizeFields(file.mesh);
    const ClassLimits limits = repair ? repair->limits : ClassLimits{};
    const ClassCounts classes =
        file.repair ? file.repair->before : countClasses(file.mesh, limits, session.execution);
    session.print(importText(path, file.statistics, bounds) + classesText(classes, limits) +
                  fieldsText(fields));
    showRepair(path, file, repair, session);
    if (arguments.common.jsonPath.empty()) return {};
    Json json = documentHead({path});
    json["stages"] = stagesJson(times);
    json["mesh"] = meshJson(file.statistics, bounds, fields);
    json["classes"] = classesJson(classes, limits);
    if (file.repair) json["repair"] = repairJson(file, repair);
    return json;
}

/// A row and a document for every step, and the ranges over all.
Json showSeries(const InfoArguments& arguments, const std::vector<SeriesStep>& steps, Session& session) {
    if (arguments.repair.repair)
        throw InputError("--repair shows one mesh: name one file, or a step of a .pvd file by --time-step");
    std::vector<std::string> files;
    for (const SeriesStep& step : steps) files.insert(files.end(), step.files.begin(), step.files.end());
    checkOutputPaths(files, {{"--json", arguments.common.jsonPath}});
    StageTimes times;
    SeriesSummary summary;
    std::vector<std::vector<std::string>> rows{{"step", "time", "cells", "elements", "nodes", "files"}};
    std::vector<std::string> notes;
    Json documents = Json::array();
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const SeriesStep& step = steps[i];
        session.progress.beginStep("step", i + 1, steps.size(), 1, double(steps.size() - 1 - i));
        Timer timer;
        const MeshFile file = session.readMesh(step.files[0], readOptions(step, {}, arguments.timeStep));
        times.readMs += timer.elapsedMs();
        summary.add(step, file.mesh);
        const ImportStatistics& s = file.statistics;
        const std::size_t others = step.files.size() - 1;
        rows.push_back({std::to_string(step.number), step.time ? fmt::format("{}", *step.time) : "-",
                        formatCount(s.cells), formatCount(s.elements), formatCount(s.nodes),
                        step.files[0] + (others > 0 ? fmt::format(" and {} more", others) : "")});
        for (const std::string& warning : s.warnings)
            notes.push_back(fmt::format("step {}: warning: {}", step.number, warning));
        Json document = stepJson(step);
        document["input"] = step.files[0];
        document["mesh"] = meshJson(s, file.mesh.boundsWorld(), summarizeFields(file.mesh));
        documents.push_back(std::move(document));
    }
    for (const std::string& note : summary.notes()) notes.push_back(note);
    std::string text =
        fmt::format("series of {} steps\n", steps.size()) + formatTable(rows) + fieldsText(summary.fields());
    for (const std::string& note : notes) text += "  " + note + "\n";
    session.print(text);
    Json json = documentHead(arguments.paths);
    json["stages"] = stagesJson(times);
    json["series"] = summary.json();
    json["steps"] = std::move(documents);
    return json;
}

Json showFiles(const InfoArguments& arguments, Session& session) {
    const std::vector<std::string>& paths = arguments.paths;
    for (const std::string& path : paths)
        if (isVdb(path) && paths.size() > 1)
            throw InputError(path + ": a .vdb file can't be shown together with other files");
    if (isVdb(paths[0])) return showVdb(arguments, session);
    // Of a .pvd file --time-step names a step.
    if (paths.size() == 1 && isCollectionName(paths[0]) && arguments.timeStep >= 0)
        return showMesh(arguments, paths[0], session);
    const std::vector<SeriesStep> steps = listSeries(paths);
    if (steps.size() > 1 || !steps[0].collection.empty()) return showSeries(arguments, steps, session);
    return showMesh(arguments, steps[0].files[0], session);
}

}  // namespace

int runInfo(const InfoArguments& arguments) {
    if (arguments.paths.empty() && !arguments.gl) throw InputError("info needs a file, or --gl");
    checkOutputPaths(arguments.paths, {{"--json", arguments.common.jsonPath}});
    Session session(arguments.common);
    session.progress.declare({{Stage::reading, 1}, {Stage::repairing, arguments.repair.repair ? 1.0 : 0.0}});
    Json json = arguments.paths.empty() ? documentHead({}) : showFiles(arguments, session);
    if (arguments.gl) {
        session.print(glText());
        json["gl"] = glJson();
    }
    if (!arguments.common.jsonPath.empty()) writeJson(arguments.common.jsonPath, json);
    return 0;
}

}  // namespace tessera
