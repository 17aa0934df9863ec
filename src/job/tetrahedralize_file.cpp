#include "job/tetrahedralize_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/timer.h"
#include "files/atomic_file.h"
#include "job/output_paths.h"
#include "job/report_text.h"
#include "mesh/precise_volume.h"
#include "mesh_files/write_tets.h"
#include "reader/isolated_tetrahedra.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// "1 to 1.5: 12 %".
std::string shareText(std::int64_t count, std::int64_t all) {
    return fmt::format("{:.3g} %", 100.0 * double(count) / double(std::max<std::int64_t>(all, 1)));
}

std::string shapesText(const ShapeStatistics& shapes, std::size_t width) {
    TableRows aspects{{"aspect ratio", "elements", "share"}};
    for (std::size_t b = 0; b < shapes.aspects.size(); ++b) {
        const double from = kAspectBins[b];
        const std::string range = b + 1 < shapes.aspects.size()
                                      ? fmt::format("{:g} to {:g}", from, kAspectBins[b + 1])
                                      : fmt::format("above {:g}", from);
        aspects.push_back(
            {range, formatCount(shapes.aspects[b]), shareText(shapes.aspects[b], shapes.elements)});
    }
    TableRows angles{{"dihedral angle", "angles", "share"}};
    for (std::size_t b = 0; b < shapes.dihedrals.size(); ++b)
        angles.push_back({fmt::format("{} to {} degrees", 10 * b, 10 * b + 10),
                          formatCount(shapes.dihedrals[b]),
                          shareText(shapes.dihedrals[b], 6 * shapes.elements)});
    return formatTable(aspects, width) + formatTable(angles, width) +
           fmt::format("largest aspect ratio {:.4g}, dihedral angles {:.3g} to {:.4g} degrees\n",
                       shapes.largestAspect, shapes.smallestDihedral, shapes.largestDihedral);
}

Json shapesJson(const ShapeStatistics& shapes) {
    return {{"aspect_bins", kAspectBins},
            {"aspect_counts", shapes.aspects},
            {"largest_aspect", shapes.largestAspect},
            {"dihedral_counts", shapes.dihedrals},
            {"smallest_dihedral", shapes.smallestDihedral},
            {"largest_dihedral", shapes.largestDihedral}};
}

}  // namespace

MeshFile makeTetrahedra(const std::string& path, const ReadOptions& read,
                        const TetrahedralizeOptions& options, Job& job) {
    job.execution.report(Stage::reading, 0, 1);
    MeshFile file = tetrahedralizeIsolated(requireTetrahedralizer(job.tetrahedralizer, path), path, read,
                                           options, job.readerLimits, job.execution);
    job.readPeakBytes = std::max(job.readPeakBytes, file.readPeakBytes);
    return file;
}

TetrahedralizeResult tetrahedralizeFile(const TetrahedralizeRequest& request, Job& job) {
    checkOutputPaths({request.input}, {{"--output", request.output}, {"--json", job.reportPath}});
    chooseFormat(request.output, {}, {"vtu"});
    checkWritable(request.output);
    checkReportPath(job);
    job.execution.declare({{Stage::reading, 1}, {Stage::tetrahedralizing, 6}, {Stage::writing, 2}});
    Timer timer;
    TetrahedralizeResult result;
    ReadOptions read;
    read.fields = sourceNames(request.fields, {});
    result.mesh = makeTetrahedra(request.input, read, request.options, job);
    result.makeMs = timer.restart();
    TetMesh& mesh = result.mesh.mesh;
    if (!request.fields.empty()) {
        const FieldSelection chosen = selectFields(mesh, request.fields);
        for (std::size_t i = 0; i < chosen.fields.size(); ++i)
            mesh.fields[std::size_t(chosen.fields[i])].name = chosen.outputs[i].name;
    }
    result.shapes = measureShapes(mesh, job.execution.withoutProgress());
    result.volumeWorld = totalVolume(mesh, job.execution.withoutProgress());
    timer.restart();
    job.execution.report(Stage::writing, 0, 1);
    writeTets(mesh, request.output, job.execution);
    result.writeMs = timer.elapsedMs();
    job.say(importText(request.input, result.mesh.statistics, mesh.boundsWorld()));
    job.say(fmt::format("  volume {:.10g}\n", result.volumeWorld));
    if (!mesh.fields.empty()) job.say(fieldsText(summarizeFields(mesh), job.textWidth));
    job.say(shapesText(result.shapes, job.textWidth));
    job.say(fmt::format("{}: {} tetrahedra; made in {:.2f} s, written in {:.2f} s, peak memory {}\n",
                        request.output, formatCount(mesh.elementCount()), result.makeMs / 1e3,
                        result.writeMs / 1e3, formatBytes(peakMemoryBytes(job))));
    return result;
}

Json tetrahedralizeJson(const TetrahedralizeRequest& request, const TetrahedralizeResult& result,
                        const Job& job) {
    const TetMesh& mesh = result.mesh.mesh;
    Json json = documentHead("tetrahedralize");
    json["input"] = request.input;
    json["output"] = request.output;
    json["make_ms"] = result.makeMs;
    json["write_ms"] = result.writeMs;
    json["peak_memory_bytes"] = peakMemoryBytes(job);
    json["mesh"] = meshJson(result.mesh.statistics, mesh.boundsWorld(), summarizeFields(mesh));
    json["volume"] = result.volumeWorld;
    json["quality"] = shapesJson(result.shapes);
    return json;
}

}  // namespace tessera
