#include "session.h"

#include <fmt/format.h>
#include <sys/auxv.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>

#include "files/atomic_file.h"
#include "gl/gl_platform.h"
#include "interrupt.h"
#include "job/wrap_text.h"
#include "reader/isolated_tetrahedra.h"
#include "run_program.h"
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

void printWarning(const std::string& text) {
    std::string line = fmt::format("{}: warning: {}\n", programName(), singleLine(text));
    if (::isatty(STDERR_FILENO) == 1) line = wrapLines(line, std::size_t(terminalWidth(STDERR_FILENO)));
    const auto pause = pauseProgress();
    std::fputs(line.c_str(), stderr);
}

}  // namespace

void noteStart() {
    // Without /proc it has to be the name that the program was started by, before anybody changes the folder.
    const auto* name = reinterpret_cast<const char*>(::getauxval(AT_EXECFN));
    std::error_code error;
    if (::access(program.c_str(), X_OK) != 0 && name) program = std::filesystem::absolute(name, error);
}

const std::string& programPath() {
    return program;
}

Session::Session(const CommonOptions& options, const std::string& output)
    : progress_(!options.quiet),
      strict_(options.strict),
      prints_(!options.quiet && options.jsonPath != kStandardOutput && output != kStandardOutput) {
    job.execution = {options.threads, &interruptFlag(), progress_.sink()};
    job.reportPath = options.jsonPath;
    job.textWidth = std::size_t(outputWidth());
    job.say = [this](const std::string& text) { print(text); };
    // Of a result that isn't what was asked for --quiet tells too.
    if (!options.quiet) job.warn = printWarning;
    job.fellShort = [this](const std::string& text) {
        fellShort_ = true;
        printWarning(text);
    };
    const std::string quick = quickReaderBeside(program);
    const ReaderArguments& reader = options.reader;
    checkReaderOptions(reader);
    job.followsLinks = reader.followsLinks;
    if (reader.kind == "isolated") job.reader = {program, {kReadMeshCommand}, quick};
    job.tetrahedralizer = tetrahedralizerBeside(program);
    if (!reader.maxMemory.empty())
        job.readerLimits.memoryBytes = parseCount("--max-memory", reader.maxMemory, true);
    tryGlFirst({quick.empty() ? program : quick,
                {kTryGlCommand},
                options.maxDriverSeconds,
                &interruptFlag(),
                job.readerLimits.memoryBytes});
    if (!reader.maxSeconds) return;
    job.readerLimits.seconds = *reader.maxSeconds;
    if (!std::isfinite(*reader.maxSeconds) || *reader.maxSeconds <= 0)
        throw InputError(
            fmt::format("--max-read-time: expected a number above 0, got {}", *reader.maxSeconds));
}

void Session::print(const std::string& text) const {
    if (!prints_) return;
    std::string shown = withoutControls(text);
    if (::isatty(STDOUT_FILENO) == 1) shown = wrapLines(shown, std::size_t(outputWidth()));
    printOut(shown);
}

void Session::writeReport(const Json& document) const {
    if (job.reportPath.empty()) return;
    const std::string text = documentText(document);
    job.reportPath == kStandardOutput ? printOut(text) : writeFileAtomically(job.reportPath, text);
}

int Session::exitCode() const {
    return strict_ && fellShort_ ? kExitFellShort : 0;
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

}  // namespace tessera
