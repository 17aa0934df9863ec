#include <fmt/format.h>
#include <sys/auxv.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include "base/timer.h"
#include "commands.h"
#include "files/atomic_file.h"
#include "interrupt.h"
#include "reader/serve_mesh_reader.h"
#include "report_text.h"
#include "series_steps.h"
#include "terminal.h"
#include "tessera/error.h"

namespace tessera {

namespace {
constexpr int kExitFellShort = 3;

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

}  // namespace

void noteStart() {
    // Without /proc it has to be the name that the program was started by, before anybody changes the folder.
    const auto* name = reinterpret_cast<const char*>(::getauxval(AT_EXECFN));
    std::error_code error;
    if (::access(program.c_str(), X_OK) != 0 && name) program = std::filesystem::absolute(name, error);
}

Session::Session(const CommonOptions& options, const std::string& output)
    : progress(!options.quiet),
      quiet_(options.quiet),
      strict_(options.strict),
      prints_(!options.quiet && options.jsonPath != kStandardOutput && output != kStandardOutput),
      isolated_(options.reader.kind == "isolated") {
    execution.threads = options.threads;
    execution.cancel = &interruptFlag();
    execution.progress = progress.sink();
    const ReaderArguments& reader = options.reader;
    checkReaderOptions(reader);
    if (!reader.maxMemory.empty()) limits_.memoryBytes = parseCount("--max-memory", reader.maxMemory, true);
    if (!reader.maxSeconds) return;
    limits_.seconds = *reader.maxSeconds;
    if (!std::isfinite(limits_.seconds) || limits_.seconds <= 0)
        throw InputError(fmt::format("--max-read-time: expected a number above 0, got {}", limits_.seconds));
}

MeshFile Session::readMesh(const std::string& path, const ReadOptions& options) {
    if (isCollectionName(path)) {
        const SeriesStep step = chosenStep(path, options.timeStep);
        return readMesh(step.files[0], readOptions(step, options.fields, -1));
    }
    std::error_code error;
    const auto bytes = std::filesystem::file_size(path, error);
    progress.expectReading(error ? 0 : double(bytes));
    execution.report(Stage::reading, 0, 1);
    if (!isolated_) return tessera::readMesh(path, options, execution);
    static const std::string quick = quickReaderBeside(program);
    MeshFile file = readMeshIsolated({program, {kReadMeshCommand}, quick}, path, options, limits_, execution);
    readPeakBytes_ = std::max(readPeakBytes_, file.readPeakBytes);
    return file;
}

int runReadMesh(const std::vector<std::string>& words) {
    return serveMeshReader(words);
}

void Session::print(const std::string& text) {
    if (!prints_) return;
    std::string shown = withoutControls(text);
    if (::isatty(STDOUT_FILENO) == 1) shown = wrapLines(shown, std::size_t(outputWidth()));
    printOut(shown);
}

void printOut(const std::string& text) {
    const auto pause = pauseProgress();
    errno = 0;
    const bool done = std::fputs(text.c_str(), stdout) >= 0 && std::fflush(stdout) == 0;
    if (!done && firstOutputError == 0) firstOutputError = errno != 0 ? errno : EIO;
}

int outputError() {
    return firstOutputError;
}

namespace {
void printWarning(const std::string& text) {
    std::string line = fmt::format("tessera: warning: {}\n", singleLine(text));
    if (::isatty(STDERR_FILENO) == 1) line = wrapLines(line, std::size_t(terminalWidth(STDERR_FILENO)));
    const auto pause = pauseProgress();
    std::fputs(line.c_str(), stderr);
}
}  // namespace

void Session::warn(const std::string& text) {
    if (!quiet_) printWarning(text);
}

void Session::warnFellShort(const std::string& text) {
    fellShort_ = true;
    printWarning(text);
}

std::vector<std::string> Session::unsaid(const std::vector<std::string>& warnings) {
    std::vector<std::string> fresh;
    for (const std::string& warning : warnings)
        if (said_.insert(warning).second) fresh.push_back(warning);
    return fresh;
}

std::int64_t Session::peakMemoryBytes() const {
    return std::max<std::int64_t>(tessera::peakMemoryBytes(), readPeakBytes_);
}

int Session::exitCode() const {
    return strict_ && fellShort_ ? kExitFellShort : 0;
}

}  // namespace tessera
