#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <string>

#include "base/error.h"
#include "commands.h"
#include "interrupt.h"
#include "report_text.h"

namespace tessera {

namespace {
int threadsAtStart = 0;
}

void noteStart() {
    threadsAtStart = threadCount();
}

Session::Session(const CommonOptions& options)
    : progress(!options.quiet),
      prints_(!options.quiet && options.jsonPath != "-"),
      isolated_(options.reader.kind == "isolated") {
    execution.threads = options.threads;
    execution.cancel = &interruptFlag();
    execution.progress = &progress;
    const ReaderArguments& reader = options.reader;
    if (!reader.maxMemory.empty()) limits_.memoryBytes = parseCount("--max-memory", reader.maxMemory, true);
    if (!reader.maxSeconds) return;
    limits_.seconds = *reader.maxSeconds;
    if (!std::isfinite(limits_.seconds) || limits_.seconds <= 0)
        throw InputError(fmt::format("--max-read-time: expected a number above 0, got {}", limits_.seconds));
}

MeshFile Session::readMesh(const std::string& path, const ReadOptions& options) const {
    if (!isolated_) return tessera::readMesh(path, options, execution);
    static const std::string self = "/proc/self/exe";
    static const std::string quick = quickReaderBeside(self);
    return readMeshIsolated({self, {kReadMeshCommand}, threadsAtStart, quick}, path, options, limits_,
                            execution);
}

int runReadMesh(const std::vector<std::string>& words) {
    return serveMeshReader(words);
}

void Session::print(const std::string& text) {
    progress.clear();
    if (!prints_) return;
    std::fputs(withoutControls(text).c_str(), stdout);
    std::fflush(stdout);
}

void Session::warn(const std::string& text) {
    progress.clear();
    const std::string line = "tessera: warning: " + singleLine(text) + "\n";
    std::fputs(line.c_str(), stderr);
}

}  // namespace tessera
