#include "base/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "base/timer.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kFirstSpare = 10;  // above every descriptor that the child gets
constexpr int kFewestFiles = 32;
constexpr double kEndMs = 2000;
constexpr double kTickAccuracy = 0.8;  // of the kernel's count of processor time, on a busy machine

/// The terminal signals the whole group: what becomes of the child is its parent's decision.
sigset_t maskOfChild() {
    sigset_t blocked;
    pthread_sigmask(SIG_SETMASK, nullptr, &blocked);
    for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) sigaddset(&blocked, number);
    return blocked;
}

/// This process's environment and a variable that it may lack.
class ChildEnvironment {
  public:
    explicit ChildEnvironment(const std::string& variable) : variable_(variable) {
        const std::size_t name = variable.find('=') + 1;
        bool isSet = name == 0;
        for (char** entry = environ; entry && *entry; ++entry) {
            entries_.push_back(*entry);
            isSet = isSet || std::strncmp(*entry, variable.c_str(), name) == 0;
        }
        if (!isSet) entries_.push_back(variable_.data());
        entries_.push_back(nullptr);
    }
    char** entries() { return entries_.data(); }

  private:
    std::string variable_;
    std::vector<char*> entries_;
};

/// What posix_spawn does in the child.
class SpawnPlan {
  public:
    explicit SpawnPlan(const ChildStart& start) {
        posix_spawn_file_actions_init(&actions_);
        posix_spawnattr_init(&attributes_);
        try {
            prepare(start);
        } catch (...) {
            release();
            throw;
        }
    }
    ~SpawnPlan() { release(); }
    SpawnPlan(const SpawnPlan&) = delete;
    SpawnPlan& operator=(const SpawnPlan&) = delete;

    pid_t spawn(const ChildStart& start) {
        std::vector<char*> words{const_cast<char*>(start.executable.c_str())};
        for (const std::string& argument : start.arguments)
            words.push_back(const_cast<char*>(argument.c_str()));
        words.push_back(nullptr);
        ChildEnvironment environment(start.variable);
        pid_t child = -1;
        if (const int error = posix_spawn(&child, start.executable.c_str(), &actions_, &attributes_,
                                          words.data(), environment.entries()))
            failToStart(start.task, start.executable, error);
        return child;
    }

  private:
    void prepare(const ChildStart& start) {
        int error = 0, next = STDERR_FILENO;
        for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
            error |= posix_spawn_file_actions_addopen(&actions_, stream, "/dev/null", O_RDWR, 0);
        for (const int descriptor : start.descriptors) {
            // A copy that no dup2 in the child overwrites.
            spare_.emplace_back(::fcntl(descriptor, F_DUPFD_CLOEXEC, kFirstSpare));
            // Numbers from kFirstSpare on may all be forbidden.
            if (spare_.back().get() < 0)
                failToStart(start.task, "descriptor", errno == EINVAL ? EMFILE : errno);
            error |= posix_spawn_file_actions_adddup2(&actions_, spare_.back().get(), ++next);
        }
        error |= posix_spawn_file_actions_addclosefrom_np(&actions_, next + 1);
        const sigset_t blocked = maskOfChild();
        error |= posix_spawnattr_setsigmask(&attributes_, &blocked);
        const int group = start.hasOwnGroup ? POSIX_SPAWN_SETPGROUP : 0;
        error |= posix_spawnattr_setflags(&attributes_, short(POSIX_SPAWN_SETSIGMASK | group));
        if (error != 0) failToStart(start.task, "preparation", ENOMEM);
    }
    void release() {
        posix_spawn_file_actions_destroy(&actions_);
        posix_spawnattr_destroy(&attributes_);
    }

    std::vector<Descriptor> spare_;
    posix_spawn_file_actions_t actions_;
    posix_spawnattr_t attributes_;
};

/// Whether a limit that stood before this program ended a child.
bool ranIntoProcessorLimit(int status, const rusage& used) {
    rlimit limit{};
    if (!WIFSIGNALED(status) || ::getrlimit(RLIMIT_CPU, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return false;
    const double seconds = double(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                           double(used.ru_utime.tv_usec + used.ru_stime.tv_usec) * 1e-6;
    return WTERMSIG(status) == SIGXCPU ||
           (WTERMSIG(status) == SIGKILL && seconds > kTickAccuracy * double(limit.rlim_cur));
}

ProcessEnd describe(int status, const rusage& used) {
    if (ranIntoProcessorLimit(status, used))
        return {"took more processor time than is allowed here (ulimit -t)", true, true};
    if (WIFEXITED(status)) {
        const int code = WEXITSTATUS(status);
        return {"ended without a result (exit code " + std::to_string(code) + ")", false, false, code};
    }
    const int number = WTERMSIG(status);
    if (number == SIGKILL) return {"was killed (signal 9), as the system does when memory runs out", true};
    const char* name = sigdescr_np(number);
    return {"crashed (signal " + std::to_string(number) + (name ? std::string(", ") + name : "") + ")", true};
}

}  // namespace

void failToStart(const std::string& task, const std::string& what, int error) {
    std::string line = "can't start the process " + task + ": " + what + ": " + std::strerror(error);
    rlimit files{};
    if (error == EMFILE && ::getrlimit(RLIMIT_NOFILE, &files) == 0)
        line += ": at most " + std::to_string(files.rlim_cur) + " are allowed here (ulimit -n), " +
                std::to_string(kFewestFiles) + " will do";
    throw IoError(line);
}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
    close();
    number_ = std::exchange(other.number_, -1);
    return *this;
}

void Descriptor::close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
}

ChildProcess::ChildProcess(const ChildStart& start)
    : child_(SpawnPlan(start).spawn(start)), hasOwnGroup_(start.hasOwnGroup) {}

void ChildProcess::kill() {
    if (child_ < 0) return;
    ::kill(hasOwnGroup_ ? -child_ : child_, SIGKILL);
    // One that hangs in the kernel, in a broken graphics driver say, doesn't end: it isn't waited for.
    reapSoon();
    child_ = -1;
}

double ChildProcess::processorSeconds() const {
    clockid_t clock{};
    timespec time{};
    if (child_ < 0 || ::clock_getcpuclockid(child_, &clock) != 0 || ::clock_gettime(clock, &time) != 0)
        return 0;
    return double(time.tv_sec) + double(time.tv_nsec) * 1e-9;
}

std::optional<ProcessEnd> ChildProcess::reap() {
    int status = 0;
    rusage used{};
    const pid_t reaped = child_ < 0 ? -1 : ::wait4(child_, &status, WNOHANG, &used);
    if (reaped == 0 || (reaped < 0 && child_ >= 0 && errno == EINTR)) return std::nullopt;
    child_ = -1;
    // Where SIGCHLD is ignored there is nothing to reap.
    return reaped > 0 ? describe(status, used) : ProcessEnd{"ended without a result"};
}

std::optional<ProcessEnd> ChildProcess::reapSoon() {
    for (const Timer timer; timer.elapsedMs() < kEndMs;) {
        if (std::optional<ProcessEnd> end = reap()) return end;
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    return std::nullopt;
}

ProcessEnd ChildProcess::describeEnd() {
    // A process closes its files a moment before it can be reaped.
    if (std::optional<ProcessEnd> end = reapSoon()) return *end;
    kill();
    return {"ended without a result"};
}

void settleAsChild(std::int64_t parent) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (std::int64_t(::getppid()) != parent) ::raise(SIGKILL);  // it ended before the line above
    rlimit none{};
    ::setrlimit(RLIMIT_CORE, &none);
}

}  // namespace tessera
