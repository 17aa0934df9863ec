#include <fmt/format.h>

#include "base/timer.h"
#include "commands.h"
#include "io/atomic_file.h"
#include "io/read_mesh.h"
#include "output_paths.h"
#include "report_text.h"

namespace tessera {

void addTetsOptions(CLI::App& command, TetsArguments& arguments) {
    command.add_option("mesh", arguments.input, "mesh file")->required();
    command.add_option("-o,--output", arguments.output, "the .vtu file of tetrahedra")->required();
    command.add_option("--time-step", arguments.timeStep,
                       "files with several steps: which one, counted from 0 (default: the last)");
    addCommonOptions(command, arguments.common);
    command.footer("Example:\n  tessera tets mesh.vtu -o tets.vtu");
}

int runTets(const TetsArguments& arguments) {
    checkOutputPaths({arguments.input},
                     {{"--output", arguments.output}, {"--json", arguments.common.jsonPath}});
    Session session(arguments.common);
    checkWritable(arguments.output);
    Timer timer;
    const MeshFile file = session.readMesh(arguments.input, {{}, arguments.timeStep});
    StageTimes times;
    times.readMs = timer.restart();
    session.execution.throwIfCancelled();
    writeTets(file.mesh, arguments.output);
    times.writeMs = timer.elapsedMs();
    session.print(
        importText(arguments.input, file.statistics, file.mesh.boundsWorld()) +
        fmt::format("{}: {} tetrahedra\n", arguments.output, formatCount(file.mesh.elementCount())));
    if (arguments.common.jsonPath.empty()) return 0;
    writeJson(arguments.common.jsonPath,
              Json{{"schema", 1},
                   {"program", "tessera"},
                   {"version", TESSERA_VERSION},
                   {"command", "tets"},
                   {"input", arguments.input},
                   {"output", arguments.output},
                   {"stages", stagesJson(times)},
                   {"mesh", meshJson(file.statistics, file.mesh.boundsWorld(), summarizeFields(file.mesh))}});
    return 0;
}

}  // namespace tessera
