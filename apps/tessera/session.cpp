#include <cstdio>

#include "commands.h"
#include "interrupt.h"

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
    std::fputs(text.c_str(), stdout);
    std::fflush(stdout);
}

}  // namespace tessera
