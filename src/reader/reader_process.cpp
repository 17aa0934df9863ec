#include "reader/reader_process.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <new>
#include <thread>

#include "base/timer.h"
#include "reader/packet.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr const char* kTask = "that reads files";
/// Memory in large pages where the system has them on request: a reader's time goes into first touches.
constexpr const char* kLargePages = "GLIBC_TUNABLES=glibc.malloc.hugetlb=1";
constexpr int kSeals = F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE | F_SEAL_SEAL;

constexpr double kSealMs = 2000;

[[noreturn]] void failToOpen(const std::string& what) {
    failToStart(kTask, what, errno);
}

}  // namespace

SealedMemory::SealedMemory(int descriptor, std::int64_t mostBytes) {
    // The kernel may look through its pages just now, and then waits for only a moment.
    for (const Timer timer; ::fcntl(descriptor, F_ADD_SEALS, kSeals) != 0 && errno == EBUSY;) {
        if (timer.elapsedMs() > kSealMs) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    const int seals = ::fcntl(descriptor, F_GET_SEALS);
    struct stat status {};
    if (seals < 0 || (seals & kSeals) != kSeals || ::fstat(descriptor, &status) != 0)
        throw DamagedPacket("its memory can't be sealed");
    if (status.st_size > mostBytes) throw DamagedPacket("it is larger than the limit");
    // Holes cost the child nothing, and would be filled here.
    if (std::int64_t(status.st_blocks) * 512 < status.st_size) throw DamagedPacket("it has holes");
    if (status.st_size == 0) return;
    const auto size = std::size_t(status.st_size);
    void* memory = ::mmap(nullptr, size, PROT_READ, MAP_SHARED | MAP_POPULATE, descriptor, 0);
    if (memory == MAP_FAILED) throw std::bad_alloc();
    bytes_ = {static_cast<const std::byte*>(memory), size};
}

SealedMemory::~SealedMemory() {
    if (!bytes_.empty()) ::munmap(const_cast<std::byte*>(bytes_.data()), bytes_.size());
}

ReaderProcess::ReaderProcess(const std::string& executable, const std::vector<std::string>& arguments) {
    int ends[2];
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) failToOpen("socket");
    reports_ = Descriptor(ends[0]);
    const Descriptor childReports(ends[1]);
    if (::fcntl(reports_.get(), F_SETFL, O_NONBLOCK) != 0) failToOpen("socket");
    answer_ = Descriptor(::memfd_create("tessera-answer", MFD_CLOEXEC | MFD_ALLOW_SEALING));
    if (answer_.get() < 0) failToOpen("shared memory");
    child_.emplace(
        ChildStart{kTask, executable, arguments, {childReports.get(), answer_.get()}, kLargePages});
}

}  // namespace tessera
