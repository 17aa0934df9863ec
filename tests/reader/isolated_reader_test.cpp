#include "reader/isolated_reader.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/sanitizers.h"
#include "files/input_file.h"
#include "mesh_test_tools.h"
#include "reader/confine.h"
#include "reader/mesh_packet.h"
#include "reader/reader_limits.h"
#include "reader/reader_report.h"
#include "reader/serve_reader.h"
#include "tessera/error.h"
#include "vtu_text.h"

namespace tessera {
namespace {

using test::TemporaryFolder;
using test::VtuText;

constexpr IsolationLimits kAmple{std::int64_t(1) << 30, 60};

IsolatedReader childThat(const std::string& mode) {
    return {TESSERA_MISBEHAVING_READER, {mode}};
}

/// The program for common formats first; the other one goes wrong when it is told to.
IsolatedReader quickReader(const std::string& modeOfTheOther) {
    return {TESSERA_MISBEHAVING_READER, {modeOfTheOther}, TESSERA_QUICK_READER};
}

VtuText twoTets() {
    VtuText vtu;
    vtu.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}};
    vtu.cells = {{10, {0, 1, 2, 3}}, {10, {1, 2, 3, 4}}};
    vtu.pointArrays.push_back({"f", "Float64", 1, "1 2 3 4 nan"});
    vtu.cellArrays.push_back({"f", "Int32", 1, "7 8"});
    return vtu;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
}

std::size_t openDescriptors() {
    return std::size_t(std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}));
}

/// Whether a process is there and not a zombie.
bool isAlive(pid_t process) {
    std::ifstream file("/proc/" + std::to_string(process) + "/stat");
    std::string text;
    std::getline(file, text);
    const std::size_t name = text.rfind(')');
    return name != std::string::npos && name + 2 < text.size() && text[name + 2] != 'Z';
}

void expectEqual(const MeshFile& a, const MeshFile& b) {
    const auto sameBytes = [](const auto& x, const auto& y) {
        return x.size() == y.size() &&
               (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof x[0]) == 0);
    };
    EXPECT_TRUE(sameBytes(a.mesh.points, b.mesh.points));
    EXPECT_TRUE(sameBytes(a.mesh.tets, b.mesh.tets));
    ASSERT_EQ(a.mesh.fields.size(), b.mesh.fields.size());
    for (std::size_t f = 0; f < a.mesh.fields.size(); ++f) {
        EXPECT_EQ(a.mesh.fields[f].name, b.mesh.fields[f].name);
        EXPECT_EQ(a.mesh.fields[f].location, b.mesh.fields[f].location);
        EXPECT_EQ(a.mesh.fields[f].components, b.mesh.fields[f].components);
        EXPECT_TRUE(sameBytes(a.mesh.fields[f].values, b.mesh.fields[f].values));
    }
    const ImportStatistics &s = a.statistics, &t = b.statistics;
    EXPECT_EQ(s.format, t.format);
    EXPECT_EQ(s.warnings, t.warnings);
    const auto numbers = [](const ImportStatistics& i) {
        return std::vector<double>{double(i.cells),         double(i.skippedCells),
                                   double(i.blankedCells),  double(i.higherOrderCells),
                                   double(i.blocks),        double(i.addedNodes),
                                   double(i.nodes),         double(i.elements),
                                   double(i.flat),          double(i.inverted),
                                   double(i.duplicate),     double(i.coincidentNodes),
                                   double(i.boundaryFaces), double(i.nonConformingFaces),
                                   i.smallestEdgeWorld,     i.largestEdgeWorld,
                                   i.smallestVolumeWorld,   i.largestVolumeWorld};
    };
    EXPECT_EQ(numbers(s), numbers(t));
}

/// A mesh file that exists; what becomes of it is the child's affair. Afterwards nothing may be left over.
class IsolatedReaderTest : public testing::Test {
  protected:
    void SetUp() override {
        descriptors_ = openDescriptors();
        ::setenv("TESSERA_TEST_PID_FILE", (path_ + ".pid").c_str(), 1);
    }
    void TearDown() override {
        EXPECT_EQ(openDescriptors(), descriptors_);
        EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1) << "a child is left";
        EXPECT_EQ(errno, ECHILD);
    }

    template <class Error>
    std::string messageOf(const std::string& mode, const IsolationLimits& limits = kAmple) {
        try {
            readMeshIsolated(childThat(mode), path_, {}, limits, {});
        } catch (const Error& error) {
            return error.what();
        } catch (const std::exception& error) {
            return std::string("(of another type) ") + error.what();
        }
        return "(it was read)";
    }
    std::string refusal(const std::string& mode, const IsolationLimits& limits = kAmple) {
        const std::string message = messageOf<InputError>(mode, limits);
        EXPECT_TRUE(message.starts_with(path_ + ": ")) << message;
        EXPECT_EQ(message.find('\n'), std::string::npos) << message;
        return message;
    }
    static bool has(const std::string& message, const std::string& words) {
        return message.find(words) != std::string::npos;
    }

    TemporaryFolder folder_;
    std::string path_ = folder_.write("mesh.vtu", twoTets().text());

  private:
    std::size_t descriptors_ = 0;
};

TEST_F(IsolatedReaderTest, ACrashNamesTheSignal) {
    EXPECT_PRED2(has, refusal("crash"), "crashed (signal 11");
    EXPECT_PRED2(has, refusal("abort"), "crashed (signal 6");
    EXPECT_PRED2(has, refusal("throw-number"), "crashed (signal 6");
}

TEST_F(IsolatedReaderTest, AnEndWithoutAResultNamesTheExitCode) {
    EXPECT_PRED2(has, refusal("exit"), "without a result (exit code 7)");
    EXPECT_PRED2(has, refusal("silent"), "without a result (exit code 0)");
    EXPECT_PRED2(has, refusal("half-report"), "without a result (exit code 0)");
}

TEST_F(IsolatedReaderTest, AHangEndsAtTheTimeLimit) {
    EXPECT_PRED2(has, refusal("hang", {kAmple.memoryBytes, 0.5}), "more than 0.5 s");
}

TEST_F(IsolatedReaderTest, TheLimitOnProcessorTimeLetsTheReaderWait) {
    const IsolationLimits limits{kAmple.memoryBytes, 60, 0.4};
    EXPECT_PRED2(has, refusal("spin", limits), "more than 0.4 s of processor time");
    EXPECT_EQ(refusal("nap", limits), path_ + ": awake");
}

TEST_F(IsolatedReaderTest, ALimitOnTimeThatIsGivenIsTheOnlyOne) {
    EXPECT_PRED2(has, refusal("spin", {kAmple.memoryBytes, 0.5}),
                 "more than 0.5 s, the limit given; for a file like this it would be 3 s of processor time");
    EXPECT_PRED2(has, refusal("nap", {kAmple.memoryBytes, 0.3}), "more than 0.3 s, the limit given");
}

TEST_F(IsolatedReaderTest, ThreadsAreWithinTheMemoryLimit) {
    const auto tell = [&](const std::string& mode, std::int64_t mebibytes, int threads) {
        Execution execution;
        execution.threads = threads;
        try {
            readMeshIsolated(childThat(mode), path_, {}, {mebibytes << 20, 60}, execution);
        } catch (const InputError& told) {
            return std::stoi(told.what());
        }
        return -1;
    };
    EXPECT_EQ(tell("threads", 1024, 3), 3);
    EXPECT_EQ(tell("threads", 40, 64), 1);
    EXPECT_LE(tell("threads", 1024, 64) * 9 * 8, 1024);
    if (kIsAddressSanitized) return;
    for (const int threads : {1, 64}) {
        EXPECT_LE(tell("count-memory", 200, threads), 200);
        EXPECT_GE(tell("count-memory", 200, threads), 3 * readingShare(200 << 20) / 4 >> 20);
    }
}

TEST_F(IsolatedReaderTest, EndlessAllocationEndsAtTheMemoryLimit) {
    if (kIsAddressSanitized)
        GTEST_SKIP() << "the address sanitizer's own address space leaves no room for a limit";
    EXPECT_PRED2(has, refusal("allocate", {200 << 20, 60}), "more than 200 MiB");
}

TEST_F(IsolatedReaderTest, MemoryThatTheParentMayNotUseIsABadAllocation) {
    if (kIsAddressSanitized)
        GTEST_SKIP() << "the address sanitizer's own address space leaves no room for a limit";
    rlimit before{};
    getrlimit(RLIMIT_AS, &before);
    const rlimit tight{rlim_t(2) << 30, before.rlim_max};
    setrlimit(RLIMIT_AS, &tight);
    EXPECT_THROW(readMeshIsolated(childThat("allocate"), path_, {}, {std::int64_t(8) << 30, 60}, {}),
                 std::bad_alloc);
    setrlimit(RLIMIT_AS, &before);
}

TEST_F(IsolatedReaderTest, GarbageIsNotBelieved) {
    for (const char* mode : {"noise", "endless-message", "no-mesh", "noise-as-mesh", "writable-mesh"}) {
        SCOPED_TRACE(mode);
        EXPECT_PRED2(has, refusal(mode), "no sound mesh");
    }
}

TEST_F(IsolatedReaderTest, ErrorsKeepTheirTypeAndWords) {
    EXPECT_EQ(messageOf<InputError>("throw-input"), path_ + ": so");
    EXPECT_EQ(messageOf<IoError>("throw-io"), "disk gone");
    EXPECT_EQ(messageOf<InternalError>("throw-internal"), "a bug");
    EXPECT_EQ(messageOf<std::runtime_error>("throw-other"), "odd");
}

TEST_F(IsolatedReaderTest, ErrorsOfTheReadersAreThoseInProcess) {
    VtuText damaged = twoTets();
    damaged.cells[1].nodes[2] = 99;
    VtuText flat = twoTets();
    flat.cells = {{5, {0, 1, 2}}};
    const std::vector<std::pair<std::string, ReadOptions>> cases{
        {folder_.write("index.vtu", damaged.text()), {}},
        {folder_.write("flat.vtu", flat.text()), {}},
        {folder_.write("cut.vtu", twoTets().text().substr(0, 700)), {}},
        {folder_.write("noise.vtk", "noise"), {}},
        {folder_.write("mesh.xyz", "1 2 3"), {}},
        {folder_.write("lone.node", "1 3 0 0\n0 0 0 0\n"), {}},
        {folder_.file("absent.vtu"), {}},
        {path_, {{"speed"}, -1}},
        {path_, {{}, 4}}};
    for (const auto& [path, options] : cases) {
        std::string inProcess, isolated = "(it was read)";
        try {
            readMesh(path, options, {});
        } catch (const InputError& error) {
            inProcess = error.what();
        }
        try {
            readMeshIsolated(childThat("read"), path, options, {}, {});
        } catch (const InputError& error) {
            isolated = error.what();
        }
        EXPECT_EQ(isolated, inProcess);
    }
}

TEST_F(IsolatedReaderTest, TheMeshIsThatInProcessBitForBit) {
    const std::string tets = twoTets().text();
    folder_.write("t.node", "4 3 1 0\n1 0 0 0 5\n2 1 0 0 6\n3 0 1 0 7\n4 0 0 1 8\n");
    folder_.write("t.ele", "1 4 0\n1 1 2 3 4\n");
    std::vector<std::string> paths{
        path_,
        folder_.file("t.ele"),
        folder_.write(
            "grid.vtk",
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nORIGIN 0 0 "
            "0\nSPACING 1 1 1\nPOINT_DATA 12\nSCALARS s float 1\nLOOKUP_TABLE default\n1 2 3 4 5 6 7 8 9 10 "
            "11 12\n"),
        TESSERA_DATA_DIR "/ccx-cavity/cavity.vtu",
        TESSERA_DATA_DIR "/disk_out_ref/disk_out_ref.vtu",
        TESSERA_DATA_DIR "/dolfinx-fichera-p3/fichera_p3.vtu",
        TESSERA_DATA_DIR "/freefem-stokes-sphere/stokes_p1.vtu"};
    for (const std::string& path : paths) {
        SCOPED_TRACE(path);
        const MeshFile inProcess = readMesh(path, {}, {});
        expectEqual(readMeshIsolated(childThat("read"), path, {}, {}, {}), inProcess);
        expectEqual(readMeshIsolated(quickReader("crash"), path, {}, {}, {}), inProcess);
    }
    expectEqual(readMeshIsolated(childThat("read"), path_, {{"f"}, -1}, {}, {}),
                readMesh(path_, {{"f"}, -1}, {}));
}

TEST_F(IsolatedReaderTest, OtherFormatsAreTheSameToo) {
    const std::filesystem::path shared(TESSERA_SHARED_DATA_DIR);
    if (!std::filesystem::exists(shared)) GTEST_SKIP() << "no further meshes beside the project";
    int formats = 0;
    for (const char* extension : {".ex2", ".cgns", ".case", ".foam", ".pvtu", ".vts", ".vtm"}) {
        for (const auto& entry : std::filesystem::recursive_directory_iterator(shared)) {
            if (entry.path().extension() != extension || entry.is_directory()) continue;
            SCOPED_TRACE(entry.path());
            MeshFile inProcess;
            try {
                inProcess = readMesh(entry.path(), {}, {});
            } catch (const InputError&) {
                continue;
            }
            expectEqual(readMeshIsolated(childThat("read"), entry.path(), {}, {}, {}), inProcess);
            expectEqual(readMeshIsolated(quickReader("read"), entry.path(), {}, {}, {}), inProcess);
            ++formats;
            break;
        }
    }
    EXPECT_GT(formats, 0);
}

TEST_F(IsolatedReaderTest, TheQuickProgramLeavesOtherFormatsToTheOther) {
    const std::string path = folder_.write("run.case", "FORMAT\ntype: ensight gold\n");
    EXPECT_THROW(readCommonMesh(path, {}, {}), OtherFormatError);
    const auto refusalBy = [&](const std::string& mode) -> std::string {
        try {
            readMeshIsolated(quickReader(mode), path, {}, {}, {});
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_PRED2(has, refusalBy("crash"), "crashed (signal 11");
    EXPECT_PRED2(has, refusalBy("read"), "run.case");
    EXPECT_FALSE(has(refusalBy("read"), "only VTK XML"));
}

TEST_F(IsolatedReaderTest, AQuickProgramThatCantBeUsedIsLeftOut) {
    const MeshFile inProcess = readMesh(path_, {}, {});
    const std::string script = folder_.write("script", "#!/nowhere/sh\n");
    std::filesystem::permissions(script, std::filesystem::perms::owner_all);
    for (const std::string& useless :
         {script, path_, folder_.file("nothing"), std::string("/bin/true"), std::string("/bin/false")}) {
        SCOPED_TRACE(useless);
        expectEqual(readMeshIsolated({TESSERA_MISBEHAVING_READER, {"read"}, useless}, path_, {}, {}, {}),
                    inProcess);
    }
}

TEST_F(IsolatedReaderTest, ARequestOfAnotherVersionIsRefused) {
    std::vector<std::string> words = requestWords({1, 2, 3, "mesh.vtu", {}});
    words[0] += "0";
    EXPECT_THROW(parseRequest(words), InputError);
    words = startWords(1);
    EXPECT_EQ(parseStart(words), 1);
    words[0] += "0";
    EXPECT_THROW(parseStart(words), InputError);
}

TEST_F(IsolatedReaderTest, AQuickProgramIsFoundBesideTessera) {
    const auto place = std::filesystem::path(TESSERA_QUICK_READER).parent_path();
    EXPECT_EQ(quickReaderBeside(place / "nothing"), "");
    EXPECT_EQ(quickReaderBeside(TESSERA_QUICK_READER), std::filesystem::canonical(TESSERA_QUICK_READER));
}

TEST_F(IsolatedReaderTest, ALimitOnFileSizesLeavesThePipe) {
    rlimit before{};
    getrlimit(RLIMIT_FSIZE, &before);
    const std::string path = TESSERA_DATA_DIR "/freefem-stokes-sphere/stokes_p1.vtu";
    const MeshFile inProcess = readMesh(path, {}, {});
    const rlimit small{1000, before.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    const MeshFile isolated = readMeshIsolated(childThat("read"), path, {}, {}, {});
    setrlimit(RLIMIT_FSIZE, &before);
    expectEqual(isolated, inProcess);
}

TEST_F(IsolatedReaderTest, WhatTheReaderPrintsGoesNowhere) {
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const std::string message = messageOf<InputError>("print");
    EXPECT_EQ(testing::internal::GetCapturedStdout() + testing::internal::GetCapturedStderr(), "");
    EXPECT_EQ(message, "printed");
}

TEST_F(IsolatedReaderTest, TheChildInheritsNoDescriptor) {
    const int file = ::open("/dev/null", O_RDONLY);  // without O_CLOEXEC
    const int far = ::fcntl(file, F_DUPFD, 700);
    EXPECT_EQ(messageOf<InputError>("descriptors"), "open:");
    ::close(far);
    ::close(file);
}

TEST_F(IsolatedReaderTest, CancellingKillsTheChild) {
    std::atomic<bool> cancel{false};
    Execution execution;
    execution.cancel = &cancel;
    std::thread canceller([&] {
        while (!std::filesystem::exists(path_ + ".pid")) std::this_thread::yield();
        cancel = true;
    });
    EXPECT_THROW(readMeshIsolated(childThat("hang"), path_, {}, kAmple, execution), Cancelled);
    canceller.join();
    execution.cancel = &cancel;
    EXPECT_THROW(readMeshIsolated(childThat("read"), path_, {}, kAmple, execution), Cancelled);
}

TEST_F(IsolatedReaderTest, TheChildDiesWithItsParent) {
    const pid_t parent = ::fork();
    if (parent == 0) {
        try {
            readMeshIsolated(childThat("hang"), path_, {}, kAmple, {});
        } catch (...) {
        }
        _exit(0);
    }
    pid_t child = 0;
    for (int wait = 0; child == 0 && wait < 3000; ++wait) {
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
        std::ifstream(path_ + ".pid") >> child;
    }
    ASSERT_GT(child, 0);
    EXPECT_TRUE(isAlive(child));
    ::kill(parent, SIGKILL);
    ::waitpid(parent, nullptr, 0);
    for (int wait = 0; isAlive(child) && wait < 3000; ++wait)
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    EXPECT_FALSE(isAlive(child));
}

TEST_F(IsolatedReaderTest, TheTerminalsSignalsDoNotReachTheChild) {
    std::atomic<bool> cancel{false};
    Execution execution;
    execution.cancel = &cancel;
    std::thread canceller([&] {
        pid_t child = 0;
        while (child == 0) std::ifstream(path_ + ".pid") >> child;
        for (const int number : {SIGINT, SIGTERM, SIGHUP}) ::kill(child, number);
        std::this_thread::sleep_for(std::chrono::milliseconds(200));
        EXPECT_TRUE(isAlive(child));
        cancel = true;
    });
    EXPECT_THROW(readMeshIsolated(childThat("hang"), path_, {}, kAmple, execution), Cancelled);
    canceller.join();
}

TEST_F(IsolatedReaderTest, WhatAFileMayNotReadIsRefused) {
    folder_.write("other.txt", "secret");
    std::filesystem::create_directory(folder_.file("in"));
    const auto naming = [&](const std::string& name) {
        return folder_.write(
            "in/all.pvtu", "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><Piece Source=\"" + name +
                               "\"/></PUnstructuredGrid></VTKFile>");
    };
    const auto message = [&](const std::string& path, const ReadOptions& options) -> std::string {
        try {
            readMeshIsolated(childThat("read"), path, options, {}, {});
        } catch (const InputError& error) {
            return error.what();
        }
        return "(it was read)";
    };
    EXPECT_PRED2(has, message(naming("../mesh.vtu"), {}), "lies outside the folder");
    ReadOptions follow;
    follow.followsLinks = true;
    EXPECT_FALSE(has(message(naming("../mesh.vtu"), follow), "outside"));
    EXPECT_FALSE(has(message(naming("../other.txt"), follow), "secret"));
    std::filesystem::create_symlink(path_, folder_.file("in/link.vtu"));
    EXPECT_PRED2(has, message(naming("link.vtu"), {}), "lies outside the folder");
    folder_.write("geo", "secret");
    const std::string pattern =
        folder_.write("in/a.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: ../ge*\n");
    EXPECT_PRED2(has, message(pattern, {}), "lies outside the folder");
}

TEST_F(IsolatedReaderTest, AProcessThatReadsCanNeitherWriteNorReachOthers) {
    const Confinement kept = availableConfinement();
    if (!kept.files || !kept.calls) GTEST_SKIP() << "this system has no Landlock or no seccomp";
    EXPECT_EQ(messageOf<InputError>("reach"), "nothing");
}

TEST_F(IsolatedReaderTest, AnAbsentProgramIsAFailureOfTheEnvironment) {
    EXPECT_THROW(readMeshIsolated({folder_.file("nothing"), {}}, path_, {}, {}, {}), IoError);
    EXPECT_THROW(readMeshIsolated({path_, {}}, path_, {}, {}, {}), IoError);
}

TEST_F(IsolatedReaderTest, SeveralThreadsReadAtOnce) {
    const MeshFile inProcess = readMesh(path_, {}, {});
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back(
            [&] { expectEqual(readMeshIsolated(childThat("read"), path_, {}, {}, {}), inProcess); });
    for (std::thread& thread : threads) thread.join();
}

TEST(ServeMeshReader, RefusesToRunWithoutItsParent) {
    EXPECT_THROW(serveReader(std::vector<std::string>{}, {}), InputError);
    EXPECT_THROW(serveReader(std::vector<std::string>{"1", "2", "x", "-1", "mesh.vtu"}, {}), InputError);
}

TEST(ReaderRequest, SurvivesItsWords) {
    const ReaderRequest request{42, 1 << 30, 3, "a mesh.vtu", {{"p", "a b", ""}, 7}, "task", "body"};
    const ReaderRequest copy = parseRequest(requestWords(request));
    EXPECT_EQ(copy.parent, 42);
    EXPECT_EQ(copy.memoryBytes, 1 << 30);
    EXPECT_EQ(copy.threads, 3);
    EXPECT_EQ(copy.path, "a mesh.vtu");
    EXPECT_EQ(copy.options.fields, request.options.fields);
    EXPECT_EQ(copy.options.timeStep, 7);
    EXPECT_EQ(copy.task, "task");
    EXPECT_EQ(copy.body, "body");
}

TEST(DefaultLimits, GrowWithTheFilesAndStaySmallForSmallOnes) {
    const TemporaryFolder folder;
    const std::string small = folder.write("small.vtu", twoTets().text());
    const IsolationLimits limits = defaultLimits(small);
    EXPECT_LT(limits.memoryBytes, std::int64_t(1) << 30);
    EXPECT_LT(limits.processorSeconds, 8);
    EXPECT_NEAR(limits.seconds, 60, 0.1);
    folder.write("piece.node", std::string(1 << 20, ' '));
    folder.write("piece.ele", std::string(3 << 20, ' '));
    const IsolationLimits pair = defaultLimits(folder.file("piece.ele"));
    EXPECT_NEAR(double(pair.memoryBytes) / (1 << 20), 640 + 96 * 4, 0.01);
    EXPECT_NEAR(pair.processorSeconds, 3 + (4 << 20) * 0.25e-6, 1e-9);
    EXPECT_NEAR(pair.seconds, std::max(60.0, 10 * pair.processorSeconds), 1e-9);
    EXPECT_THROW(defaultLimits(folder.file("absent.vtu")), InputError);
}

TEST(DefaultLimits, CountAFileOnceHoweverOftenItIsNamed) {
    const TemporaryFolder folder;
    folder.write("piece.vtu", replaced(twoTets().text(), "</VTKFile>",
                                       "<!--" + std::string(1 << 20, ' ') + "--></VTKFile>"));
    const auto naming = [&](int times) {
        std::string pieces;
        for (int i = 0; i < times; ++i) pieces += "<Piece Source=\"piece.vtu\"/>";
        return folder.write("all.pvtu", "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid>" + pieces +
                                            "</PUnstructuredGrid></VTKFile>");
    };
    const IsolationLimits once = defaultLimits(naming(1)), often = defaultLimits(naming(2000));
    EXPECT_GT(once.memoryBytes, (640 + 96) << 20);
    EXPECT_LT(often.memoryBytes, once.memoryBytes + (8 << 20));
}

TEST(DefaultLimits, AFileThatIsCutOffMeanwhileIsAnError) {
    const TemporaryFolder folder;
    const std::string text =
        replaced(twoTets().text(), "</VTKFile>", "<!--" + std::string(4 << 20, '-') + "--></VTKFile>");
    const std::string path = folder.write("mesh.vtu", text);
    std::filesystem::resize_file(path,
                                 100);  // from now on zeros follow, and it is damaged whenever it is read
    std::atomic<bool> end{false};
    std::thread cutter([&] {
        while (!end) {
            std::filesystem::resize_file(path, 100);
            std::filesystem::resize_file(path, text.size());
        }
    });
    for (int i = 0; i < 300; ++i) EXPECT_THROW(defaultLimits(path), InputError);
    end = true;
    cutter.join();
}

TEST(DefaultLimits, PipesAndDevicesAreRefusedAtOnce) {
    const TemporaryFolder folder;
    ASSERT_EQ(::mkfifo(folder.file("pipe").c_str(), 0600), 0);
    const auto refuse = [](const std::string& path) {
        std::string message = "(it was taken)";
        try {
            defaultLimits(path);
        } catch (const InputError& error) {
            message = error.what();
        }
        EXPECT_NE(message.find("isn't a regular file"), std::string::npos) << message;
    };
    const std::string head = "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: ";
    refuse(folder.file("pipe"));
    refuse(folder.write("a.case", head + "pipe\n"));
    refuse(folder.write("b.case", head + "1 pip*\n"));
    refuse(folder.write("c.case", head + "/dev/zero\r\n"));
    refuse(folder.write("d.pvtu",
                        "<VTKFile type=\"PUnstructuredGrid\"><PUnstructuredGrid><Piece Source=\"pipe\"/>"
                        "</PUnstructuredGrid></VTKFile>"));
    folder.write("mesh.geo", "x");
    EXPECT_NO_THROW(defaultLimits(folder.write("e.case", head + "mesh.geo\n")));
}

TEST(InputFile, FindsWhatATextFinds) {
    const TemporaryFolder folder;
    std::string text;
    for (int i = 0; i < 90000; ++i) text += std::to_string(i) + (i % 7 == 0 ? " <" : ">>");
    InputFile file(folder.write("text", text));
    ASSERT_EQ(file.size(), text.size());
    for (std::size_t from = 0; from < text.size(); from += 1777) {
        for (const std::string word : {"8888>>", "<", "89999", "absent"})
            EXPECT_EQ(file.find(word, from), text.find(word, from));
        EXPECT_EQ(file.findFirstOf("< ", from), text.find_first_of("< ", from));
        EXPECT_EQ(file.findFirstNotOf("<>0123456789", from), text.find_first_not_of("<>0123456789", from));
        EXPECT_EQ(file.bytesFrom(from, 10).substr(0, 10), text.substr(from, 10));
        EXPECT_EQ(file.copy(from, 300000), text.substr(from, 300000));
    }
    for (const std::string word : {"0 <", ">>1", "100>>", "absent"})
        EXPECT_EQ(file.rfind(word), text.rfind(word));
    std::filesystem::resize_file(file.path(), 400000);
    EXPECT_THROW(file.find("absent", 0), InputError);
    EXPECT_THROW(file.rfind("absent"), InputError);
    EXPECT_EQ(file.bytesFrom(5, 10).substr(0, 10), text.substr(5, 10));
    EXPECT_THROW(file.copy(0, text.size()), InputError);
    EXPECT_THROW(readWholeFile(folder.file("absent")), InputError);
}

TEST(MeshPacket, EveryDamagedByteIsRefusedOrHarmless) {
    const TemporaryFolder folder;
    const MeshFile file = readMesh(folder.write("mesh.vtu", twoTets().text()), {}, {});
    std::vector<std::byte> packet;
    packMesh(file).writeTo([&](const void* bytes, std::size_t count) {
        const auto* first = static_cast<const std::byte*>(bytes);
        packet.insert(packet.end(), first, first + count);
    });
    ASSERT_EQ(std::int64_t(packet.size()), packMesh(file).bytes());
    expectEqual(unpackMesh(packet, {}), file);
    for (std::size_t size = 0; size < packet.size(); ++size)
        EXPECT_THROW(unpackMesh(std::span(packet).first(size), {}), DamagedPacket);
    int refused = 0;
    for (std::size_t at = 0; at < packet.size(); ++at) {
        for (const int bit : {0, 3, 7}) {
            std::vector<std::byte> damaged = packet;
            damaged[at] ^= std::byte(1 << bit);
            try {
                const MeshFile read = unpackMesh(damaged, {});
                EXPECT_NO_THROW(checkMesh(read.mesh));
            } catch (const DamagedPacket&) {
                ++refused;
            }
        }
    }
    EXPECT_GT(refused, 100);
}

TEST(MeshPacket, WildIndicesAndCoordinatesAreRefused) {
    const TemporaryFolder folder;
    const MeshFile file = readMesh(folder.write("mesh.vtu", twoTets().text()), {}, {});
    const auto packetOf = [](MeshFile changed) {
        std::vector<std::byte> packet;
        packMesh(std::move(changed)).writeTo([&](const void* bytes, std::size_t count) {
            const auto* first = static_cast<const std::byte*>(bytes);
            packet.insert(packet.end(), first, first + count);
        });
        return packet;
    };
    MeshFile infinite = file;
    infinite.mesh.points[1].y = INFINITY;
    EXPECT_THROW(unpackMesh(packetOf(infinite), {}), DamagedPacket);
    std::vector<std::byte> packet = packetOf(file);
    const auto first = packet.size() - 7 * sizeof(double) - 2 * 4 * sizeof(std::int32_t);
    for (const std::int32_t node : {5, -1, 2147483647}) {
        std::memcpy(packet.data() + first, &node, sizeof node);
        EXPECT_THROW(unpackMesh(packet, {}), DamagedPacket);
    }
}

}  // namespace
}  // namespace tessera
