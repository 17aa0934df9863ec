#include "reader/confine.h"

#include <fcntl.h>
#include <linux/capability.h>
#include <linux/landlock.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>
#ifdef TESSERA_SECCOMP
#include <sched.h>
#include <seccomp.h>
#endif

#include <array>
#include <cerrno>
#include <cstdint>
#include <initializer_list>

namespace tessera {

namespace {

constexpr std::uint64_t kReadFolder = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;

/// What is given up, by version of Landlock: numbers, as headers may be older than the kernel.
struct LandlockRules {
    std::uint64_t files = (1u << 13) - 1;  ///< the second adds one, the third another
    std::uint64_t network = 3;             ///< from the fourth
    std::uint64_t scopes = 3;              ///< from the sixth: sockets and signals of others
};

std::size_t sizeForVersion(int version) {
    return version >= 6 ? sizeof(LandlockRules) : (version >= 4 ? 2 : 1) * sizeof(std::uint64_t);
}

int landlockVersion() {
    return int(::syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION));
}

void allowReading(int rules, const std::string& path) {
    const int descriptor = ::open(path.c_str(), O_PATH | O_CLOEXEC);
    if (descriptor < 0) return;
    struct stat status {};
    if (::fstat(descriptor, &status) == 0) {
        landlock_path_beneath_attr rule{};
        rule.allowed_access = S_ISDIR(status.st_mode) ? kReadFolder : LANDLOCK_ACCESS_FS_READ_FILE;
        rule.parent_fd = descriptor;
        ::syscall(SYS_landlock_add_rule, rules, LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
    }
    ::close(descriptor);
}

void confineFiles(std::span<const std::string> readable) {
    const int version = landlockVersion();
    if (version < 1) return;
    LandlockRules handled;
    handled.files |= (version >= 2 ? 1u << 13 : 0) | (version >= 3 ? 1u << 14 : 0);
    const int rules = int(::syscall(SYS_landlock_create_ruleset, &handled, sizeForVersion(version), 0));
    if (rules < 0) return;
    for (const char* folder : {"/usr", "/lib", "/lib64", "/etc/ld.so.cache", "/proc/self", "/proc/meminfo",
                               "/sys/devices/system", "/sys/kernel/mm", "/dev/null", "/dev/urandom"})
        allowReading(rules, folder);
    for (const std::string& path : readable) allowReading(rules, path);
    ::syscall(SYS_landlock_restrict_self, rules, 0);
    ::close(rules);
}

#ifdef TESSERA_SECCOMP
/// All that reading files, memory, threads and the clock need, in any version of the C library. What isn't
/// here isn't there (ENOSYS): the network, other programs and processes, the names and rights of files.
constexpr std::array kCalls{
    // files that are open, and looking at those that aren't
    SCMP_SYS(read), SCMP_SYS(readv), SCMP_SYS(pread64), SCMP_SYS(preadv), SCMP_SYS(write), SCMP_SYS(writev),
    SCMP_SYS(close), SCMP_SYS(lseek), SCMP_SYS(fstat), SCMP_SYS(newfstatat), SCMP_SYS(stat), SCMP_SYS(lstat),
    SCMP_SYS(statx), SCMP_SYS(statfs), SCMP_SYS(fstatfs), SCMP_SYS(access), SCMP_SYS(faccessat),
    SCMP_SYS(faccessat2), SCMP_SYS(readlink), SCMP_SYS(readlinkat), SCMP_SYS(getdents64), SCMP_SYS(getcwd),
    SCMP_SYS(fadvise64), SCMP_SYS(ftruncate), SCMP_SYS(dup), SCMP_SYS(poll), SCMP_SYS(ppoll),
    // memory
    SCMP_SYS(brk), SCMP_SYS(mmap), SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(mprotect), SCMP_SYS(madvise),
    SCMP_SYS(mbind), SCMP_SYS(get_mempolicy),
    // threads and signals of this process
    SCMP_SYS(futex), SCMP_SYS(set_robust_list), SCMP_SYS(get_robust_list), SCMP_SYS(set_tid_address),
    SCMP_SYS(rseq), SCMP_SYS(arch_prctl), SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(rt_sigaction),
    SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn), SCMP_SYS(sigaltstack), SCMP_SYS(getpid),
    SCMP_SYS(getppid), SCMP_SYS(gettid), SCMP_SYS(sched_yield), SCMP_SYS(sched_getaffinity),
    SCMP_SYS(sched_getparam), SCMP_SYS(sched_getscheduler), SCMP_SYS(restart_syscall), SCMP_SYS(membarrier),
    // what there is of time, memory and processors; who this is
    SCMP_SYS(clock_gettime), SCMP_SYS(clock_getres), SCMP_SYS(clock_nanosleep), SCMP_SYS(nanosleep),
    SCMP_SYS(gettimeofday), SCMP_SYS(time), SCMP_SYS(times), SCMP_SYS(getrusage), SCMP_SYS(getrlimit),
    SCMP_SYS(sysinfo), SCMP_SYS(uname), SCMP_SYS(getcpu), SCMP_SYS(getrandom), SCMP_SYS(getuid),
    SCMP_SYS(geteuid), SCMP_SYS(getgid), SCMP_SYS(getegid)};

void confineCalls() {
    const scmp_filter_ctx filter = ::seccomp_init(SCMP_ACT_ERRNO(ENOSYS));
    if (!filter) return;
    bool isWhole = true;
    const auto allow = [&](int call, std::initializer_list<scmp_arg_cmp> where) {
        isWhole &= ::seccomp_rule_add_array(filter, SCMP_ACT_ALLOW, call, unsigned(where.size()),
                                            where.begin()) == 0;
    };
    for (const int call : kCalls) allow(call, {});
    // Opening to read; threads, no processes; its own signals and limits; descriptors as they are.
    constexpr scmp_datum_t kWays = O_ACCMODE | O_CREAT | O_TRUNC;
    allow(SCMP_SYS(open), {SCMP_A1(SCMP_CMP_MASKED_EQ, kWays, O_RDONLY)});
    allow(SCMP_SYS(openat), {SCMP_A2(SCMP_CMP_MASKED_EQ, kWays, O_RDONLY)});
    allow(SCMP_SYS(clone), {SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD)});
    allow(SCMP_SYS(tgkill), {SCMP_A0(SCMP_CMP_EQ, scmp_datum_t(::getpid()), 0)});
    allow(SCMP_SYS(prlimit64), {SCMP_A0(SCMP_CMP_EQ, 0, 0)});
    allow(SCMP_SYS(prctl), {SCMP_A0(SCMP_CMP_EQ, PR_SET_NAME, 0)});
    for (const int command : {F_GETFD, F_SETFD, F_GETFL, F_DUPFD, F_DUPFD_CLOEXEC})
        allow(SCMP_SYS(fcntl), {SCMP_A1(SCMP_CMP_EQ, scmp_datum_t(command), 0)});
    for (const int lock : {LOCK_SH, LOCK_SH | LOCK_NB, LOCK_UN})
        allow(SCMP_SYS(flock), {SCMP_A1(SCMP_CMP_EQ, scmp_datum_t(lock), 0)});
    if (isWhole) ::seccomp_load(filter);
    ::seccomp_release(filter);
}

bool hasFilter() {
    return ::seccomp_api_get() >= 2;
}
#else
void confineCalls() {}

bool hasFilter() {
    return false;
}
#endif

/// What a superuser may do beyond reading others' files: raise limits, say.
void dropCapabilities() {
    __user_cap_header_struct head{_LINUX_CAPABILITY_VERSION_3, 0};
    std::array<__user_cap_data_struct, 2> kept{};
    if (::syscall(SYS_capget, &head, kept.data()) != 0) return;
    constexpr unsigned kReading = 1u << CAP_DAC_OVERRIDE | 1u << CAP_DAC_READ_SEARCH;
    for (__user_cap_data_struct& word : kept) {
        const unsigned mask = &word == kept.data() ? kReading : 0;
        word.effective &= mask;
        word.permitted &= mask;
        word.inheritable = 0;
    }
    ::syscall(SYS_capset, &head, kept.data());
}

}  // namespace

Confinement availableConfinement() {
    return {landlockVersion() >= 1, hasFilter()};
}

void confine(std::span<const std::string> readable) {
    dropCapabilities();
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return;
    confineFiles(readable);
    confineCalls();
}

}  // namespace tessera
