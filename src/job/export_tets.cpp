#include "job/export_tets.h"

#include <fmt/format.h>

#include "base/timer.h"
#include "files/atomic_file.h"
#include "job/output_paths.h"
#include "job/repair_report.h"
#include "job/report_text.h"
#include "mesh_files/write_tets.h"

namespace tessera {

TetsResult exportTets(const TetsRequest& request, Job& job) {
    checkOutputPaths({request.input}, {{"--output", request.output}, {"--json", job.reportPath}});
    chooseFormat(request.output, {}, {"vtu"});
    checkWritable(request.output);
    job.execution.declare(
        {{Stage::reading, 1}, {Stage::repairing, request.repair ? 1.0 : 0.0}, {Stage::writing, 1}});
    Timer timer;
    TetsResult result{importMesh(request.input, {{}, request.timeStep}, request.repair, job), {}};
    const TetMesh& mesh = result.mesh.mesh;
    result.times.readMs = timer.restart();
    job.execution.throwIfCancelled();
    job.execution.report(Stage::writing, 0, 1);
    writeTets(mesh, request.output, job.execution);
    result.times.writeMs = timer.elapsedMs();
    job.say(importText(request.input, result.mesh.statistics, result.mesh.boundsWorld));
    tellRepair(request.input, result.mesh, job);
    job.say(fmt::format("{}: {} tetrahedra\n", request.output, formatCount(mesh.elementCount())));
    return result;
}

Json tetsJson(const TetsRequest& request, const TetsResult& result) {
    const TetMesh& mesh = result.mesh.mesh;
    Json json = documentHead("tets");
    json["input"] = request.input;
    json["output"] = request.output;
    json["stages"] = stagesJson(result.times);
    json["mesh"] = meshJson(result.mesh.statistics, result.mesh.boundsWorld, summarizeFields(mesh));
    addRepair(json, result.mesh);
    return json;
}

}  // namespace tessera
