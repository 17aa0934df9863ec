#include "benchmark/program_memory.h"

#include <fmt/format.h>

#include <chrono>
#include <thread>

#include "base/child_process.h"
#include "files/input_file.h"
#include "files/json_parse.h"
#include "files/temporary_folder.h"
#include "tessera/error.h"

namespace tessera {

std::optional<std::int64_t> peakMemoryOfProgram(const std::string& program, const std::string& meshPath,
                                                const Field& field, const BrickCase& bricks,
                                                const Execution& execution) {
    const TemporaryFolder folder("tessera-bench");
    const BenchmarkVariant& variant = *bricks.variant;
    const std::string where = field.location == FieldLocation::cell ? "cell:" : "point:";
    ChildStart start;
    start.task = "that samples";
    start.executable = program;
    start.arguments = {"resample",     meshPath,
                       "-o",           folder.pathOf("bricks.vdb"),
                       "--refine",     "uniform",
                       "--resolution", fmt::format("{}", bricks.refine.resolution),
                       "--field",      where + field.name,
                       "--algorithm",  variant.resampler->name(),
                       "--threads",    fmt::format("{}", variant.threads),
                       "--json",       folder.pathOf("report.json"),
                       "--quiet"};
    if (variant.resampler->info().isOnDevice) {
        if (!variant.bind.target.empty())
            start.arguments.insert(start.arguments.end(), {"--gl", variant.bind.target});
        start.arguments.insert(start.arguments.end(),
                               {"--sample-format", std::string(nameOf(variant.bind.format)), "--primitives",
                                std::string(nameOf(variant.bind.primitives))});
    }
    try {
        ChildProcess child(start);
        while (!child.reap()) {
            execution.throwIfCancelled();
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        const Json report = parseJson<Json>(readWholeFile(folder.pathOf("report.json")));
        return report.at("peak_memory_bytes").get<std::int64_t>();
    } catch (const IoError&) {
    } catch (const InputError&) {
    } catch (const Json::exception&) {
    }
    return std::nullopt;
}

}  // namespace tessera
