#include "io/vdb_file.h"

#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <sys/resource.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <glm/vector_relational.hpp>
#include <iterator>
#include <limits>

#include "base/error.h"
#include "io/atomic_file.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A directory of its own for each test, removed afterwards.
class VdbFileTest : public testing::Test {
  protected:
    void SetUp() override {
        std::string pattern = (fs::temp_directory_path() / "tessera_vdb_XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        directory_ = pattern;
    }
    void TearDown() override { fs::remove_all(directory_); }
    std::string file(const std::string& name) const { return (directory_ / name).string(); }
    std::size_t fileCount() const {
        return std::size_t(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()));
    }
    fs::path directory_;
};

std::string readBytes(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void writeBytes(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
}

// One brick of level 3 at negative indices, its neighbour refined step by step to level 0.
std::vector<BrickKey> nestedLeaves() {
    std::vector<BrickKey> leaves{{3, {-1, -1, -1}}};
    BrickKey refined{3, {0, -1, -1}};
    while (refined.level > 0) {
        for (int child = 0; child < 8; ++child) {
            const BrickKey key{refined.level - 1,
                               refined.index * 2 + Vec3i(child & 1, child >> 1 & 1, child >> 2)};
            if (child == 0 && key.level > 0) continue;
            leaves.push_back(key);
        }
        refined = {refined.level - 1, refined.index * 2};
    }
    return leaves;
}

std::uint32_t scramble(std::uint32_t x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

std::uint32_t pointKey(int level, const Vec3i& p, int channel) {
    return scramble(
        scramble(scramble(scramble(std::uint32_t(p.x)) + std::uint32_t(p.y)) + std::uint32_t(p.z)) +
        std::uint32_t(level * 16 + channel));
}

// Three of four points are covered; values of all magnitudes and signs.
bool coveredAt(int level, const Vec3i& p) {
    return pointKey(level, p, 15) % 4 != 0;
}
float valueAt(int level, const Vec3i& p, int channel) {
    const std::uint32_t key = pointKey(level, p, channel);
    return (key & 1 ? -1.0f : 1.0f) * std::ldexp(1.0f + float(key >> 9) * 0x1p-23f, int(key >> 1 & 31) - 16);
}

using ValueFunction = float (*)(int level, const Vec3i& p, int channel);
using CoverFunction = bool (*)(int level, const Vec3i& p);

BrickStore fillStore(const BrickTree& tree, int channels, ValueFunction value, CoverFunction covered) {
    BrickStore store(tree.brickCells(), tree.leafCount(), channels);
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        const BrickKey& key = tree.leaves()[leaf];
        Block block;
        block.lattice = tree.lattice(key.level);
        block.box = tree.ownedPoints(key);
        block.channels = channels;
        block.values.resize(std::size_t(channels) * block.count());
        block.coverage.resize(block.count());
        for (int z = block.box.min.z; z < block.box.max.z; ++z)
            for (int y = block.box.min.y; y < block.box.max.y; ++y)
                for (int x = block.box.min.x; x < block.box.max.x; ++x) {
                    const Vec3i p(x, y, z);
                    if (!covered(key.level, p)) continue;
                    block.coverage[block.offset(p)] = 1;
                    for (int c = 0; c < channels; ++c)
                        block.values[std::size_t(c) * block.count() + block.offset(p)] =
                            value(key.level, p, c);
                }
        store.put(leaf, key, block);
    }
    return store;
}

BrickResult makeResult(const Vec3d& origin, double spacing, int brickCells, std::vector<BrickKey> leaves,
                       int channels, ValueFunction value = valueAt, CoverFunction covered = coveredAt) {
    BrickResult result;
    result.tree = BrickTree(origin, spacing, brickCells, std::move(leaves));
    result.store = fillStore(result.tree, channels, value, covered);
    return result;
}

const std::vector<OutputField> kScalar{{"f", "f", "point", 1, 0}};
// A scalar, a vector and a tensor: ten channels.
const std::vector<OutputField> kMixed{
    {"T", "Temp", "point", 1, 0}, {"U", "velocity", "point", 3, 1}, {"S", "stress", "cell", 6, 4}};

// Bitwise, but any NaN equals any other.
bool sameFloat(float a, float b) {
    return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b) ||
           (std::isnan(a) && std::isnan(b));
}

void expectSameTree(const BrickTree& a, const BrickTree& b) {
    EXPECT_EQ(a.originWorld(), b.originWorld());
    EXPECT_EQ(a.spacingWorld(0), b.spacingWorld(0));
    EXPECT_EQ(a.brickCells(), b.brickCells());
    ASSERT_EQ(a.leafCount(), b.leafCount());
    for (std::size_t i = 0; i < a.leafCount(); ++i) EXPECT_EQ(a.leaves()[i], b.leaves()[i]) << i;
}

/// Compares every stored point with what `value` and `covered` say of it.
void expectStored(const VdbFile& read, int channels, ValueFunction value, CoverFunction covered) {
    ASSERT_EQ(read.store.channels(), channels);
    std::int64_t wrong = 0, points = 0;
    for (std::size_t leaf = 0; leaf < read.tree.leafCount(); ++leaf) {
        const BrickKey& key = read.tree.leaves()[leaf];
        const IndexBox box = read.tree.ownedPoints(key);
        for (int x = box.min.x; x < box.max.x; ++x)
            for (int y = box.min.y; y < box.max.y; ++y)
                for (int z = box.min.z; z < box.max.z; ++z)
                    for (int c = 0; c < channels; ++c) {
                        const Vec3i p(x, y, z);
                        bool isCovered = false;
                        const float stored = read.store.value(leaf, p - box.min, c, isCovered);
                        const bool expected = covered(key.level, p);
                        ++points;
                        wrong +=
                            isCovered != expected || (expected && !sameFloat(stored, value(key.level, p, c)));
                    }
    }
    EXPECT_GT(points, 0);
    EXPECT_EQ(wrong, 0) << "of " << points;
}

openvdb::GridPtrVec readGrids(const std::string& path) {
    openvdb::initialize();
    openvdb::io::File source(path);
    source.open(false);
    return *source.getGrids();
}

template <class Grid>
typename Grid::Ptr findGrid(const std::string& path, const std::string& name) {
    for (const openvdb::GridBase::Ptr& grid : readGrids(path)) {
        if (grid->getName() == name) return openvdb::gridPtrCast<Grid>(grid);
    }
    return nullptr;
}

ErrorReport sampleReport() {
    ErrorReport report;
    FieldError field;
    field.name = "Temp \"x\"";
    field.location = "point";
    field.range = 1.0 / 3;
    field.max = 0.1;
    field.p999 = 1e-300;
    field.rms = std::numeric_limits<double>::quiet_NaN();
    field.relativeMax = 0.3;
    field.worstPlaceWorld = {-1.0 / 7, 2e22, 3};
    field.samples = 1234567890123;
    field.skippedSamples = 5;
    field.validPoints = 77;
    field.integralMesh = {0.1, -0.2, 1e-17};
    field.integralLattice = {0.3, 4, 5};
    field.components = 3;
    report.fields = {field};
    report.fullyCoveredShare = 0.875;
    report.nodes = 3;
    report.centroids = 4;
    report.outsideBricks = 6;
    report.coveredPoints = 8;
    report.flatElements = 9;
    report.invertedElements = 10;
    return report;
}

TEST_F(VdbFileTest, LevelsRoundTripIsBitExact) {
    for (int brickCells : {8, 16}) {
        SCOPED_TRACE(brickCells);
        const Vec3d origin(-0.1, 1e6 + 1.0 / 3, 7);
        BrickResult result = makeResult(origin, 0.1, brickCells, nestedLeaves(), 10);
        const BrickTree tree = result.tree;
        VdbWriteOptions options;
        options.algorithm = "software";
        options.criterion = "error 1%";
        options.sourceFile = "mesh \xc3\xa4.vtu";
        const VdbWriteResult written =
            writeVdb(file("out.vdb"), kMixed, result, nullptr, nullptr, options, {});
        EXPECT_TRUE(written.notes.empty());
        EXPECT_EQ(written.fileBytes, std::int64_t(fs::file_size(file("out.vdb"))));
        EXPECT_EQ(result.store.coveredPoints(), 0) << "tiles are freed on the way";

        const VdbFile read = readVdb(file("out.vdb"));
        expectSameTree(read.tree, tree);
        expectStored(read, 10, valueAt, coveredAt);
        EXPECT_EQ(read.layout, VdbLayout::levels);
        EXPECT_EQ(read.sourceFile, options.sourceFile);
        EXPECT_EQ(read.algorithm, "software");
        EXPECT_EQ(read.criterion, "error 1%");
        EXPECT_EQ(read.unitScale, 1);
        ASSERT_EQ(read.fields.size(), 3u);
        EXPECT_EQ(read.fields[1].name, "U");
        EXPECT_EQ(read.fields[1].sourceName, "velocity");
        EXPECT_EQ(read.fields[2].location, "cell");
        EXPECT_EQ(read.fields[2].firstChannel, 4);
        EXPECT_EQ(read.gridNames.size(), 4u * (1 + 1 + 6 + 1));
        EXPECT_EQ(fileCount(), 1u);
    }
}

TEST_F(VdbFileTest, ReportComesBackExactly) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {{0, {0, 0, 0}}}, 1);
    result.report = sampleReport();
    writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, {}, {});
    const ErrorReport expected = sampleReport();
    const ErrorReport read = readVdb(file("out.vdb")).report;
    ASSERT_EQ(read.fields.size(), 1u);
    const FieldError &a = read.fields[0], &b = expected.fields[0];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.components, 3);
    EXPECT_EQ(a.location, "point");
    EXPECT_EQ(a.range, b.range);
    EXPECT_EQ(a.max, b.max);
    EXPECT_EQ(a.p999, b.p999);
    EXPECT_TRUE(std::isnan(a.rms));
    EXPECT_EQ(a.relativeMax, b.relativeMax);
    EXPECT_EQ(a.worstPlaceWorld, b.worstPlaceWorld);
    EXPECT_EQ(a.samples, b.samples);
    EXPECT_EQ(a.skippedSamples, b.skippedSamples);
    EXPECT_EQ(a.validPoints, b.validPoints);
    EXPECT_EQ(a.integralMesh, b.integralMesh);
    EXPECT_EQ(a.integralLattice, b.integralLattice);
    EXPECT_EQ(read.fullyCoveredShare, 0.875);
    EXPECT_EQ(read.nodes, 3);
    EXPECT_EQ(read.centroids, 4);
    EXPECT_EQ(read.outsideBricks, 6);
    EXPECT_EQ(read.coveredPoints, 8);
    EXPECT_EQ(read.flatElements, 9);
    EXPECT_EQ(read.invertedElements, 10);
}

TEST_F(VdbFileTest, VoxelIsFieldAtItsLatticePoint) {
    const Vec3d origin(0.3, -0.7, 11);
    BrickResult result = makeResult(origin, 0.25, 8, nestedLeaves(), 1);
    const BrickTree tree = result.tree;
    writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, {}, {});
    for (int level = 0; level < 4; ++level) {
        const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f_level_" + std::to_string(level));
        ASSERT_TRUE(grid);
        std::int64_t voxels = 0;
        for (auto it = grid->cbeginValueOn(); it; ++it, ++voxels) {
            const openvdb::Coord c = it.getCoord();
            const Vec3i p(c.x(), c.y(), c.z());
            ASSERT_TRUE(coveredAt(level, p));
            ASSERT_EQ(*it, valueAt(level, p, 0));
            const openvdb::Vec3d place = grid->indexToWorld(c);
            const Vec3d expected = tree.lattice(level).worldFromIndex(Vec3d(p));
            for (int axis = 0; axis < 3; ++axis) ASSERT_NEAR(place[axis], expected[axis], 1e-13);
        }
        std::int64_t expected = 0;
        for (const BrickKey& key : tree.leaves()) {
            if (key.level != level) continue;
            const IndexBox box = tree.ownedPoints(key);
            for (int i = 0; i < 512; ++i)
                expected += coveredAt(level, box.min + Vec3i(i >> 6, i >> 3 & 7, i & 7));
        }
        EXPECT_EQ(voxels, expected);
        EXPECT_EQ(findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage_level_" + std::to_string(level))
                      ->activeVoxelCount(),
                  std::uint64_t(expected));
    }
}

bool everywhere(int, const Vec3i&) {
    return true;
}
// One vector component is infinite at x = 3, all scalars NaN at x = 5.
float holed(int level, const Vec3i& p, int channel) {
    if (p.x == 3 && channel == 2) return kInfinity;
    if (p.x == 5 && channel == 0) return kNaN;
    return valueAt(level, p, channel);
}
float holedAsRead(int level, const Vec3i& p, int channel) {
    if (p.x == 3 && channel >= 1 && channel <= 3) return kNaN;
    return holed(level, p, channel);
}

TEST_F(VdbFileTest, ValuesThatAreNotFiniteAreInactiveButCovered) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {{0, {0, 0, 0}}}, 10, holed, everywhere);
    writeVdb(file("out.vdb"), kMixed, result, nullptr, nullptr, {}, {});
    const auto scalar = findGrid<openvdb::FloatGrid>(file("out.vdb"), "T_level_0");
    const auto vector = findGrid<openvdb::Vec3SGrid>(file("out.vdb"), "U_level_0");
    EXPECT_EQ(scalar->activeVoxelCount(), 448u);
    EXPECT_FALSE(scalar->tree().isValueOn(openvdb::Coord(5, 1, 2)));
    EXPECT_EQ(vector->activeVoxelCount(), 448u);
    EXPECT_FALSE(vector->tree().isValueOn(openvdb::Coord(3, 1, 2)));
    EXPECT_EQ(findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage_level_0")->activeVoxelCount(), 512u);
    expectStored(readVdb(file("out.vdb")), 10, holedAsRead, everywhere);
}

TEST_F(VdbFileTest, ExtensionIsActiveButNotCovered) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10);
    // Inside the level's bricks, outside all bricks, and one whose vector isn't finite.
    Vec3i uncovered = result.tree.ownedPoints({0, {0, -8, -8}}).min;
    while (coveredAt(0, uncovered)) ++uncovered.z;
    ExtensionPoints extension;
    extension.points = {{uncovered, 0, 0}, {{100, 200, -300}, 0, 10}, {{-40, 0, 0}, 3, 20}};
    extension.values.resize(30);
    for (std::size_t i = 0; i < 30; ++i) extension.values[i] = float(i) + 0.5f;
    extension.values[21] = kNaN;
    writeVdb(file("out.vdb"), kMixed, result, &extension, nullptr, {}, {});

    const auto fine = findGrid<openvdb::FloatGrid>(file("out.vdb"), "T_level_0");
    const auto tensor = findGrid<openvdb::FloatGrid>(file("out.vdb"), "S_3_level_0");
    const auto vector = findGrid<openvdb::Vec3SGrid>(file("out.vdb"), "U_level_3");
    const openvdb::Coord inside(uncovered.x, uncovered.y, uncovered.z), outside(100, 200, -300),
        coarse(-40, 0, 0);
    EXPECT_TRUE(fine->tree().isValueOn(inside));
    EXPECT_EQ(fine->tree().getValue(inside), 0.5f);
    EXPECT_TRUE(fine->tree().isValueOn(outside));
    EXPECT_EQ(tensor->tree().getValue(outside), 17.5f);
    EXPECT_FALSE(vector->tree().isValueOn(coarse)) << "a component isn't finite";
    EXPECT_EQ(findGrid<openvdb::FloatGrid>(file("out.vdb"), "T_level_3")->tree().getValue(coarse), 20.5f);
    EXPECT_FALSE(findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage_level_0")->tree().isValueOn(inside));
    EXPECT_FALSE(findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage_level_0")->tree().isValueOn(outside));
    expectStored(readVdb(file("out.vdb")), 10, valueAt, coveredAt);
}

TEST_F(VdbFileTest, BackgroundIsWrittenAndInactiveVoxelsCarryIt) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {{0, {0, 0, 0}}}, 10);
    VdbWriteOptions options;
    options.background = -7.25f;
    writeVdb(file("out.vdb"), kMixed, result, nullptr, nullptr, options, {});
    const auto scalar = findGrid<openvdb::FloatGrid>(file("out.vdb"), "T_level_0");
    const auto vector = findGrid<openvdb::Vec3SGrid>(file("out.vdb"), "U_level_0");
    EXPECT_EQ(scalar->background(), -7.25f);
    EXPECT_EQ(vector->background(), openvdb::Vec3f(-7.25f));
    for (int i = 0; i < 512; ++i) {
        const openvdb::Coord c(i >> 6, i >> 3 & 7, i & 7);
        if (coveredAt(0, {c.x(), c.y(), c.z()})) continue;
        EXPECT_EQ(scalar->tree().getValue(c), -7.25f);
        EXPECT_EQ(vector->tree().getValue(c), openvdb::Vec3f(-7.25f));
    }
    EXPECT_EQ(readVdb(file("out.vdb")).background, -7.25f);
}

TEST_F(VdbFileTest, TinyVoxelsGetASmallerUnit) {
    BrickResult result = makeResult({1e-5, 2e-5, -3e-5}, 1e-7, 8, nestedLeaves(), 1);
    const BrickTree tree = result.tree;
    const VdbWriteResult written = writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, {}, {});
    EXPECT_EQ(written.unitScale, 1e4);
    ASSERT_EQ(written.notes.size(), 1u);
    EXPECT_NE(written.notes[0].find("10000"), std::string::npos) << written.notes[0];
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f_level_1");
    EXPECT_NEAR(grid->voxelSize().x(), 2e-3, 1e-15);
    const openvdb::Vec3d place = grid->indexToWorld(openvdb::Coord(10, 20, 30));
    EXPECT_NEAR(place.x(), 0.1 + 10 * 2e-3, 1e-12);
    EXPECT_NEAR(place.z(), -0.3 + 30 * 2e-3, 1e-12);
    const VdbFile read = readVdb(file("out.vdb"));
    expectSameTree(read.tree, tree);
    EXPECT_EQ(read.unitScale, 1e4);
    expectStored(read, 1, valueAt, coveredAt);
    EXPECT_EQ(readVdbLattice(file("out.vdb")).spacingWorld, 1e-7);
}

TEST_F(VdbFileTest, UnitScaleOfTheCallerHolds) {
    BrickResult result = makeResult({1, 2, 3}, 0.5, 8, {{0, {0, 0, 0}}}, 1);
    VdbWriteOptions options;
    options.unitScale = 1000;
    EXPECT_EQ(writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, options, {}).unitScale, 1000);
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f_level_0");
    EXPECT_EQ(grid->indexToWorld(openvdb::Coord(2, 0, 0)), openvdb::Vec3d(2000, 2000, 3000));
    options.unitScale = 1e-5;
    BrickResult second = makeResult({1, 2, 3}, 0.5, 8, {{0, {0, 0, 0}}}, 1);
    EXPECT_THROW(writeVdb(file("second.vdb"), kScalar, second, nullptr, nullptr, options, {}), InputError);
    options.unitScale = -1;
    EXPECT_THROW(writeVdb(file("second.vdb"), kScalar, second, nullptr, nullptr, options, {}), InputError);
    EXPECT_FALSE(fs::exists(file("second.vdb")));
}

TEST_F(VdbFileTest, VoxelsFromSmallToLargeCanBeWritten) {
    for (double spacing : {1e-30, 1.4e-5, 1.5e-5, 2e-5, 1e9, 1e30}) {
        for (UpAxis axis : {UpAxis::keep, UpAxis::y}) {
            SCOPED_TRACE(spacing);
            BrickResult result = makeResult({0, 0, 0}, spacing, 8, {{0, {0, 0, 0}}}, 1);
            VdbWriteOptions options;
            options.upAxis = axis;
            const VdbWriteResult written =
                writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, options, {});
            const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f_level_0");
            EXPECT_NEAR(grid->voxelSize().x() / (spacing * written.unitScale), 1, 1e-12);
            EXPECT_GE(grid->voxelSize().x(), 1.9e-5);
            EXPECT_EQ(readVdb(file("out.vdb")).tree.spacingWorld(), spacing);
        }
    }
}

TEST_F(VdbFileTest, UpAxisTurnsPlacesAndVectorsTogether) {
    for (UpAxis axis : {UpAxis::y, UpAxis::z}) {
        BrickResult result = makeResult({1, 2, 3}, 0.5, 8, nestedLeaves(), 10);
        const BrickTree tree = result.tree;
        VdbWriteOptions options;
        options.upAxis = axis;
        writeVdb(file("out.vdb"), kMixed, result, nullptr, nullptr, options, {});
        const auto turn = [&](const Vec3d& v) {
            return axis == UpAxis::y ? Vec3d(v.x, v.z, -v.y) : Vec3d(v.x, -v.z, v.y);
        };
        const auto grid = findGrid<openvdb::Vec3SGrid>(file("out.vdb"), "U_level_1");
        std::int64_t voxels = 0;
        for (auto it = grid->cbeginValueOn(); it; ++it, ++voxels) {
            const openvdb::Coord c = it.getCoord();
            const Vec3i p(c.x(), c.y(), c.z());
            const Vec3d place = turn(tree.lattice(1).worldFromIndex(Vec3d(p)));
            const Vec3d vector = turn({valueAt(1, p, 1), valueAt(1, p, 2), valueAt(1, p, 3)});
            for (int a = 0; a < 3; ++a) {
                ASSERT_NEAR(grid->indexToWorld(c)[a], place[a], 1e-12);
                ASSERT_EQ(double((*it)[a]), vector[a]);
            }
        }
        EXPECT_GT(voxels, 0);
        const VdbFile read = readVdb(file("out.vdb"));
        EXPECT_EQ(read.upAxis, axis);
        expectSameTree(read.tree, tree);
        expectStored(read, 10, valueAt, coveredAt);
    }
}

float smallIntegers(int level, const Vec3i& p, int channel) {
    return float(int(pointKey(level, p, channel) % 2001) - 1000);
}
float pressures(int, const Vec3i& p, int) {
    return 101325.0f + float(p.x);
}

TEST_F(VdbFileTest, HalfFloatsReadBack) {
    // Integers to 2048 are exact in half floats.
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, smallIntegers, coveredAt);
    VdbWriteOptions options;
    const std::int64_t full =
        writeVdb(file("full.vdb"), kMixed, result, nullptr, nullptr, options, {}).fileBytes;
    result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, smallIntegers, coveredAt);
    options.halfFloat = true;
    const VdbWriteResult half = writeVdb(file("half.vdb"), kMixed, result, nullptr, nullptr, options, {});
    EXPECT_TRUE(half.notes.empty());
    EXPECT_LT(half.fileBytes, full);
    EXPECT_TRUE(findGrid<openvdb::FloatGrid>(file("half.vdb"), "T_level_0")->saveFloatAsHalf());
    const VdbFile read = readVdb(file("half.vdb"));
    EXPECT_TRUE(read.halfFloat);
    expectStored(read, 10, smallIntegers, coveredAt);
}

TEST_F(VdbFileTest, ValuesBeyondHalfFloatsStayFull) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 1, pressures, coveredAt);
    VdbWriteOptions options;
    options.halfFloat = true;
    const VdbWriteResult written = writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, options, {});
    ASSERT_EQ(written.notes.size(), 1u);
    EXPECT_NE(written.notes[0].find("65504"), std::string::npos);
    expectStored(readVdb(file("out.vdb")), 1, pressures, coveredAt);
}

// A box of six tets with a field that trilinear interpolation reproduces.
TetMesh linearMesh(const Box3d& box) {
    TetMesh mesh;
    for (int i = 0; i < 8; ++i)
        mesh.points.push_back(glm::mix(box.min, box.max, Vec3d(i & 1, i >> 1 & 1, i >> 2)));
    // The six paths along edges from corner 0 to corner 7.
    for (const auto& [a, b] : {std::pair{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}})
        mesh.tets.push_back({0, a, b, 7});
    Field field{"f", FieldLocation::point, 1, {}};
    for (const Vec3d& p : mesh.points) field.values.push_back(1 + 2 * p.x - 3 * p.y + 0.5 * p.z);
    mesh.fields.push_back(field);
    return mesh;
}
constexpr double kSpacing = 0.125;
float linear(int level, const Vec3i& p, int) {
    const Vec3d place = Vec3d(p) * std::ldexp(kSpacing, level);
    return float(1 + 2 * place.x - 3 * place.y + 0.5 * place.z);
}
// Meshes inside the nested bricks, in index space of level 0: nearly all of it, and a slab that cuts through
// bricks of all levels.
const Box3d kWide{{-62.5, -62.5, -62.5}, {62.5, -1.5, -1.5}};
const Box3d kSlab{{-10.5, -62.5, -62.5}, {10.5, -1.5, -1.5}};
bool inside(const Box3d& box, int level, const Vec3i& p) {
    const Vec3d q = Vec3d(p) * std::ldexp(1.0, level);
    return glm::all(glm::lessThanEqual(box.min, q)) && glm::all(glm::lessThanEqual(q, box.max));
}
bool wide(int level, const Vec3i& p) {
    return inside(kWide, level, p);
}
bool slab(int level, const Vec3i& p) {
    return inside(kSlab, level, p);
}
// Deeper than any voxel is wide, so that all corners around are covered.
bool deepInWide(const Vec3i& p) {
    return inside({kWide.min + 8.0, kWide.max - 8.0}, 0, p);
}

struct FlatCase {
    std::vector<int> fields{0};
    TetMesh mesh;
    NearestPointIndex nearest;
    BrickResult result;
    Reconstruction reconstruction;
    FlatCase(const Box3d& box, CoverFunction covered)
        : mesh(linearMesh({box.min * kSpacing, box.max * kSpacing})),
          nearest(mesh),
          result(makeResult({0, 0, 0}, kSpacing, 8, nestedLeaves(), 1, linear, covered)),
          reconstruction(mesh, fields, result.tree, result.store, nearest) {}
};

TEST_F(VdbFileTest, FlatLayoutReconstructsCoarseBricks) {
    FlatCase flat(kWide, wide);
    VdbWriteOptions options;
    options.layout = VdbLayout::flat;
    const BrickTree tree = flat.result.tree;
    const VdbWriteResult written =
        writeVdb(file("out.vdb"), kScalar, flat.result, nullptr, &flat.reconstruction, options, {});
    EXPECT_EQ(written.flatLevel, 0);
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f");
    const auto coverage = findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage");
    ASSERT_TRUE(grid && coverage);
    EXPECT_EQ(grid->activeVoxelCount(), coverage->activeVoxelCount());
    std::int64_t wrong = 0, deep = 0;
    for (auto it = grid->cbeginValueOn(); it; ++it) {
        const openvdb::Coord c = it.getCoord();
        const Vec3i p(c.x(), c.y(), c.z());
        wrong += !inside(kWide, 0, p) || !coverage->tree().isValueOn(c);
        if (!deepInWide(p)) continue;
        ++deep;
        wrong += !(std::abs(double(*it) - double(linear(0, p, 0))) <= 1e-5 * 40);
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(deep, 109 * 45 * 45) << "every point deep inside is there";
    const VdbFile read = readVdb(file("out.vdb"));
    EXPECT_EQ(read.layout, VdbLayout::flat);
    expectSameTree(read.tree, tree);
    EXPECT_EQ(read.gridNames, (std::vector<std::string>{"coverage", "f"}));
    EXPECT_EQ(read.gridVoxels[1], std::int64_t(grid->activeVoxelCount()));
}

TEST_F(VdbFileTest, FlatCoverageNeedsAllCornersInCoarseBricks) {
    FlatCase flat(kSlab, slab);
    VdbWriteOptions options;
    options.layout = VdbLayout::flat;
    const BrickTree tree = flat.result.tree;
    writeVdb(file("out.vdb"), kScalar, flat.result, nullptr, &flat.reconstruction, options, {});
    const auto coverage = findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage");
    std::int64_t wrong = 0, covered = 0;
    for (int x = -64; x < 64; ++x)
        for (int y = -56; y < -16; y += 3)
            for (int z = -56; z < -16; z += 3) {
                const BrickKey& key = tree.leaves()[std::size_t(tree.findLeafAt(Vec3d(x, y, z)))];
                // Corners that the point is interpolated from.
                const int step = 1 << key.level;
                const Vec3i low = floorDiv(Vec3i(x, y, z), step) * step;
                const Vec3i high = low + Vec3i(low.x != x, low.y != y, low.z != z) * step;
                const bool expected = slab(0, low) && slab(0, high);
                const bool found = coverage->tree().isValueOn(openvdb::Coord(x, y, z));
                wrong += found != expected;
                covered += found;
            }
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(covered, 0);
}

TEST_F(VdbFileTest, FlatExtensionFillsCutCellsOfCoarseBricks) {
    FlatCase flat(kSlab, slab);
    const ExtensionPoints extension =
        extendOutside(flat.mesh, flat.fields, flat.result.tree, flat.result.store, flat.nearest, 1, {});
    VdbWriteOptions options;
    options.layout = VdbLayout::flat;
    writeVdb(file("out.vdb"), kScalar, flat.result, &extension, &flat.reconstruction, options, {});
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f");
    const auto coverage = findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage");
    EXPECT_GT(grid->activeVoxelCount(), coverage->activeVoxelCount());
    // A brick of level 3 has points at x = -16 (outside) and -8 (inside): all fine points between them carry
    // a value.
    for (int x = -15; x <= -8; ++x) {
        EXPECT_TRUE(grid->tree().isValueOn(openvdb::Coord(x, -40, -40))) << x;
        EXPECT_EQ(coverage->tree().isValueOn(openvdb::Coord(x, -40, -40)), x == -8) << x;
    }
}

TEST_F(VdbFileTest, FlatSizeCanBeCapped) {
    FlatCase flat(kWide, wide);
    VdbWriteOptions options;
    options.layout = VdbLayout::flat;
    options.maxFlatVoxels = 2 * 32 * 32 * 32;
    const VdbWriteResult written =
        writeVdb(file("out.vdb"), kScalar, flat.result, nullptr, &flat.reconstruction, options, {});
    EXPECT_EQ(written.flatLevel, 1);
    ASSERT_EQ(written.notes.size(), 1u);
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f");
    EXPECT_EQ(grid->voxelSize().x(), 2 * kSpacing);
    EXPECT_LE(grid->activeVoxelCount(), std::uint64_t(options.maxFlatVoxels));
    std::int64_t wrong = 0, deep = 0;
    for (auto it = grid->cbeginValueOn(); it; ++it) {
        const openvdb::Coord c = it.getCoord();
        const Vec3i p(c.x(), c.y(), c.z());
        if (!deepInWide(2 * p)) continue;
        ++deep;
        wrong += !(std::abs(double(*it) - double(linear(1, p, 0))) <= 1e-5 * 40);
    }
    EXPECT_EQ(wrong, 0);
    EXPECT_EQ(deep, 55 * 23 * 23);
    // The part that was refined to level 0 has every second of its points.
    for (int x = 0; x < 4; ++x)
        for (int y = -31; y < -28; ++y)
            ASSERT_TRUE(grid->tree().isValueOn(openvdb::Coord(x, y, -30))) << x << ' ' << y;
}

TEST_F(VdbFileTest, SameBytesForAnyNumberOfThreads) {
    for (VdbLayout layout : {VdbLayout::levels, VdbLayout::flat}) {
        std::string first;
        for (int threads : {1, 2, 5, 16}) {
            FlatCase flat(kSlab, slab);
            const ExtensionPoints extension = extendOutside(flat.mesh, flat.fields, flat.result.tree,
                                                            flat.result.store, flat.nearest, 1, {});
            VdbWriteOptions options;
            options.layout = layout;
            Execution execution;
            execution.threads = threads;
            const std::string path = file("threads_" + std::to_string(threads) + ".vdb");
            writeVdb(path, kScalar, flat.result, &extension, &flat.reconstruction, options, execution);
            const std::string bytes = readBytes(path);
            if (first.empty()) first = bytes;
            EXPECT_TRUE(bytes == first) << threads;
        }
    }
}

TEST_F(VdbFileTest, NamesThatWouldClashAreRefused) {
    EXPECT_THROW(checkOutputFields({{"coverage", "a", "point", 1, 0}}), InputError);
    EXPECT_THROW(checkOutputFields({{"a", "a", "point", 1, 0}, {"a", "b", "point", 3, 1}}), InputError);
    EXPECT_THROW(checkOutputFields({{"S", "a", "point", 2, 0}, {"S_1", "b", "point", 1, 2}}), InputError);
    EXPECT_THROW(checkOutputFields({{"", "a", "point", 1, 0}}), InputError);
    EXPECT_NO_THROW(checkOutputFields(kMixed));
}

TEST_F(VdbFileTest, UnwritablePlacesAreRefusedAtOnce) {
    EXPECT_THROW(checkWritable(file("missing/out.vdb")), IoError);
    EXPECT_THROW(checkWritable(directory_.string()), IoError);
    EXPECT_THROW(checkWritable(directory_.string() + "/"), IoError);
    EXPECT_THROW(checkWritable(""), IoError);
    EXPECT_THROW(checkWritable("/dev/null"), IoError);
    EXPECT_THROW(checkWritable("/proc/out.vdb"), IoError);
    EXPECT_THROW(checkWritable(file(std::string(300, 'x'))), IoError);
    writeBytes(file("plain"), "x");
    EXPECT_THROW(checkWritable(file("plain/out.vdb")), IoError);
    EXPECT_NO_THROW(checkWritable(file("new.vdb")));
    EXPECT_NO_THROW(checkWritable(file("plain")));
    EXPECT_NO_THROW(checkWritable(file(std::string(250, 'x'))));
    EXPECT_EQ(readBytes(file("plain")), "x");
    EXPECT_EQ(fileCount(), 1u) << "a check leaves nothing behind";
}

// Lets no file grow beyond some bytes while it lives; a write past that fails as on a full disk.
class FileSizeLimit {
  public:
    explicit FileSizeLimit(rlim_t bytes) {
        previousHandler_ = std::signal(SIGXFSZ, SIG_IGN);
        getrlimit(RLIMIT_FSIZE, &previous_);
        const rlimit limit{bytes, previous_.rlim_max};
        setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~FileSizeLimit() {
        setrlimit(RLIMIT_FSIZE, &previous_);
        std::signal(SIGXFSZ, previousHandler_);
    }

  private:
    rlimit previous_{};
    void (*previousHandler_)(int) = nullptr;
};

TEST_F(VdbFileTest, FailedWriteLeavesTheOldFileAlone) {
    writeBytes(file("out.vdb"), "precious");
    for (rlim_t limit : {rlim_t(0), rlim_t(20), rlim_t(40), rlim_t(5000), rlim_t(200000)}) {
        SCOPED_TRACE(limit);
        for (const char* name : {"out.vdb", "new.vdb"}) {
            BrickResult result = makeResult({0, 0, 0}, 1, 16, nestedLeaves(), 10);
            const FileSizeLimit full(limit);
            EXPECT_THROW(writeVdb(file(name), kMixed, result, nullptr, nullptr, {}, {}), IoError);
        }
        EXPECT_EQ(readBytes(file("out.vdb")), "precious");
        EXPECT_EQ(fileCount(), 1u);
    }
}

TEST_F(VdbFileTest, CancelledWriteLeavesNothing) {
    std::atomic<bool> cancel{true};
    Execution execution;
    execution.cancel = &cancel;
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 1);
    EXPECT_THROW(writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, {}, execution), Cancelled);
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(VdbFileTest, SymbolicLinkKeepsPointingAtTheFile) {
    writeBytes(file("real.vdb"), "old");
    fs::create_symlink(file("real.vdb"), file("link.vdb"));
    writeFileAtomically(file("link.vdb"), "new");
    EXPECT_TRUE(fs::is_symlink(file("link.vdb")));
    EXPECT_EQ(readBytes(file("real.vdb")), "new");
}

TEST_F(VdbFileTest, TemporaryFilesCanBeRemovedBySignalHandlers) {
    AtomicFile open(file("out.vdb"));
    open.writeAt(0, "abc", 3);
    EXPECT_EQ(fileCount(), 1u);
    removeTemporaryFiles();
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(VdbFileTest, DamagedFilesAreRefused) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 1);
    writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, {}, {});
    const std::string good = readBytes(file("out.vdb"));
    for (std::size_t length : {std::size_t(0), std::size_t(5), std::size_t(21), std::size_t(56),
                               std::size_t(57), std::size_t(1000), good.size() - 1}) {
        writeBytes(file("cut.vdb"), good.substr(0, length));
        EXPECT_THROW(readVdb(file("cut.vdb")), InputError) << length;
        EXPECT_THROW(readVdbLattice(file("cut.vdb")), InputError) << length;
    }
    for (std::uint32_t i = 0; i < 300; ++i) {
        std::string bad = good;
        // Past the UUID, whose own damage can make the file look like another program's.
        const std::size_t at = 57 + scramble(i) % (bad.size() - 57);
        bad[at] = char(bad[at] ^ (1 << (i % 8)));
        writeBytes(file("bad.vdb"), bad);
        EXPECT_THROW(readVdb(file("bad.vdb")), InputError) << at;
    }
    writeBytes(file("noise.vdb"), std::string(1000, 'x'));
    EXPECT_THROW(readVdb(file("noise.vdb")), InputError);
    EXPECT_THROW(readVdb(file("missing.vdb")), InputError);
    EXPECT_THROW(readVdb(directory_.string()), InputError);
}

TEST_F(VdbFileTest, FilesOfOtherProgramsGiveTheirLattice) {
    openvdb::initialize();
    const openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0.0f);
    for (int i = 0; i < 100; ++i) grid->tree().setValueOn(openvdb::Coord(i, 3 * i, -i), float(i));
    grid->setName("density");
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.25));
    grid->transform().postTranslate(openvdb::Vec3d(1, -2, 3));
    openvdb::io::File(file("other.vdb")).write(openvdb::GridPtrVec{grid});
    const FixedFrame frame = readVdbLattice(file("other.vdb"));
    EXPECT_EQ(frame.originWorld, Vec3d(1, -2, 3));
    EXPECT_EQ(frame.spacingWorld, 0.25);
    EXPECT_THROW(readVdb(file("other.vdb")), InputError);

    grid->transform().preRotate(0.5, openvdb::math::X_AXIS);
    openvdb::io::File(file("turned.vdb")).write(openvdb::GridPtrVec{grid});
    EXPECT_THROW(readVdbLattice(file("turned.vdb")), InputError);
    openvdb::io::File(file("empty.vdb")).write(openvdb::GridPtrVec{});
    EXPECT_THROW(readVdbLattice(file("empty.vdb")), InputError);

    // Without a digest nothing vouches for the bytes: any damage must end in an exception or a frame, never
    // in a crash.
    const std::string good = readBytes(file("other.vdb"));
    for (std::uint32_t i = 0; i < 60; ++i) {
        std::string bad = good;
        for (std::uint32_t k = 0; k < 3; ++k)
            bad[57 + scramble(i * 3 + k) % 400] = char(scramble(i + k) & 255);
        writeBytes(file("bad.vdb"), bad);
        try {
            readVdbLattice(file("bad.vdb"));
        } catch (const InputError&) {
        }
    }
}

TEST_F(VdbFileTest, FileSavedAgainByAnotherProgramStillReads) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, valueAt, everywhere);
    writeVdb(file("out.vdb"), kMixed, result, nullptr, nullptr, {}, {});
    openvdb::io::File source(file("out.vdb"));
    source.open(false);
    const openvdb::MetaMap::Ptr metadata = source.getMetadata();
    const openvdb::GridPtrVecPtr grids = source.getGrids();
    // Full leaf nodes of the mask become tiles, as many tools do.
    for (const openvdb::GridBase::Ptr& grid : *grids) grid->pruneGrid();
    openvdb::io::File(file("again.vdb")).write(*grids, *metadata);
    expectStored(readVdb(file("again.vdb")), 10, valueAt, everywhere);
}

TEST_F(VdbFileTest, EmptyTreeGivesAFileWithoutVoxels) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {}, 1);
    writeVdb(file("out.vdb"), kScalar, result, nullptr, nullptr, {}, {});
    EXPECT_EQ(readVdb(file("out.vdb")).tree.leafCount(), 0u);
}

TEST_F(VdbFileTest, VdbPrintListsTheGrids) {
    if (std::system("command -v vdb_print > /dev/null 2>&1") != 0)
        GTEST_SKIP() << "vdb_print isn't installed";
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10);
    writeVdb(file("out.vdb"), kMixed, result, nullptr, nullptr, {}, {});
    ASSERT_EQ(std::system(("vdb_print -l " + file("out.vdb") + " > " + file("list.txt")).c_str()), 0);
    const std::string list = readBytes(file("list.txt"));
    for (const char* name : {"T_level_0", "U_level_3", "S_5_level_2", "coverage_level_1", "tessera_bricks"})
        EXPECT_NE(list.find(name), std::string::npos) << name;
}

}  // namespace
}  // namespace tessera
