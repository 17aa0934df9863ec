#include <fmt/format.h>
#include <sys/auxv.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include "base/error.h"
#include "commands.h"
#include "interrupt.h"
#include "io/atomic_file.h"
#include "report_text.h"
#include "series_steps.h"

namespace tessera {

namespace {
int firstOutputError = 0;
std::string program = "/proc/self/exe";

/// Options that would be without effect are refused.
void checkReaderOptions(const ReaderArguments& reader) {
    if (reader.kind == "isolated") return;
    if (reader.maxSeconds)
        throw InputError("--max-read-time bounds a process of its own: --reader in-process has none");
    if (!reader.maxMemory.empty() && !reader.memoryBoundsRun)
        throw InputError("--max-memory bounds a process of its own here: --reader in-process has none");
}

/// @param number -1: the last.
SeriesStep chosenStep(const std::string& collection, int number) {
    const std::vector<SeriesStep> steps = listSeries(std::span(&collection, 1));
    if (number >= int(steps.size()))
        throw InputError(fmt::format("{}: there is no time step {}; it has {}, counted from 0", collection,
                                     number, steps.size()));
    return number < 0 ? steps.back() : steps[std::size_t(number)];
}

}  // namespace

void noteStart() {
    // Without /proc it has to be the name that the program was started by, before anybody changes the folder.
    const auto* name = reinterpret_cast<const char*>(::getauxval(AT_EXECFN));
    std::error_code error;
    if (::access(program.c_str(), X_OK) != 0 && name) program = std::filesystem::absolute(name, error);
}

Session::Session(const CommonOptions& options, const std::string& output)
    : progress(!options.quiet),
      prints_(!options.quiet && options.jsonPath != kStandardOutput && output != kStandardOutput),
      isolated_(options.reader.kind == "isolated") {
    execution.threads = options.threads;
    execution.cancel = &interruptFlag();
    execution.progress = &progress;
    const ReaderArguments& reader = options.reader;
    checkReaderOptions(reader);
    if (!reader.maxMemory.empty()) limits_.memoryBytes = parseCount("--max-memory", reader.maxMemory, true);
    if (!reader.maxSeconds) return;
    limits_.seconds = *reader.maxSeconds;
    if (!std::isfinite(limits_.seconds) || limits_.seconds <= 0)
        throw InputError(fmt::format("--max-read-time: expected a number above 0, got {}", limits_.seconds));
}

MeshFile Session::readMesh(const std::string& path, const ReadOptions& options) const {
    if (isCollectionName(path)) {
        const SeriesStep step = chosenStep(path, options.timeStep);
        return readMesh(step.files[0], readOptions(step, options.fields, -1));
    }
    if (!isolated_) return tessera::readMesh(path, options, execution);
    static const std::string quick = quickReaderBeside(program);
    return readMeshIsolated({program, {kReadMeshCommand}, quick}, path, options, limits_, execution);
}

int runReadMesh(const std::vector<std::string>& words) {
    return serveMeshReader(words);
}

void Session::print(const std::string& text) {
    progress.clear();
    if (!prints_) return;
    printOut(withoutControls(text));
}

void printOut(const std::string& text) {
    errno = 0;
    const bool done = std::fputs(text.c_str(), stdout) >= 0 && std::fflush(stdout) == 0;
    if (!done && firstOutputError == 0) firstOutputError = errno != 0 ? errno : EIO;
}

int outputError() {
    return firstOutputError;
}

void Session::warn(const std::string& text) {
    progress.clear();
    const std::string line = "tessera: warning: " + singleLine(text) + "\n";
    std::fputs(line.c_str(), stderr);
}

}  // namespace tessera
