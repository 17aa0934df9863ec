#include "reader/serve_mesh_reader.h"

#include <fcntl.h>
#include <link.h>
#include <malloc.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <system_error>

#include "base/sanitizers.h"
#include "base/timer.h"
#include "reader/isolated_reader.h"
#include "reader/mesh_packet.h"
#include "reader/reader_process.h"
#include "reader/reader_report.h"
#include "tessera/error.h"

#if defined(TESSERA_ADDRESS_SANITIZER) || defined(TESSERA_THREAD_SANITIZER)
#define TESSERA_SHADOW_MEMORY 1  // terabytes of address space: no limit can be set
#endif

namespace tessera {

namespace {

constexpr std::size_t kLongestSentence = 1 << 16;
constexpr int kMostArenas = 1;                  // more reserve 64 MB of address space each
constexpr std::int64_t kThreadBytes = 9 << 20;  // a thread's stack, used or not
constexpr std::int64_t kThreadShare = 8;        // threads take an eighth of the bound at most

void writeAll(int descriptor, const void* bytes, std::size_t count) {
    const char* next = static_cast<const char*>(bytes);
    while (count > 0) {
        const ssize_t written = ::write(descriptor, next, count);
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) throw std::system_error(errno, std::generic_category(), "handing over the mesh");
        next += written;
        count -= std::size_t(written);
    }
}

void report(ReaderOutcome outcome, std::string message) {
    message.resize(std::min(message.size(), kLongestSentence));
    const ReportStart start{ReportStart::kMagic, outcome, message.size()};
    writeAll(kReportDescriptor, &start, sizeof start);
    writeAll(kReportDescriptor, message.data(), message.size());
}

/// How many threads may read so that their stacks leave the memory to the mesh.
int threadsWithin(const ReaderRequest& request) {
    Execution execution;
    execution.threads = request.threads;
    const std::int64_t most = std::max<std::int64_t>(1, request.memoryBytes / (kThreadShare * kThreadBytes));
    return int(std::min<std::int64_t>(execution.threadCount(), most));
}

#ifndef TESSERA_SHADOW_MEMORY
constexpr std::int64_t kUnseenBytes = 256 << 20;  // heaps and stacks, rounded up

int addSpan(dl_phdr_info* object, std::size_t, void* sum) {
    ElfW(Addr) first = ~ElfW(Addr)(0), last = 0;
    for (int h = 0; h < object->dlpi_phnum; ++h) {
        const ElfW(Phdr)& part = object->dlpi_phdr[h];
        if (part.p_type != PT_LOAD) continue;
        first = std::min(first, part.p_vaddr);
        last = std::max(last, part.p_vaddr + part.p_memsz);
    }
    if (last > first) *static_cast<std::int64_t*>(sum) += std::int64_t(last - first);
    return 0;
}

/// What the program takes now; where /proc is missing what it may take with all its libraries.
std::int64_t addressSpaceBytes() {
    long long pages = 0;
    if (std::FILE* file = std::fopen("/proc/self/statm", "re")) {
        if (std::fscanf(file, "%lld", &pages) != 1) pages = 0;
        std::fclose(file);
    }
    if (pages > 0) return pages * ::sysconf(_SC_PAGE_SIZE);
    std::int64_t bytes = kUnseenBytes;
    ::dl_iterate_phdr(addSpan, &bytes);
    return bytes;
}
#endif

/// Returns false where a lower limit stands already.
bool lowerLimit(__rlimit_resource resource, rlim_t value) {
    rlimit limit{};
    ::getrlimit(resource, &limit);
    if (limit.rlim_cur <= value) return false;
    limit.rlim_cur = value;
    limit.rlim_max = std::min(limit.rlim_max, value);
    ::setrlimit(resource, &limit);
    return true;
}

/// Returns what running out of memory means from here on: the bound given here, or one that was there.
ReaderOutcome limitMemory([[maybe_unused]] const ReaderRequest& request) {
#ifndef TESSERA_SHADOW_MEMORY
    ::mallopt(M_ARENA_MAX, kMostArenas);
    if (!lowerLimit(RLIMIT_AS, rlim_t(addressSpaceBytes() + request.memoryBytes)))
        return ReaderOutcome::outOfMemory;
#endif
    return ReaderOutcome::overLimit;
}

/// Ends this process with its parent, leaves no core file, and writes without a signal.
void settle(const ReaderRequest& request) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (std::int64_t(::getppid()) != request.parent) ::raise(SIGKILL);  // it ended before the line above
    lowerLimit(RLIMIT_CORE, 0);
    lowerLimit(RLIMIT_FSIZE, rlim_t(request.memoryBytes));  // also the size of the shared memory
    ::signal(SIGXFSZ, SIG_IGN);
}

/// A limit on file sizes holds for memory files too.
bool memoryTakes(std::int64_t bytes) {
    rlimit limit{};
    return ::getrlimit(RLIMIT_FSIZE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY ||
           rlim_t(bytes) <= limit.rlim_cur;
}

void handOver(MeshFile file, std::int64_t memoryBytes) {
    file.readPeakBytes = peakMemoryBytes();
    const std::int64_t bytes = packetBytes(file);
    if (bytes > memoryBytes) throw std::bad_alloc();  // the parent would take it for garbage
    if (memoryTakes(bytes)) {
        writePacket(std::move(file),
                    [](const void* data, std::size_t count) { writeAll(kMeshDescriptor, data, count); });
        report(ReaderOutcome::meshInMemory, {});
        return;
    }
    const ReportStart start{ReportStart::kMagic, ReaderOutcome::meshFollows, std::uint64_t(bytes)};
    writeAll(kReportDescriptor, &start, sizeof start);
    writePacket(std::move(file),
                [](const void* data, std::size_t count) { writeAll(kReportDescriptor, data, count); });
}

ReaderOutcome memoryRanOut = ReaderOutcome::overLimit;

/// Libraries allocate in destructors too, where a failure ends the program.
[[noreturn]] void reportAndEnd() {
    try {
        if (const std::exception_ptr failure = std::current_exception()) std::rethrow_exception(failure);
    } catch (const std::bad_alloc&) {
        report(memoryRanOut, {});
        ::_exit(0);
    } catch (...) {
    }
    std::abort();
}

}  // namespace

int serveMeshReader(std::span<const std::string> arguments, const MeshReader& read) {
    const ReaderRequest request = parseRequest(arguments);
    if (::fcntl(kReportDescriptor, F_GETFD) < 0 || ::fcntl(kMeshDescriptor, F_GET_SEALS) < 0)
        throw InputError("the reader of meshes is started by tessera itself");
    settle(request);
    memoryRanOut = limitMemory(request);
    std::set_terminate(reportAndEnd);
    try {
        Execution execution;
        execution.threads = threadsWithin(request);
        handOver(read(request.path, request.options, execution), request.memoryBytes);
    } catch (const TooLargeError&) {
        report(memoryRanOut, {});
    } catch (const std::bad_alloc&) {
        report(memoryRanOut, {});
    } catch (const OtherFormatError& error) {
        report(ReaderOutcome::otherFormat, error.what());
    } catch (const InputError& error) {
        report(ReaderOutcome::inputError, error.what());
    } catch (const IoError& error) {
        report(ReaderOutcome::ioError, error.what());
    } catch (const InternalError& error) {
        report(ReaderOutcome::internalError, error.what());
    } catch (const std::exception& error) {
        report(ReaderOutcome::otherError, error.what());
    }
    return 0;
}

}  // namespace tessera
