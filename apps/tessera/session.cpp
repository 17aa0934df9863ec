#include <cstdio>
#include <string>

#include "commands.h"
#include "interrupt.h"
#include "report_text.h"

namespace tessera {

Session::Session(const CommonOptions& options)
    : progress(!options.quiet), prints_(!options.quiet && options.jsonPath != "-") {
    execution.threads = options.threads;
    execution.cancel = &interruptFlag();
    execution.progress = &progress;
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
