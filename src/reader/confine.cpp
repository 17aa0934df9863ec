#include "reader/confine.h"

#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

namespace {

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;  // no filter
#endif

constexpr std::uint64_t kReadFolder = LANDLOCK_ACCESS_FS_READ_FILE | LANDLOCK_ACCESS_FS_READ_DIR;
// Rights that the first version of Landlock knows, and those that came with the second and the third:
// numbers, as headers may be older than the kernel.
constexpr std::uint64_t kRights1 = (1u << 13) - 1, kRights2 = 1u << 13, kRights3 = 1u << 14;

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
    landlock_ruleset_attr handled{};
    handled.handled_access_fs = kRights1 | (version >= 2 ? kRights2 : 0) | (version >= 3 ? kRights3 : 0);
    const int rules = int(::syscall(SYS_landlock_create_ruleset, &handled, sizeof handled, 0));
    if (rules < 0) return;
    for (const char* folder : {"/usr", "/lib", "/lib64", "/etc/ld.so.cache", "/proc/self", "/proc/meminfo",
                               "/sys/devices/system", "/dev/null", "/dev/urandom"})
        allowReading(rules, folder);
    for (const std::string& path : readable) allowReading(rules, path);
    ::syscall(SYS_landlock_restrict_self, rules, 0);
    ::close(rules);
}

/// Calls that no reader of files needs.
constexpr std::array kRefusedCalls{SYS_socket,
                                   SYS_socketpair,
                                   SYS_connect,
                                   SYS_bind,
                                   SYS_listen,
                                   SYS_execve,
                                   SYS_execveat,
                                   SYS_ptrace,
                                   SYS_process_vm_readv,
                                   SYS_process_vm_writev,
                                   SYS_io_uring_setup,
                                   SYS_bpf,
                                   SYS_mount,
                                   SYS_unshare,
                                   SYS_setns,
                                   SYS_keyctl,
                                   SYS_add_key,
                                   SYS_perf_event_open,
                                   SYS_userfaultfd};

void confineCalls() {
    if (kArchitecture == 0) return;
    std::vector<sock_filter> filter{
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, arch)),
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0),
        BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS),
        BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
    };
#if defined(__x86_64__)
    // Numbers of the x32 interface are calls of their own.
    filter.push_back(BPF_JUMP(BPF_JMP | BPF_JGE | BPF_K, 0x40000000, 0, 1));
    filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS));
#endif
    for (const long call : kRefusedCalls) {
        filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, std::uint32_t(call), 0, 1));
        filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM));
    }
    filter.push_back(BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW));
    sock_fprog program{};
    program.len = static_cast<unsigned short>(filter.size());
    program.filter = filter.data();
    ::syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0, &program);
}

}  // namespace

Confinement availableConfinement() {
    const std::uint32_t action = SECCOMP_RET_ERRNO;
    return {landlockVersion() >= 1,
            kArchitecture != 0 && ::syscall(SYS_seccomp, SECCOMP_GET_ACTION_AVAIL, 0, &action) == 0};
}

void confine(std::span<const std::string> readable) {
    if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return;
    confineFiles(readable);
    confineCalls();
}

}  // namespace tessera
