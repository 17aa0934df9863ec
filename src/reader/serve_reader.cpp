#include "reader/serve_reader.h"

#include <fcntl.h>
#include <link.h>
#include <malloc.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <system_error>

#include "base/child_process.h"
#include "base/machine_memory.h"
#include "base/sanitizers.h"
#include "base/text.h"
#include "base/timer.h"
#include "files/named_file.h"
#include "reader/confine.h"
#include "reader/mesh_packet.h"
#include "reader/reader_process.h"
#include "tessera/error.h"

#if defined(TESSERA_ADDRESS_SANITIZER) || defined(TESSERA_THREAD_SANITIZER)
#define TESSERA_SHADOW_MEMORY 1  // terabytes of address space: no limit can be set
#endif

namespace tessera {

namespace {

constexpr std::uint64_t kLongestRequest = std::uint64_t(1) << 32;
constexpr int kMostArenas = 1;                  // more reserve 64 MB of address space each
constexpr std::int64_t kThreadBytes = 9 << 20;  // a thread's stack, used or not
constexpr std::int64_t kThreadShare = 8;        // threads take an eighth of the bound at most

void writeAll(int descriptor, const void* bytes, std::size_t count) {
    const char* next = static_cast<const char*>(bytes);
    while (count > 0) {
        const ssize_t written = ::write(descriptor, next, count);
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) throw std::system_error(errno, std::generic_category(), "handing over the answer");
        next += written;
        count -= std::size_t(written);
    }
}

void report(ReaderOutcome outcome, const void* bytes, std::size_t count) {
    const ReportStart start{ReportStart::kMagic, outcome, count};
    writeAll(kReportDescriptor, &start, sizeof start);
    writeAll(kReportDescriptor, bytes, count);
}

void report(ReaderOutcome outcome, const std::string& message) {
    const std::string line = messageLine(message);
    report(outcome, line.data(), line.size());
}

void readAll(int descriptor, void* bytes, std::size_t count) {
    char* next = static_cast<char*>(bytes);
    while (count > 0) {
        const ssize_t got = ::read(descriptor, next, count);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) throw InputError("the request isn't whole");
        next += got;
        count -= std::size_t(got);
    }
}

ReaderRequest receiveRequest(std::int64_t parent) {
    std::uint64_t bytes = 0;
    readAll(kReportDescriptor, &bytes, sizeof bytes);
    if (bytes > kLongestRequest) throw InputError("the request is too long");
    std::vector<std::byte> words(bytes);
    readAll(kReportDescriptor, words.data(), words.size());
    ReaderRequest request = parseRequest(HeadReader(words).getTexts());
    request.parent = parent;
    return request;
}

/// How many threads may read so that their stacks leave the memory to the mesh.
int threadsWithin(int threads, std::int64_t memoryBytes) {
    Execution execution;
    execution.threads = threads;
    const std::int64_t most = std::max<std::int64_t>(1, memoryBytes / (kThreadShare * kThreadBytes));
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

void lowerLimit(__rlimit_resource resource, rlim_t value) {
    rlimit limit{};
    ::getrlimit(resource, &limit);
    limit.rlim_cur = std::min(limit.rlim_cur, value);
    limit.rlim_max = std::min(limit.rlim_max, value);
    ::setrlimit(resource, &limit);
}

ReaderOutcome memoryRanOut = ReaderOutcome::overLimit;
[[maybe_unused]] std::int64_t ownBytes = 0;  // address space that the program took at its start

/// Bounds this process to so much beyond what it took at its start, or to what bounds it already: that tells
/// what running out of memory means. @param forGood it can't be raised again.
void limitMemory([[maybe_unused]] std::int64_t memoryBytes, [[maybe_unused]] const rlimit& before,
                 [[maybe_unused]] bool forGood) {
#ifndef TESSERA_SHADOW_MEMORY
    const rlim_t own = rlim_t(ownBytes + memoryBytes);
    memoryRanOut = before.rlim_cur <= own ? ReaderOutcome::outOfMemory : ReaderOutcome::overLimit;
    rlimit limit = before;
    limit.rlim_cur = std::min(before.rlim_cur, own);
    const rlim_t most = forGood ? own : std::max(own, rlim_t(ownBytes + defaultMemoryBytes()));
    limit.rlim_max = std::min(before.rlim_max, most);
    ::setrlimit(RLIMIT_AS, &limit);
#endif
}

/// A limit on file sizes holds for memory files too.
bool memoryTakes(std::int64_t bytes) {
    rlimit limit{};
    return ::getrlimit(RLIMIT_FSIZE, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY ||
           rlim_t(bytes) <= limit.rlim_cur;
}

void handOver(Packet packet, std::int64_t mostBytes) {
    const std::int64_t bytes = packet.bytes();
    if (bytes > mostBytes) throw std::bad_alloc();  // the parent would take it for garbage
    if (memoryTakes(bytes)) {
        packet.writeTo([](const void* data, std::size_t count) { writeAll(kAnswerDescriptor, data, count); });
        report(ReaderOutcome::answerInMemory, std::string());
        return;
    }
    const ReportStart start{ReportStart::kMagic, ReaderOutcome::answerFollows, std::uint64_t(bytes)};
    writeAll(kReportDescriptor, &start, sizeof start);
    packet.writeTo([](const void* data, std::size_t count) { writeAll(kReportDescriptor, data, count); });
}

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

/// What the request's files are, and may name.
std::vector<std::string> readableFiles(const ReaderRequest& request) {
    if (request.options.followsLinks) return {"/"};
    std::vector<std::string> files{request.path, folderOf(request.path)};
    for (const std::string& part : request.options.otherParts) files.push_back(part);
    if (!request.options.namedBy.empty()) files.push_back(folderOf(request.options.namedBy));
    return files;
}

void serve(std::int64_t parent, std::span<const ReaderTask> tasks) {
    rlimit before{};
    ::getrlimit(RLIMIT_AS, &before);
#ifndef TESSERA_SHADOW_MEMORY
    ::mallopt(M_ARENA_MAX, kMostArenas);
    ownBytes = addressSpaceBytes();
#endif
    const ReaderRequest request = receiveRequest(parent);
    const bool isGiven = request.memoryBytes > 0;
    // Of the answer, too.
    lowerLimit(RLIMIT_FSIZE, rlim_t(std::max(request.memoryBytes, defaultMemoryBytes())));
    limitMemory(isGiven ? request.memoryBytes : limitsToLook().memoryBytes, before, false);
    const auto task = std::find_if(tasks.begin(), tasks.end(),
                                   [&](const ReaderTask& known) { return known.name == request.task; });
    if (task == tasks.end()) throw OtherFormatError("this program knows no task " + request.task);
    confine(readableFiles(request));
    IsolationLimits limits = task->limits(request);
    report(ReaderOutcome::limits, &limits, sizeof limits);
    if (isGiven) limits.memoryBytes = request.memoryBytes;
    limitMemory(limits.memoryBytes, before, true);
    lowerLimit(RLIMIT_FSIZE, rlim_t(limits.memoryBytes));  // also the size of the shared memory
    Execution execution;
    execution.threads = threadsWithin(request.threads, limits.memoryBytes);
    handOver(task->run(request, limits, execution), limits.memoryBytes / kHandedOverShare);
}

}  // namespace

void reportStage(Stage stage) {
    const auto number = std::uint64_t(stage);
    report(ReaderOutcome::stage, &number, sizeof number);
}

ReaderTask meshTask(MeshReader read) {
    return {"mesh", [](const ReaderRequest& request) { return defaultLimits(request.path, request.options); },
            [read = std::move(read)](const ReaderRequest& request, const IsolationLimits&,
                                     const Execution& execution) {
                MeshFile file = read(request.path, request.options, execution);
                file.readPeakBytes = peakMemoryBytes();
                return packMesh(std::move(file));
            }};
}

int serveReader(std::span<const std::string> arguments, std::span<const ReaderTask> tasks) {
    const std::int64_t parent = parseStart(arguments);
    if (::fcntl(kReportDescriptor, F_GETFD) < 0 || ::fcntl(kAnswerDescriptor, F_GET_SEALS) < 0)
        throw InputError("the reader of meshes is started by tessera itself");
    settleAsChild(parent);
    ::signal(SIGXFSZ, SIG_IGN);
    std::set_terminate(reportAndEnd);
    try {
        serve(parent, tasks);
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
