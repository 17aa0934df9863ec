#include "interrupt.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <exception>

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

constexpr double kLongestTimer = 1e9;  // seconds
constexpr double kLeftSeconds = 0.25;  // of processor time, for the last line

/// Work of all threads goes on until the process ends, and the system may end it by force.
void endOutOfTime(int) {
    removeTemporaryFiles();
    constexpr char kWipe[] = "\r\x1b[K";  // progress
    constexpr char kLine[] =
        "tessera: took more processor time than is allowed here (ulimit -t); no unfinished file is left\n";
    [[maybe_unused]] ssize_t written = 0;
    if (::isatty(STDERR_FILENO)) written = ::write(STDERR_FILENO, kWipe, sizeof kWipe - 1);
    written = ::write(STDERR_FILENO, kLine, sizeof kLine - 1);
    _exit(1);
}

/// Where both limits are the same, as the shell's ulimit sets them, the system gives no signal that could be
/// caught: a timer rings before.
void catchProcessorLimit() {
    rlimit limit{};
    if (::getrlimit(RLIMIT_CPU, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return;
    signal(SIGXCPU, endOutOfTime);
    signal(SIGPROF, endOutOfTime);
    timespec used{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
    const double left = std::max(
        1e-3, double(limit.rlim_cur) - kLeftSeconds - double(used.tv_sec) - double(used.tv_nsec) * 1e-9);
    itimerval timer{};
    timer.it_value.tv_sec = time_t(std::min(left, kLongestTimer));
    timer.it_value.tv_usec = suseconds_t((left - std::floor(left)) * 1e6);
    ::setitimer(ITIMER_PROF, &timer, nullptr);
}

#if !defined(TESSERA_ADDRESS_SANITIZER) && !defined(TESSERA_THREAD_SANITIZER)
void endAtOnce(int number) {
    constexpr char kLine[] = "tessera: interrupted; no unfinished file is left\n";
    [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kLine, sizeof kLine - 1);
    _exit(128 + number);
}

/// Where a library fails to set itself up.
[[noreturn]] void endBeforeMain() {
    constexpr char kLine[] =
        "tessera: its libraries can't start: memory or threads are too few (ulimit -v, ulimit -u)\n";
    [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, kLine, sizeof kLine - 1);
    _exit(1);
}

// Libraries take a tenth of a second to set themselves up before main(): nothing is begun by then. While the
// system still loads them a signal just ends the program, without a line.
void catchEarlyEnds() {
    catchInterrupts(endAtOnce);
    std::set_terminate(endBeforeMain);
}
[[gnu::used, gnu::section(".preinit_array")]] void (*const beforeLibraries)() = catchEarlyEnds;
#endif

}  // namespace

void installInterruptHandlers() {
    catchInterrupts(handleSignal);
    catchProcessorLimit();
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
