#include "reader/reader_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <new>
#include <stdexcept>
#include <thread>
#include <utility>

#include "reader/packet.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kFirstSpare = 10;  // above every descriptor that the child gets
constexpr int kFewestFiles = 32;
constexpr int kEndMs = 2000;
constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE | F_SEAL_SEAL;

[[noreturn]] void failToStart(const std::string& what, int error) {
    std::string line = "can't start the process that reads files: " + what + ": " + std::strerror(error);
    rlimit files{};
    if (error == EMFILE && ::getrlimit(RLIMIT_NOFILE, &files) == 0)
        line += ": at most " + std::to_string(files.rlim_cur) + " are allowed here (ulimit -n), " +
                std::to_string(kFewestFiles) + " will do";
    throw IoError(line);
}

/// A copy that no dup2 in the child overwrites.
Descriptor spareCopy(const Descriptor& descriptor) {
    const int copy = ::fcntl(descriptor.get(), F_DUPFD_CLOEXEC, kFirstSpare);
    // Numbers from kFirstSpare on may all be forbidden.
    if (copy < 0) failToStart("descriptor", errno == EINVAL ? EMFILE : errno);
    return Descriptor(copy);
}

/// The terminal signals the whole group: what becomes of the child is its parent's decision.
sigset_t maskOfChild() {
    sigset_t blocked;
    pthread_sigmask(SIG_SETMASK, nullptr, &blocked);
    for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT}) sigaddset(&blocked, number);
    return blocked;
}

/// The environment of a started program: ours, and memory in large pages where the system has them on
/// request, since a reader's time goes into first touches.
class ReaderEnvironment {
  public:
    ReaderEnvironment() {
        for (char** entry = environ; entry && *entry; ++entry) {
            entries_.push_back(*entry);
            if (std::strncmp(*entry, kTunables, std::strlen(kTunables)) == 0) tuned_ = true;
        }
        if (!tuned_) entries_.push_back(largePages_.data());
        entries_.push_back(nullptr);
    }
    char** entries() { return entries_.data(); }

  private:
    static constexpr const char* kTunables = "GLIBC_TUNABLES=";
    std::string largePages_ = std::string(kTunables) + "glibc.malloc.hugetlb=1";
    bool tuned_ = false;  // by the user
    std::vector<char*> entries_;
};

/// What posix_spawn does in the child.
class SpawnPlan {
  public:
    SpawnPlan(const Descriptor& reports, const Descriptor& answer) {
        posix_spawn_file_actions_init(&actions_);
        posix_spawnattr_init(&attributes_);
        int error = 0;
        for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
            error |= posix_spawn_file_actions_addopen(&actions_, stream, "/dev/null", O_RDWR, 0);
        error |= posix_spawn_file_actions_adddup2(&actions_, reports.get(), kReportDescriptor);
        error |= posix_spawn_file_actions_adddup2(&actions_, answer.get(), kAnswerDescriptor);
        error |= posix_spawn_file_actions_addclosefrom_np(&actions_, kAnswerDescriptor + 1);
        const sigset_t blocked = maskOfChild();
        error |= posix_spawnattr_setsigmask(&attributes_, &blocked);
        error |= posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK);
        if (error != 0) {
            release();
            failToStart("preparation", ENOMEM);
        }
    }
    ~SpawnPlan() { release(); }
    SpawnPlan(const SpawnPlan&) = delete;
    SpawnPlan& operator=(const SpawnPlan&) = delete;

    pid_t spawn(const std::string& executable, const std::vector<std::string>& arguments) {
        std::vector<char*> words{const_cast<char*>(executable.c_str())};
        for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
        words.push_back(nullptr);
        ReaderEnvironment environment;
        pid_t child = -1;
        if (const int error = posix_spawn(&child, executable.c_str(), &actions_, &attributes_, words.data(),
                                          environment.entries()))
            failToStart(executable, error);
        return child;
    }

  private:
    void release() {
        posix_spawn_file_actions_destroy(&actions_);
        posix_spawnattr_destroy(&attributes_);
    }
    posix_spawn_file_actions_t actions_;
    posix_spawnattr_t attributes_;
};

/// Whether a limit that stood before this program ended a child.
bool ranIntoProcessorLimit(int status, const rusage& used) {
    rlimit limit{};
    if (!WIFSIGNALED(status) || ::getrlimit(RLIMIT_CPU, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return false;
    // The kernel counts in ticks.
    const double seconds = double(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
                           double(used.ru_utime.tv_usec + used.ru_stime.tv_usec) * 1e-6;
    return WTERMSIG(status) == SIGXCPU ||
           (WTERMSIG(status) == SIGKILL && seconds > double(limit.rlim_cur) - 0.1);
}

ProcessEnd describe(int status, const rusage& used) {
    if (ranIntoProcessorLimit(status, used))
        return {"took more processor time than is allowed here (ulimit -t)", true, true};
    if (WIFEXITED(status))
        return {"ended without a result (exit code " + std::to_string(WEXITSTATUS(status)) + ")"};
    const int number = WTERMSIG(status);
    if (number == SIGKILL) return {"was killed (signal 9), as the system does when memory runs out", true};
    const char* name = sigdescr_np(number);
    return {"crashed (signal " + std::to_string(number) + (name ? std::string(", ") + name : "") + ")", true};
}

}  // namespace

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
    close();
    number_ = std::exchange(other.number_, -1);
    return *this;
}

void Descriptor::close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
}

SealedMemory::SealedMemory(int descriptor, std::int64_t mostBytes) {
    ::fcntl(descriptor, F_ADD_SEALS, kSeals);
    const int seals = ::fcntl(descriptor, F_GET_SEALS);
    struct stat status {};
    if (seals < 0 || (seals & kSeals) != kSeals || ::fstat(descriptor, &status) != 0)
        throw DamagedPacket("its memory can't be sealed");
    if (status.st_size > mostBytes) throw DamagedPacket("it is larger than the limit");
    if (status.st_size == 0) return;
    const auto size = std::size_t(status.st_size);
    void* memory = ::mmap(nullptr, size, PROT_READ, MAP_SHARED | MAP_POPULATE, descriptor, 0);
    if (memory == MAP_FAILED) throw std::bad_alloc();
    bytes_ = {static_cast<const std::byte*>(memory), size};
}

SealedMemory::~SealedMemory() {
    if (!bytes_.empty()) ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

void ReaderProcess::open() {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) failToStart("socket", errno);
    reports_ = Descriptor(ends[0]);
    childReports_ = Descriptor(ends[1]);
    if (::fcntl(reports_.get(), F_SETFL, O_NONBLOCK) != 0) failToStart("socket", errno);
    answer_ = Descriptor(::memfd_create("tessera-answer", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (answer_.get() < 0) failToStart("shared memory", errno);
    childReports_ = spareCopy(childReports_);
    childAnswer_ = spareCopy(answer_);
}

ReaderProcess::ReaderProcess(const std::string& executable, const std::vector<std::string>& arguments) {
    open();
    child_ = SpawnPlan(childReports_, childAnswer_).spawn(executable, arguments);
    childReports_.close();
    childAnswer_.close();
}

ReaderProcess::~ReaderProcess() {
    kill();
}

void ReaderProcess::kill() {
    if (child_ < 0) return;
    ::kill(child_, SIGKILL);
    while (::waitpid(child_, nullptr, 0) < 0 && errno == EINTR) continue;
    child_ = -1;
}

double ReaderProcess::processorSeconds() const {
    clockid_t clock{};
    timespec time{};
    if (child_ < 0 || ::clock_getcpuclockid(child_, &clock) != 0 || ::clock_gettime(clock, &time) != 0)
        return 0;
    return double(time.tv_sec) + double(time.tv_nsec) * 1e-9;
}

ProcessEnd ReaderProcess::describeEnd() {
    // A process closes its files a moment before it can be reaped.
    for (int wait = 0; child_ >= 0 && wait < kEndMs; ++wait) {
        int status = 0;
        rusage used{};
        const pid_t reaped = ::wait4(child_, &status, WNOHANG, &used);
        if (reaped < 0 && errno != EINTR) break;  // where SIGCHLD is ignored there is nothing to reap
        if (reaped > 0) {
            child_ = -1;
            return describe(status, used);
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    kill();
    return {"ended without a result"};
}

}  // namespace tessera
