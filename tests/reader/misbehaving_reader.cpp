// The reading process of isolated_reader_test: its first word says how it goes wrong, the rest is what
// readMeshIsolated gives it.

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "reader/isolated_vdb.h"
#include "reader/reader_process.h"
#include "reader/reader_report.h"
#include "reader/serve_reader.h"
#include "tessera/error.h"

namespace {

using tessera::kAnswerDescriptor;
using tessera::kReportDescriptor;
using tessera::ReaderOutcome;
using tessera::ReportStart;

void put(int descriptor, const void* bytes, std::size_t count) {
    if (write(descriptor, bytes, count) != ssize_t(count)) _exit(99);
}

void claimMesh() {
    const ReportStart start{ReportStart::kMagic, ReaderOutcome::answerInMemory, 0};
    put(kReportDescriptor, &start, sizeof start);
}

[[noreturn]] void allocateForEver() {
    std::vector<std::unique_ptr<char[]>> blocks;
    while (true) {
        blocks.push_back(std::make_unique<char[]>(1 << 20));
        std::memset(blocks.back().get(), 1, 1 << 20);
    }
}

/// How many mebibytes there are to be had.
int countMebibytes() {
    std::vector<std::unique_ptr<char[]>> blocks;
    blocks.reserve(1 << 12);
    try {
        while (blocks.size() < blocks.capacity()) blocks.push_back(std::make_unique<char[]>(1 << 20));
    } catch (const std::bad_alloc&) {
    }
    return int(blocks.size());
}

/// Descriptors that are open beside the five a reader has.
std::string otherDescriptors() {
    std::string list;
    for (int d = kAnswerDescriptor + 1; d < 1024; ++d)
        if (fcntl(d, F_GETFD) >= 0) list += std::to_string(d) + " ";
    return list;
}

/// What happens in place of readMesh, by name.
const std::map<std::string, std::function<tessera::MeshFile(const std::string& path)>> kReaders{
    {"crash",
     [](const std::string&) -> tessera::MeshFile {
         raise(SIGSEGV);
         return {};
     }},
    {"abort", [](const std::string&) -> tessera::MeshFile { std::abort(); }},
    {"exit", [](const std::string&) -> tessera::MeshFile { _exit(7); }},
    {"hang",
     [](const std::string&) -> tessera::MeshFile {
         while (true) pause();
     }},
    {"spin",
     [](const std::string&) -> tessera::MeshFile {
         volatile unsigned turns = 0;
         while (true) turns = turns + 1;
     }},
    {"nap",
     [](const std::string& path) -> tessera::MeshFile {
         std::this_thread::sleep_for(std::chrono::milliseconds(800));
         throw tessera::InputError(path + ": awake");
     }},
    {"count-memory",
     [](const std::string&) -> tessera::MeshFile {
         throw tessera::InputError(std::to_string(countMebibytes()));
     }},
    {"allocate", [](const std::string&) -> tessera::MeshFile { allocateForEver(); }},
    {"throw-input",
     [](const std::string& path) -> tessera::MeshFile { throw tessera::InputError(path + ": so"); }},
    {"throw-io", [](const std::string&) -> tessera::MeshFile { throw tessera::IoError("disk gone"); }},
    {"throw-internal",
     [](const std::string&) -> tessera::MeshFile { throw tessera::InternalError("a bug"); }},
    {"throw-other", [](const std::string&) -> tessera::MeshFile { throw std::runtime_error("odd"); }},
    {"throw-number", [](const std::string&) -> tessera::MeshFile { throw 1; }},
    {"print",
     [](const std::string&) -> tessera::MeshFile {
         std::puts("to standard output");
         std::fputs("to standard error\n", stderr);
         throw tessera::InputError("printed");
     }},
    {"reach",
     [](const std::string& path) -> tessera::MeshFile {
         std::string reached;
         if (open((path + ".new").c_str(), O_WRONLY | O_CREAT, 0600) >= 0) reached += "a new file ";
         if (open(path.c_str(), O_WRONLY) >= 0) reached += "the mesh ";
         if (open("/etc/passwd", O_RDONLY) >= 0) reached += "another file ";
         if (socket(AF_INET, SOCK_STREAM, 0) >= 0) reached += "the network ";
         if (open(path.c_str(), O_RDONLY) < 0) reached += "not even the mesh ";
         if (rename(path.c_str(), (path + ".new").c_str()) == 0) reached += "the mesh's name ";
         if (kill(getppid(), 0) == 0) reached += "its parent ";
         if (fcntl(kReportDescriptor, F_SETOWN, getppid()) == 0) reached += "its parent by a signal ";
         if (prctl(PR_SET_PDEATHSIG, 0) == 0) reached += "a life of its own ";
         rlimit limit{};
         getrlimit(RLIMIT_AS, &limit);
         limit.rlim_max += 4096;
         if (setrlimit(RLIMIT_AS, &limit) == 0) reached += "more memory ";
         if (const pid_t child = fork(); child >= 0) {
             if (child == 0) _exit(0);
             reached += "a process of its own ";
         }
         execl("/bin/true", "true", nullptr);
         throw tessera::InputError(reached.empty() ? "nothing" : reached);
     }},
    {"descriptors",
     [](const std::string&) -> tessera::MeshFile {
         throw tessera::InputError("open: " + otherDescriptors());
     }},
};

/// What happens instead of serving at all, by name.
const std::map<std::string, std::function<void()>> kImpostors{
    {"silent", [] { _exit(0); }},
    {"noise", [] { put(kReportDescriptor, "this is not a report, is it?", 28); }},
    {"half-report", [] { put(kReportDescriptor, "Tss", 3); }},
    {"endless-message",
     [] {
         const ReportStart start{ReportStart::kMagic, ReaderOutcome::inputError, std::uint64_t(1) << 60};
         put(kReportDescriptor, &start, sizeof start);
         pause();
     }},
    {"no-mesh", [] { claimMesh(); }},
    {"noise-as-mesh",
     [] {
         const std::vector<char> noise(4096, '\x5a');
         put(kAnswerDescriptor, noise.data(), noise.size());
         claimMesh();
     }},
    {"writable-mesh",
     [] {
         if (ftruncate(kAnswerDescriptor, 4096) != 0) _exit(98);
         if (mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED, kAnswerDescriptor, 0) == MAP_FAILED)
             _exit(97);
         claimMesh();
         pause();
     }},
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) return 96;
    const std::string mode = argv[1];
    if (const auto impostor = kImpostors.find(mode); impostor != kImpostors.end()) {
        impostor->second();
        _exit(0);
    }
    const std::vector<std::string> words(argv + 2, argv + argc);
    // While it serves it can't write a file.
    if (const char* place = std::getenv("TESSERA_TEST_PID_FILE"); place && mode == "hang")
        std::ofstream(place) << getpid() << std::endl;
    const auto serve = [&](tessera::MeshReader read) {
        std::vector<tessera::ReaderTask> tasks = tessera::vdbTasks();
        tasks.push_back(tessera::meshTask(std::move(read)));
        _exit(tessera::serveReader(words, tasks));
    };
    if (mode == "read") serve(tessera::readMesh);
    if (mode == "threads")
        serve([](const std::string&, const tessera::ReadOptions&,
                 const tessera::Execution& execution) -> tessera::MeshFile {
            throw tessera::InputError(std::to_string(execution.threads));
        });
    const auto reader = kReaders.find(mode);
    if (reader == kReaders.end()) return 95;
    serve([&](const std::string& path, const tessera::ReadOptions&, const tessera::Execution&) {
        return reader->second(path);
    });
}
