#include "interrupt.h"

#include <signal.h>
#include <unistd.h>

#include "base/sanitizers.h"
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

void catchInterrupts(void (*handler)(int)) {
    struct sigaction action {};
    action.sa_handler = handler;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    // Whoever started the program with nohup wants it to outlive the terminal.
    struct sigaction before {};
    sigaction(SIGHUP, nullptr, &before);
    if (before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
}

#if !defined(TESSERA_ADDRESS_SANITIZER) && !defined(TESSERA_THREAD_SANITIZER)
void endAtOnce(int number) {
    constexpr char kLine[] = "tessera: interrupted; no unfinished file is left\n";
    [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kLine, sizeof kLine - 1);
    _exit(128 + number);
}

// Libraries take a tenth of a second to set themselves up before main(): nothing is begun by then.
void catchEarlyInterrupts() {
    catchInterrupts(endAtOnce);
}
[[gnu::used, gnu::section(".preinit_array")]] void (*const beforeLibraries)() = catchEarlyInterrupts;
#endif

}  // namespace

void installInterruptHandlers() {
    catchInterrupts(handleSignal);
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
