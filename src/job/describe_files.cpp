#include "job/describe_files.h"

#include <fmt/format.h>

#include <bit>
#include <filesystem>

#include "base/timer.h"
#include "job/gl_report.h"
#include "job/import_mesh.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/report_text.h"
#include "job/series_steps.h"
#include "job/vdb_contents.h"
#include "reader/confine.h"
#include "tessera/error.h"

namespace tessera {

namespace {

Json head(const std::vector<std::string>& inputs) {
    Json json = documentHead("info");
    json["input"] = inputs.empty() ? Json() : inputs.size() == 1 ? Json(inputs[0]) : Json(inputs);
    return json;
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
std::string voxelsText(const VdbFile& file, std::size_t width) {
    const std::int64_t extended = extendedPoints(file.store);
    if (!file.bricks) {
        std::string text = levelsText(summarizeLevels(file.tree, file.store), width);
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

std::string vdbText(const std::string& path, const VdbFile& file, std::size_t width) {
    TableRows rows{{"grid", "active voxels"}};
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
    text += formatTable(rows, width) + voxelsText(file, width) + errorText(file.report, width);
    if (file.samplesReport)
        text +=
            "  the samples before they became the file's voxels:\n" + errorText(*file.samplesReport, width);
    if (file.statistics) text += "  range, histogram and error of each brick are stored\n";
    return text;
}

void addVdb(Json& json, const VdbFile& file) {
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
    if (const auto& b = file.boundsWorld) json["bounds"] = {vectorJson(b->min), vectorJson(b->max)};
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
    if (file.statistics) json["brick_statistics"] = true;
}

Json showVdb(const std::string& path, Job& job) {
    const VdbFile file = openVdb(path, VdbContents::withoutValues, job);
    job.say(vdbText(path, file, job.textWidth));
    if (job.reportPath.empty()) return {};
    Json json = head({path});
    addVdb(json, file);
    return json;
}

Json showMesh(const DescribeRequest& request, const std::string& path, Job& job) {
    Timer timer;
    const ImportedMesh file = importMesh(path, {{}, request.timeStep}, request.repair, job);
    StageTimes times;
    times.readMs = timer.elapsedMs();
    const Box3d& bounds = file.boundsWorld;
    const std::vector<FieldSummary> fields = summarizeFields(file.mesh);
    const ClassLimits limits = request.repair ? request.repair->limits : ClassLimits{};
    const ClassCounts classes =
        request.repair ? file.repair.before : countClasses(file.mesh, limits, job.execution);
    job.say(importText(path, file.statistics, bounds) + classesText(classes, limits) +
            fieldsText(fields, job.textWidth));
    tellRepair(path, file, job);
    if (job.reportPath.empty()) return {};
    Json json = head({path});
    json["stages"] = stagesJson(times);
    json["mesh"] = meshJson(file.statistics, bounds, fields);
    json["classes"] = classesJson(classes, limits);
    addRepair(json, file);
    return json;
}

/// A row and a document for every step, and the ranges over all.
Json showSeries(const DescribeRequest& request, const std::vector<SeriesStep>& steps, Job& job) {
    if (request.repair)
        throw InputError("--repair shows one mesh: name one file, or a step of a .pvd file by --time-step");
    std::vector<std::string> files;
    for (const SeriesStep& step : steps) files.insert(files.end(), step.files.begin(), step.files.end());
    checkOutputPaths(files, {{"--json", job.reportPath}});
    StageTimes times;
    SeriesSummary summary;
    TableRows rows{{"step", "time", "cells", "elements", "nodes", "files"}};
    std::vector<std::string> notes;
    Json documents = Json::array();
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const SeriesStep& step = steps[i];
        job.execution.beginStep(fmt::format("step {} of {}", i + 1, steps.size()), 1,
                                double(steps.size() - 1 - i));
        Timer timer;
        const MeshFile file = openMesh(step.files[0], readOptions(step, {}, request.timeStep), job);
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
    std::string text = fmt::format("series of {} steps\n", steps.size()) + formatTable(rows, job.textWidth) +
                       fieldsText(summary.fields(), job.textWidth);
    for (const std::string& note : notes) text += "  " + note + "\n";
    job.say(text);
    Json json = head(request.paths);
    json["stages"] = stagesJson(times);
    json["series"] = summary.json();
    json["steps"] = std::move(documents);
    return json;
}

Json showFiles(const DescribeRequest& request, Job& job) {
    const std::vector<std::string>& paths = request.paths;
    for (const std::string& path : paths)
        if (isVdbName(path) && paths.size() > 1)
            throw InputError(path + ": a .vdb file can't be shown together with other files");
    if (isVdbName(paths[0])) return showVdb(paths[0], job);
    // Of a .pvd file --time-step names a step.
    if (paths.size() == 1 && isCollectionName(paths[0]) && request.timeStep >= 0)
        return showMesh(request, paths[0], job);
    const std::vector<SeriesStep> steps = listSeries(paths);
    if (steps.size() > 1 || !steps[0].collection.empty()) return showSeries(request, steps, job);
    return showMesh(request, steps[0].files[0], job);
}

/// What a process that reads files is kept from on this system.
std::string limitsText(const Confinement& kept) {
    return std::string("files are read in a separate process with limits on memory and time\n") +
           (kept.files ? "  Landlock: it writes nothing, and reads only the folder of the file and below\n"
                       : "  no Landlock on this system: it could write, and read any file\n") +
           (kept.calls ? "  seccomp: it has no network and starts no program\n"
                       : "  no seccomp on this system: it could use the network and start programs\n");
}

}  // namespace

bool isVdbName(const std::string& path) {
    return std::filesystem::path(path).extension() == ".vdb";
}

Json describeFiles(const DescribeRequest& request, Job& job) {
    if (request.paths.empty() && !request.gl && !request.limits)
        throw InputError("info needs a file, --gl or --limits");
    checkOutputPaths(request.paths, {{"--json", job.reportPath}});
    job.execution.declare({{Stage::reading, 1}, {Stage::repairing, request.repair ? 1.0 : 0.0}});
    Json json = request.paths.empty() ? head({}) : showFiles(request, job);
    if (request.gl) {
        job.say(glText(job.textWidth));
        json["gl"] = glJson();
    }
    if (request.limits) {
        const Confinement kept = availableConfinement();
        job.say(limitsText(kept));
        json["limits"] = {{"landlock", kept.files}, {"seccomp", kept.calls}};
    }
    return json;
}

}  // namespace tessera
