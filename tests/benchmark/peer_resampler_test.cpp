#include "benchmark/peer_resampler.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "base/timer.h"
#include "compare/sampling_grid.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "refine/refine.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"
#include "tessera/lattice.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// A peer that knows the mesh's field without reading it: "linear" in the unit box. Its behaviour is its
/// first word.
constexpr const char* kFakePeer = R"(
import array, json, sys, time
behaviour, mesh = sys.argv[1:]
print("reading", file=sys.stderr, flush=True)
if behaviour == "dies at start": print("no licence", file=sys.stderr); sys.exit(7)
if behaviour == "is silent": time.sleep(60)
if behaviour == "leaves": print('{"peer": "Fake 1.0"}', flush=True); sys.exit(0)
print("hello" if behaviour == "greets" else '{"peer": "Fake 1.0"}', flush=True)
for line in sys.stdin:
    request = json.loads(line)
    with open(mesh + ".requests", "a") as log: log.write(line)
    if behaviour == "dies later": print("out of memory", file=sys.stderr); sys.exit(3)
    if behaviour == "hangs": time.sleep(60)
    if behaviour == "wants volumes" and 1 in request["points"]:
        open(request["samples"], "w").write("?")
        print('{"error": "a layer"}', flush=True)
        continue
    values = array.array("f")
    o, s, n = request["origin"], request["spacing"], request["points"]
    for k in range(n[2]):
        for j in range(n[1]):
            for i in range(n[0]):
                p = [o[a] + (i, j, k)[a] * s[a] for a in range(3)]
                inside = all(0 <= x <= 1 for x in p)
                values.append(1 + 2 * p[0] - 3 * p[1] + p[2] / 2 if inside else float("nan"))
    if behaviour == "stops early": values.pop()
    if behaviour != "writes nothing":
        with open(request["samples"], "wb") as file: values.tofile(file)
    print({"talks nonsense": "42 ms", "gives an error": '{"error": "no such field"}', "boasts": '{"ms": -1}',
           "counts too much": '{"ms": 1e6}', "says no time": "{}", "chats": '{"ms": 0}\nanything else?',
           "never ends its line": "x" * 100000}.get(behaviour, '{"ms": 0.25}'), flush=True)
)";

double linear(const Vec3d& p) {
    return 1 + 2 * p.x - 3 * p.y + p.z / 2;
}

bool isInUnitBox(const Vec3d& p) {
    return glm::all(glm::greaterThanEqual(p, Vec3d(0))) && glm::all(glm::lessThanEqual(p, Vec3d(1)));
}

TetMesh unitBox(int cells) {
    TetMesh mesh = boxMesh({.cells = Vec3i(cells), .jitter = 0.1});
    addPointField(mesh, "linear", {linear});
    return mesh;
}

/// No point of it lies on the unit box's surface.
const Lattice kAround = Lattice::axisParallel(Vec3d(-0.23, -0.17, -0.11), 0.1);
const IndexBox kAroundPoints{Vec3i(0), Vec3i(15, 14, 13)};

/// Peers live in the test's own folder, which is where temporary folders go.
class PeerTest : public testing::Test {
  protected:
    void SetUp() override {
        std::string pattern = (fs::temp_directory_path() / "tessera_peer_test_XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        folder_ = pattern;
        script_ = folder_ / "peer.py";
        std::ofstream(script_) << kFakePeer;
        temporary_ = folder_ / "temporary";
        fs::create_directory(temporary_);
        if (const char* before = std::getenv("TMPDIR")) before_ = before;
        setenv("TMPDIR", temporary_.c_str(), 1);
    }
    void TearDown() override {
        EXPECT_TRUE(fs::is_empty(temporary_)) << "left behind: " << *fs::directory_iterator(temporary_);
        if (before_.empty())
            unsetenv("TMPDIR");
        else
            setenv("TMPDIR", before_.c_str(), 1);
        fs::remove_all(folder_);
    }

    PeerCommand fake(const std::string& behaviour, double timeoutMs = 20e3) const {
        return {"fake", "python3 -S '" + script_.string() + "' '" + behaviour + "'", timeoutMs};
    }
    /// The message with which sampling a unit box fails.
    std::string failure(const PeerCommand& command, const Execution& execution = {}) const {
        const TetMesh mesh = unitBox(1);
        const auto peer = makePeer(command);
        try {
            const auto bound = peer->bind(mesh, everyField(mesh));
            const auto sample = [&] {
                bound->resample(
                    kAround, std::span(&kAroundPoints, 1), [](std::size_t, const Block&) {}, execution);
            };
            sample();
            sample();
        } catch (const IoError& error) {
            return error.what();
        }
        return "nothing failed";
    }

    fs::path folder_, script_, temporary_;
    std::string before_;
};

/// Largest difference of a channel from a function where the point is in the unit box; infinite when the
/// block doesn't cover just these points.
double largestError(const Block& block, int channel, const PlaceFunction& function) {
    double largest = 0;
    Vec3i p;
    for (p.z = block.box.min.z; p.z < block.box.max.z; ++p.z)
        for (p.y = block.box.min.y; p.y < block.box.max.y; ++p.y)
            for (p.x = block.box.min.x; p.x < block.box.max.x; ++p.x) {
                const Vec3d place = block.lattice.worldFromIndex(Vec3d(p));
                if (block.covered(p) != isInUnitBox(place)) return INFINITY;
                if (block.covered(p))
                    largest = std::max(largest, std::fabs(block.value(channel, p) - function(place)));
            }
    return largest;
}

/// A linear field, a vector and a field of the cells, under two names that are the same.
void expectRightSamples(const PeerCommand& command, const std::string& title) {
    TetMesh mesh = unitBox(3);
    addPointField(mesh, "vector",
                  {[](const Vec3d& p) { return p.x; }, [](const Vec3d& p) { return p.y; },
                   [](const Vec3d& p) { return p.z; }});
    addCellField(mesh, "linear", {[](const Vec3d&) { return 5.0; }});
    const std::vector<int> fields{1, 0, 2};
    const auto bound = makePeer(command)->bind(mesh, fields);
    EXPECT_NE(bound->target().find(title), std::string::npos) << bound->target();
    const std::vector<IndexBox> boxes{kAroundPoints, {Vec3i(4), Vec3i(5, 9, 6)}, {Vec3i(3), Vec3i(3, 8, 8)}};
    std::vector<Block> blocks(boxes.size());
    const ResampleStatistics statistics = bound->resample(
        kAround, boxes, [&](std::size_t b, const Block& block) { blocks[b] = block; }, {.threads = 2});
    EXPECT_EQ(statistics.count(kPeerRequests), 1);
    EXPECT_GT(statistics.ms(stage::sample), 0);
    EXPECT_GT(statistics.ms(kTransferStage), 0);
    for (std::size_t b = 0; b < boxes.size(); ++b) {
        ASSERT_EQ(blocks[b].box, boxes[b]);
        ASSERT_EQ(blocks[b].channels, 5);
        for (int axis = 0; axis < 3; ++axis)
            EXPECT_LT(largestError(blocks[b], axis, [&](const Vec3d& p) { return p[axis]; }), 1e-6);
        EXPECT_LT(largestError(blocks[b], 3, linear), 1e-5);
        EXPECT_EQ(largestError(blocks[b], 4, [](const Vec3d&) { return 5.0; }), 0);
    }
}

PeerCommand builtVtkPeer() {
#ifdef TESSERA_PROGRAM_FOLDER
    return vtkPeer(TESSERA_PROGRAM_FOLDER).value();
#else
    return {};
#endif
}

TEST_F(PeerTest, TheSampleScriptSamplesRight) {
    const std::string python = TESSERA_PYTHON;
    if (std::system((python + " -c 'import numpy, vtkmodules.vtkFiltersCore' 2>/dev/null").c_str()) != 0)
        GTEST_SKIP() << python << " has no VTK or no NumPy";
    expectRightSamples({"probe", python + " " TESSERA_SOURCE_DIR "/bench/peer_probe.py"}, "vtkProbeFilter");
}

TEST_F(PeerTest, TheVtkPeerSamplesRight) {
    const PeerCommand peer = builtVtkPeer();
    if (peer.command.empty()) GTEST_SKIP() << "tessera-vtk-peer isn't built";
    expectRightSamples(peer, "vtkResampleToImage");
}

TEST_F(PeerTest, TheVtkPeerIsFoundOnlyWhereItStands) {
    EXPECT_FALSE(vtkPeer(folder_.string()));
}

TEST_F(PeerTest, TheVtkPeerSamplesOneLayerOfPoints) {
    const PeerCommand peer = builtVtkPeer();
    if (peer.command.empty()) GTEST_SKIP() << "tessera-vtk-peer isn't built";
    const TetMesh mesh = unitBox(2);
    const IndexBox layer{Vec3i(3, 0, 5), Vec3i(4, 14, 6)};
    const Block block = resampleBlock(*makePeer(peer), mesh, everyField(mesh), kAround, layer);
    EXPECT_LT(largestError(block, 0, linear), 1e-5);
}

TEST_F(PeerTest, BricksByEveryCriterionAreThoseOfSoftware) {
    const PeerCommand command = builtVtkPeer();
    if (command.command.empty()) GTEST_SKIP() << "tessera-vtk-peer isn't built";
    TetMesh mesh = unitBox(4);
    addPointField(mesh, "wavy", {wavyField});
    const auto peer = makePeer(command);
    for (const Criterion criterion : {Criterion::uniform, Criterion::elementSize, Criterion::error}) {
        RefineOptions options;
        options.criterion = criterion;
        options.brickCells = 8;
        options.resolution = 64;
        options.maxError = 0.03;
        const BrickResult by = refineAndResample(mesh, everyField(mesh), *peer, options, {.threads = 2});
        const BrickResult exact =
            refineAndResample(mesh, everyField(mesh), findResampler("software"), options, {.threads = 2});
        EXPECT_EQ(by.tree.leafCount(), exact.tree.leafCount());
        EXPECT_EQ(by.rounds, exact.rounds);
        for (std::size_t f = 0; f < mesh.fields.size(); ++f)
            EXPECT_NEAR(by.report.fields[f].max, exact.report.fields[f].max, 1e-5);
        EXPECT_LE(by.statistics.count(kPeerRequests), criterion == Criterion::uniform ? 1 : 8);
        EXPECT_NE(by.target.find("VTK"), std::string::npos);
    }
}

TEST_F(PeerTest, AsksOnceForAUniformLattice) {
    const TetMesh mesh = unitBox(1);
    const auto bound = makePeer(fake("good"))->bind(mesh, everyField(mesh));
    const std::vector<IndexBox> boxes = cutIntoBoxes(kAroundPoints, 4);
    std::vector<int> seen(boxes.size());
    const ResampleStatistics statistics = bound->resample(kAround, boxes,
                                                          [&](std::size_t b, const Block& block) {
                                                              ++seen[b];
                                                              EXPECT_LT(largestError(block, 0, linear), 1e-6);
                                                          },
                                                          {});
    EXPECT_EQ(seen, std::vector<int>(boxes.size(), 1));
    EXPECT_EQ(statistics.count(kPeerRequests), 1);
    EXPECT_EQ(statistics.ms(stage::sample), 0.25);
    EXPECT_EQ(bound->target(), "Fake 1.0");
}

TEST_F(PeerTest, BoxesFarApartArePartedOnce) {
    const TetMesh mesh = unitBox(1);
    const auto bound = makePeer(fake("good"))->bind(mesh, everyField(mesh));
    const std::vector<IndexBox> boxes{{Vec3i(0), Vec3i(3)},
                                      {Vec3i(1000), Vec3i(1004)},
                                      {Vec3i(3, 0, 0), Vec3i(6, 3, 3)},
                                      {Vec3i(1000, 1000, 1004), Vec3i(1004, 1004, 1008)}};
    const ResampleStatistics statistics = bound->resample(kAround, boxes,
                                                          [&](std::size_t b, const Block& block) {
                                                              EXPECT_EQ(block.box, boxes[b]);
                                                              EXPECT_LT(largestError(block, 0, linear), 1e-6);
                                                          },
                                                          {});
    EXPECT_EQ(statistics.count(kPeerRequests), 2);
}

TEST_F(PeerTest, WithoutATimeTheRoundTripCounts) {
    const TetMesh mesh = unitBox(1);
    const auto bound = makePeer(fake("says no time"))->bind(mesh, everyField(mesh));
    const ResampleStatistics statistics =
        bound->resample(kAround, std::span(&kAroundPoints, 1), [](std::size_t, const Block&) {}, {});
    EXPECT_GT(statistics.ms(stage::sample), 0.25);
}

TEST_F(PeerTest, RefusesWhatItCannotDo) {
    const TetMesh mesh = unitBox(1);
    const auto peer = makePeer(fake("good"));
    EXPECT_FALSE(peer->info().meetsContract);
    EXPECT_THROW(peer->bind(mesh, everyField(mesh), {.target = "AVX2"}), InputError);
    EXPECT_THROW(peer->bind(mesh, everyField(mesh), {.target = {}, .format = SampleFormat::r8}), InputError);
    EXPECT_THROW(peer->bind(mesh, {}), InputError);
    const auto bound = peer->bind(mesh, everyField(mesh));
    Lattice turned = kAround;
    turned.uWorld.y = 0.01;
    EXPECT_THROW(bound->resample(turned, std::span(&kAroundPoints, 1), [](std::size_t, const Block&) {}, {}),
                 InputError);
}

TEST_F(PeerTest, SaysHowItFailed) {
    const std::string title =
        R"(the peer fake: expected a line such as {"peer": "NAME VERSION"} when it has read the mesh, but )";
    const std::string answer =
        R"(the peer fake: expected a line such as {"ms": 12.3} when it has sampled, but )";
    const std::string reading = R"(; its standard error ends with "reading")";
    EXPECT_EQ(
        failure(fake("dies at start")),
        title + R"(it ended without a result (exit code 7); its standard error ends with "no licence")");
    EXPECT_EQ(failure(fake("greets")), title + "it said hello" + reading);
    EXPECT_EQ(
        failure(fake("dies later")),
        answer + R"(it ended without a result (exit code 3); its standard error ends with "out of memory")");
    EXPECT_EQ(failure(fake("leaves")), answer + "it ended without a result (exit code 0)" + reading);
    EXPECT_EQ(failure(fake("talks nonsense")), answer + "it said 42 ms" + reading);
    EXPECT_EQ(failure(fake("boasts")), answer + R"(it said {"ms": -1})" + reading);
    EXPECT_EQ(failure(fake("never ends its line")),
              answer + "it said more than 65536 bytes without a line's end" + reading);
    EXPECT_EQ(failure(fake("gives an error")),
              R"(the peer fake: expected samples, but it answered with the error "no such field")" + reading);
    EXPECT_EQ(
        failure(fake("stops early")),
        "the peer fake: expected 10920 bytes of samples, 4 for each of 1 channels at 2730 points, but it "
        "wrote 10916" +
            reading);
    EXPECT_NE(failure(fake("writes nothing")).find("points, but it wrote no file"), std::string::npos);
    EXPECT_NE(failure(fake("counts too much")).find("ms that its answer took, but it said"),
              std::string::npos);
    EXPECT_NE(
        failure(fake("chats")).find("expected silence until the next request, but it said anything else?"),
        std::string::npos);
    EXPECT_NE(failure({"fake", "no-such-program"}).find("exit code 127); its standard error ends with"),
              std::string::npos);
    EXPECT_NE(failure({"fake", "kill -SEGV $$;"}).find("but it "), std::string::npos);
}

TEST_F(PeerTest, AnswersOnAfterAnError) {
    const TetMesh mesh = unitBox(1);
    const auto bound = makePeer(fake("wants volumes"))->bind(mesh, everyField(mesh));
    const auto sample = [&](const IndexBox& box) {
        bound->resample(
            kAround, std::span(&box, 1),
            [](std::size_t, const Block& block) { EXPECT_LT(largestError(block, 0, linear), 1e-6); }, {});
    };
    EXPECT_THROW(sample({Vec3i(0), Vec3i(5, 5, 1)}), IoError);
    sample(kAroundPoints);
}

TEST_F(PeerTest, OneThatHangsIsEnded) {
    const Timer timer;
    EXPECT_NE(failure(fake("is silent", 300)).find("but nothing came within 0.3 s"), std::string::npos);
    EXPECT_NE(failure(fake("hangs", 500)).find("but nothing came within 0.5 s"), std::string::npos);
    EXPECT_LT(timer.elapsedMs(), 5000);
}

TEST_F(PeerTest, OneThatLeavesItsWorkToOthersIsEndedWithThem) {
    const fs::path mark = folder_ / "mark";
    const std::string wrapper = (folder_ / "wrapper.sh").string();
    std::ofstream(wrapper) << "(sleep 1; touch " << mark.string() << ")\n";
    EXPECT_NE(failure({"fake", "sh " + wrapper, 200}).find("nothing came"), std::string::npos);
    std::this_thread::sleep_for(std::chrono::milliseconds(1200));
    EXPECT_FALSE(fs::exists(mark));
}

TEST_F(PeerTest, IsEndedWhenTheCallerAsksToStop) {
    const TetMesh mesh = unitBox(1);
    const auto bound = makePeer(fake("hangs"))->bind(mesh, everyField(mesh));
    std::atomic<bool> cancel{false};
    std::thread stopper([&] {
        std::this_thread::sleep_for(std::chrono::milliseconds(100));
        cancel = true;
    });
    const Timer timer;
    const auto sample = [&] {
        bound->resample(kAround, std::span(&kAroundPoints, 1), [](std::size_t, const Block&) {},
                        {.cancel = &cancel});
    };
    EXPECT_THROW(sample(), Cancelled);
    stopper.join();
    EXPECT_LT(timer.elapsedMs(), 3000);
    EXPECT_THROW(sample(), IoError);
}

}  // namespace
}  // namespace tessera
