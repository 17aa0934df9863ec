#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "reference/fields.h"
#include "reference/generators.h"
#include "tessera/brick_sampler.h"
#include "tessera/error.h"
#include "tessera/write.h"
#include "vdb/vdb_read.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

TetMesh wavyMesh() {
    TetMesh mesh = boxMesh({.cells = Vec3i(3), .jitter = 0.2});
    addPointField(mesh, "wave", {wavyField});
    addPointField(
        mesh, "move",
        {wavyField, [](const Vec3d& p) { return p.x; }, [](const Vec3d& p) { return p.y - 2 * p.z; }});
    return mesh;
}

template <class Action>
std::string refusal(const Action& action) {
    try {
        action();
    } catch (const InputError& error) {
        return error.what();
    }
    return "not refused";
}

class LibraryTest : public testing::Test {
  protected:
    void SetUp() override {
        std::string pattern = (fs::temp_directory_path() / "tessera_library_XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        folder_ = pattern;
    }
    void TearDown() override { fs::remove_all(folder_); }
    std::string file(const std::string& name) const { return (folder_ / name).string(); }
    std::string bytesOf(const std::string& name) const {
        std::ifstream stream(file(name), std::ios::binary);
        return {std::istreambuf_iterator<char>(stream), {}};
    }

    fs::path folder_;
    const TetMesh mesh_ = wavyMesh();
};

TEST_F(LibraryTest, FieldsAreChosenByNameAndInTheirOrder) {
    const Bricks bricks = resample(mesh_, {.fields = {"move", "wave"}});
    ASSERT_EQ(bricks.fields().size(), 2u);
    EXPECT_EQ(bricks.fields()[0].name, "move");
    EXPECT_EQ(bricks.fields()[0].components, 3);
    EXPECT_EQ(bricks.channel("move", 2), 2);
    EXPECT_EQ(bricks.channel("wave"), 3);
    EXPECT_EQ(bricks.report().fields[1].name, "wave");
    EXPECT_NE(refusal([&] { bricks.channel("wave", 1); }).find("move of 3, wave of 1"), std::string::npos);
    EXPECT_EQ(refusal([&] { resample(mesh_, {.fields = {"heat"}}); }),
              "no field named 'heat'; there are: wave, move");
    EXPECT_EQ(refusal([&] {
                  resample(mesh_, {.fields = {"wave", "point:wave"}});
              }),
              "the field 'point:wave' is named twice");
}

TEST_F(LibraryTest, ValuesAtLatticePointsAreTheSamples) {
    const Bricks bricks = resample(mesh_, {.criterion = Criterion::uniform, .resolution = 20});
    int compared = 0;
    for (std::size_t b = 0; b < bricks.count(); ++b) {
        const Block block = bricks.samples(b);
        const Box3d box = bricks.brick(b).boundsWorld;
        EXPECT_EQ(block.lattice.worldFromIndex(Vec3d(block.box.min)), box.min);
        for (int i = 0; i < block.box.size().x; i += 3) {
            const Vec3i p = block.box.min + i;
            if (!block.covered(p)) continue;
            for (int c = 0; c < block.channels; ++c) {
                const auto value = bricks.value(block.lattice.worldFromIndex(Vec3d(p)), c);
                ASSERT_TRUE(value.has_value());
                EXPECT_NEAR(*value, double(block.value(c, p)), 1e-6);
                ++compared;
            }
        }
    }
    EXPECT_GT(compared, 20);
}

TEST_F(LibraryTest, ValuesOfALinearFieldAreExactOnEveryLevel) {
    const Bricks bricks = resample(mesh_, {.fields = {"move"}, .samplesPerElement = 8});
    for (int n = 0; n < 200; ++n) {
        const Vec3d place(std::fmod(0.37 * n, 1.0), std::fmod(0.71 * n, 1.0), std::fmod(0.13 * n, 1.0));
        EXPECT_NEAR(bricks.value(place, 1).value(), place.x, 1e-6);
        EXPECT_NEAR(bricks.value(place, 2).value(), place.y - 2 * place.z, 1e-6);
    }
    EXPECT_FALSE(bricks.value({9, 9, 9}, 0).has_value());
    EXPECT_FALSE(bricks.value({1e300, 0, std::nan("")}, 0).has_value());
}

TEST_F(LibraryTest, WritingLeavesTheBricksAsTheyWere) {
    const Bricks bricks = resample(mesh_, {.criterion = Criterion::error, .maxError = 0.02});
    ASSERT_TRUE(bricks.isWithinBound()) << bricks.stoppedBecause();
    write(bricks, file("first.vdb"));
    write(bricks, file("flat.vdb"), {.layout = FileLayout::flat, .isHalf = true});
    Bricks copy = bricks;
    const OutputFile last = write(std::move(copy), file("last.vdb"));
    EXPECT_FALSE(bytesOf("first.vdb").empty());
    EXPECT_EQ(bytesOf("first.vdb"), bytesOf("last.vdb"));
    EXPECT_EQ(last.bytes, std::int64_t(bytesOf("last.vdb").size()));
    EXPECT_EQ(last.report.fields[0].max, bricks.report().fields[0].max);
    EXPECT_TRUE(last.isWithinBound);
}

TEST_F(LibraryTest, FilesSayWhatTheyWereMadeOf) {
    const InputMesh input{mesh_, "wavy.vtu", 2.5, {}};
    const Bricks bricks = resample(input, {.fields = {"wave"},
                                           .criterion = Criterion::error,
                                           .maxError = 0.05,
                                           .errorMeasure = ErrorMeasure::rms});
    write(bricks, file("named.vdb"), {.extend = 1, .names = {{"wave", "density"}}});
    const VdbFile read = readVdb(file("named.vdb"));
    EXPECT_EQ(read.algorithm, "software");
    EXPECT_EQ(read.criterion, "error");
    EXPECT_EQ(read.sourceFile, "wavy.vtu");
    EXPECT_EQ(read.time, 2.5);
    EXPECT_EQ(read.layers, 1);
    ASSERT_EQ(read.fields.size(), 1u);
    EXPECT_EQ(read.fields[0].name, "density");
    EXPECT_EQ(read.fields[0].sourceName, "wave");
    EXPECT_EQ(read.report.fields[0].name, "density");
    EXPECT_EQ(read.tree.originWorld(), bricks.frame().originWorld);
    EXPECT_EQ(read.tree.spacingWorld(), bricks.frame().spacingWorld);
    EXPECT_EQ(read.tree.leafCount(), bricks.count());
}

TEST_F(LibraryTest, OutputsThatCantBeAreRefusedAndLeaveNothing) {
    const Bricks bricks = resample(mesh_);
    EXPECT_NE(refusal([&] { write(bricks, file("a.vtk")); }).find("there are: .vdb, .nvdb, .vti"),
              std::string::npos);
    EXPECT_NE(refusal([&] { write(bricks, file("a.vti"), {.layout = FileLayout::levels}); }).find("levels"),
              std::string::npos);
    EXPECT_NE(refusal([&] { write(bricks, file("a.vdb"), {.extend = -1}); }).find("from 0 to 64"),
              std::string::npos);
    EXPECT_NE(refusal([&] {
                  write(bricks, file("a.vdb"), {.names = {{"heat", "T"}}});
              }).find("names"),
              std::string::npos);
    EXPECT_THROW(write(bricks, file("no/folder/a.vdb")), IoError);
    EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(LibraryTest, MeshesThatDontFitTogetherAreRefused) {
    TetMesh mesh = mesh_;
    mesh.tets[5][2] = 1000;
    EXPECT_EQ(refusal([&] { resample(mesh); }), "element 5 has node 1000, and the mesh has 64 nodes");
    mesh = mesh_;
    mesh.fields[0].values.pop_back();
    EXPECT_EQ(refusal([&] { BrickSampler sampler(mesh); }),
              "field wave has 63 values, and the mesh's nodes need 64");
    mesh.fields[0].components = 0;
    EXPECT_EQ(refusal([&] { resample(mesh); }), "field wave has 0 components, not 1 to 9");
}

TEST_F(LibraryTest, SingleBricksHaveTheBitsOfTheWhole) {
    const Bricks bricks =
        resample(mesh_, {.fields = {"wave"}, .criterion = Criterion::uniform, .resolution = 33});
    const BrickSampler sampler(mesh_, {.fields = {"wave"}});
    const Brick brick = bricks.brick(bricks.count() / 2);
    const Block whole = bricks.samples(bricks.count() / 2);
    const Vec3d centre = 0.5 * (brick.boundsWorld.min + brick.boundsWorld.max);
    const Block block = sampler.around(centre, brick.spacingWorld, 16);
    ASSERT_EQ(block.box, whole.box);
    ASSERT_EQ(block.coverage, whole.coverage);
    for (std::size_t i = 0; i < block.count(); ++i) {
        if (!block.coverage[i]) continue;
        EXPECT_EQ(block.values[i], whole.values[i]);
    }
    const Block moved = sampler.around(centre + Vec3d(3 * brick.spacingWorld), brick.spacingWorld, 8);
    const Vec3i shared = moved.box.min;
    ASSERT_TRUE(block.box.contains(shared));
    EXPECT_EQ(moved.value(0, shared), block.value(0, shared));
    EXPECT_EQ(moved.box.size(), Vec3i(8));
}

TEST_F(LibraryTest, SingleBricksThatCantBeAreRefused) {
    const BrickSampler sampler(mesh_);
    EXPECT_NE(refusal([&] { sampler.around({0, 0, 0}, 0, 8); }).find("positive"), std::string::npos);
    EXPECT_NE(refusal([&] { sampler.around({0, 0, 0}, 1, 0); }).find("1 to 1024"), std::string::npos);
    EXPECT_NE(refusal([&] { sampler.around({1e12, 0, 0}, 1e-3, 8); }).find("2^29"), std::string::npos);
    EXPECT_NE(refusal([&] { BrickSampler(mesh_, {.algorithm = "none"}); }).find("no algorithm named none"),
              std::string::npos);
    const Block far = sampler.around({50, 50, 50}, 0.1, 8);
    EXPECT_EQ(std::count(far.coverage.begin(), far.coverage.end(), 0), 512);
}

TEST_F(LibraryTest, StepsOfASeriesAreReadWithTheirTimes) {
    const std::string data = TESSERA_DATA_DIR "/freefem-stokes-sphere/stokes_p1.vtu";
    std::ofstream(file("run.pvd")) << "<?xml version=\"1.0\"?><VTKFile type=\"Collection\"><Collection>"
                                   << "<DataSet timestep=\"2\" file=\"" << data << "\"/>"
                                   << "</Collection></VTKFile>";
    const std::vector<InputStep> steps = listSteps({file("run.pvd")});
    ASSERT_EQ(steps.size(), 1u);
    EXPECT_EQ(steps[0].time, 2.0);
    const InputOptions options{.fields = {"pressure"}, .isIsolated = false, .followsLinks = true};
    EXPECT_NE(refusal([&] { read(steps[0], {.isIsolated = false}); }).find("outside the folder"),
              std::string::npos);
    for (const InputMesh& mesh : {read(steps[0], options), read(file("run.pvd"), options)}) {
        EXPECT_EQ(mesh.time, 2.0);
        EXPECT_EQ(mesh.sourceFile, "stokes_p1.vtu");
        ASSERT_EQ(mesh.mesh.fields.size(), 1u);
        EXPECT_EQ(mesh.mesh.elementCount(), 18598);
    }
    EXPECT_NE(
        refusal([&] { read(file("run.pvd"), {.step = 1, .isIsolated = false}); }).find("no time step 1"),
        std::string::npos);
}

TEST_F(LibraryTest, AReaderThatIsntThereIsAnError) {
    try {
        read(TESSERA_DATA_DIR "/freefem-stokes-sphere/stokes_p1.vtu", {.program = file("tessera")});
        FAIL();
    } catch (const IoError& error) {
        EXPECT_NE(std::string(error.what()).find("is no program that can be run"), std::string::npos);
    }
}

}  // namespace
}  // namespace tessera
