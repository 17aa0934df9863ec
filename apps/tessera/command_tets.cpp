#include <fmt/format.h>

#include "base/timer.h"
#include "commands.h"
#include "files/atomic_file.h"
#include "import_mesh.h"
#include "mesh_files/write_tets.h"
#include "output_paths.h"
#include "report_text.h"

namespace tessera {

int runTets(const TetsArguments& arguments) {
    checkOutputPaths({arguments.input},
                     {{"--output", arguments.output}, {"--json", arguments.common.jsonPath}});
    chooseFormat(arguments.output, {}, {"vtu"});
    Session session(arguments.common, arguments.output);
    checkWritable(arguments.output);
    session.progress.declare(
        {{Stage::reading, 1}, {Stage::repairing, arguments.repair.repair ? 1.0 : 0.0}, {Stage::writing, 1}});
    Timer timer;
    const std::optional<RepairOptions> repair = repairOptions(arguments.repair);
    const ImportedMesh file = importMesh(arguments.input, {{}, arguments.timeStep}, repair, session);
    StageTimes times;
    times.readMs = timer.restart();
    session.execution.throwIfCancelled();
    session.execution.report(Stage::writing, 0, 1);
    writeTets(file.mesh, arguments.output);
    times.writeMs = timer.elapsedMs();
    session.print(importText(arguments.input, file.statistics, file.mesh.boundsWorld()));
    showRepair(arguments.input, file, repair, session);
    session.print(
        fmt::format("{}: {} tetrahedra\n", arguments.output, formatCount(file.mesh.elementCount())));
    if (arguments.common.jsonPath.empty()) return 0;
    Json json{{"schema", 1},
              {"program", "tessera"},
              {"version", TESSERA_VERSION},
              {"command", "tets"},
              {"input", arguments.input},
              {"output", arguments.output},
              {"stages", stagesJson(times)},
              {"mesh", meshJson(file.statistics, file.mesh.boundsWorld(), summarizeFields(file.mesh))}};
    if (file.repair) json["repair"] = repairJson(file, repair);
    writeJson(arguments.common.jsonPath, json);
    return 0;
}

}  // namespace tessera
