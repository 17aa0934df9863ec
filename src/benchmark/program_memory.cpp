#include "benchmark/program_memory.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "base/child_process.h"
#include "files/input_file.h"
#include "files/json_parse.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// A new folder that is gone when this ends.
class TemporaryFolder {
  public:
    TemporaryFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "tessera_bench_XXXXXX").string();
        if (!::mkdtemp(name.data())) throw IoError(name + ": the folder can't be made");
        path_ = name;
    }
    ~TemporaryFolder() {
        std::error_code error;
        std::filesystem::remove_all(path_, error);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    std::string file(const char* name) const { return (path_ / name).string(); }

  private:
    std::filesystem::path path_;
};

}  // namespace

std::optional<std::int64_t> peakMemoryOfProgram(const std::string& program, const std::string& meshPath,
                                                const Field& field, const BrickCase& bricks,
                                                const Execution& execution) {
    const TemporaryFolder folder;
    const BenchmarkVariant& variant = *bricks.variant;
    const std::string where = field.location == FieldLocation::cell ? "cell:" : "point:";
    ChildStart start;
    start.task = "that samples";
    start.executable = program;
    start.arguments = {"resample",     meshPath,
                       "-o",           folder.file("bricks.vdb"),
                       "--refine",     "uniform",
                       "--resolution", fmt::format("{}", bricks.refine.resolution),
                       "--field",      where + field.name,
                       "--algorithm",  variant.resampler->name(),
                       "--threads",    fmt::format("{}", variant.threads),
                       "--json",       folder.file("report.json"),
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
        const Json report = parseJson<Json>(readWholeFile(folder.file("report.json")));
        return report.at("peak_memory_bytes").get<std::int64_t>();
    } catch (const IoError&) {
    } catch (const InputError&) {
    } catch (const Json::exception&) {
    }
    return std::nullopt;
}

}  // namespace tessera
