#include "interrupt.h"

#include <signal.h>
#include <unistd.h>

#include "files/atomic_file.h"

namespace tessera {

namespace {

static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<int>::is_always_lock_free);
std::atomic<bool> raised{false};
std::atomic<int> signalNumber{0};

void handleSignal(int number) {
    if (raised.load()) {
        removeTemporaryFiles();
        _exit(128 + number);
    }
    signalNumber = number;
    raised = true;
}

}  // namespace

void installInterruptHandlers() {
    struct sigaction action {};
    action.sa_handler = handleSignal;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    // Whoever started the program with nohup wants it to outlive the terminal.
    struct sigaction before {};
    sigaction(SIGHUP, nullptr, &before);
    if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
    // A file size limit and a closed pipe are reported by write(); the default action would kill the process
    // before it cleans up.
    signal(SIGXFSZ, SIG_IGN);
    signal(SIGPIPE, SIG_IGN);
    // Where it was ignored, how the process that reads a mesh ended could not be told.
    signal(SIGCHLD, SIG_DFL);
}

const std::atomic<bool>& interruptFlag() {
    return raised;
}

int interruptSignal() {
    return signalNumber;
}

}  // namespace tessera
