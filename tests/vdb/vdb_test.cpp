#include "tessera/lattice.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_file.h"

#include <openvdb/io/File.h>
#include <openvdb/io/Stream.h>

#include <algorithm>
#include <array>
#include <sstream>

#include "refine/brick_result.h"
#include "refine/refine_options.h"
#include "tessera/error.h"
#include "vdb/packed_grid.h"
#include "vdb/vdb_read.h"
#include "vdb/vdb_write.h"
#include "vdb_case.h"

namespace tessera {
namespace {

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
        options.target = brickCells == 8 ? "" : "osmesa";
        options.sampleFormat = brickCells == 8 ? "" : "r16f";
        options.criterion = "error 1%";
        options.sourceFile = "mesh \xc3\xa4.vtu";
        const VdbWriteResult written = writeVdb(file("out.vdb"), kMixed, result, options, {});
        EXPECT_TRUE(written.notes.empty());
        EXPECT_EQ(written.fileBytes, std::int64_t(fs::file_size(file("out.vdb"))));
        EXPECT_EQ(result.store.coveredPoints(), 0) << "tiles are freed on the way";

        const VdbFile read = readVdb(file("out.vdb"));
        expectSameTree(read.tree, tree);
        expectStored(read, 10, valueAt, coveredAt);
        EXPECT_EQ(read.layout, VdbLayout::levels);
        EXPECT_EQ(read.sourceFile, options.sourceFile);
        EXPECT_EQ(read.algorithm, "software");
        EXPECT_EQ(read.target, options.target);
        EXPECT_EQ(read.sampleFormat, options.sampleFormat);
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

TEST_F(VdbFileTest, BoundsComeBackExactlyAndAreAbsentWithoutOnes) {
    for (const bool bounded : {false, true}) {
        BrickResult result = makeResult(Vec3d(0), 0.1, 8, nestedLeaves(), 1);
        VdbWriteOptions options;
        if (bounded)
            options.boundsWorld = Box3d{{-1.0 / 3, -2e-300, 0.1}, {1.0 / 7, 1e22, 0.30000000000000004}};
        writeVdb(file("out.vdb"), kScalar, result, options, {});
        const VdbFile read = readVdb(file("out.vdb"));
        ASSERT_EQ(read.boundsWorld.has_value(), bounded);
        if (!bounded) continue;
        EXPECT_EQ(read.boundsWorld->min, options.boundsWorld->min);
        EXPECT_EQ(read.boundsWorld->max, options.boundsWorld->max);
    }
}

TEST_F(VdbFileTest, FlatPlanKeepsVoxelsAndBytesWithinTheirBounds) {
    // 64 bricks of 64^3 points are 2^24.
    std::vector<BrickKey> leaves;
    for (int i = 0; i < 64; ++i) leaves.push_back({0, {i & 3, i >> 2 & 3, i >> 4}});
    const BrickTree tree(Vec3d(0), 0.5, 64, std::move(leaves));
    OutputShape options;
    const auto level = [&](int channels) {
        const FlatGridPlan plan = planFlatGrid(tree, channels, options);
        EXPECT_EQ(plan.points, std::int64_t(1) << (24 - 3 * plan.level));
        EXPECT_EQ(plan.bytes, plan.points * 4 * channels + plan.points / 8);
        EXPECT_EQ(plan.note.empty(), plan.level == 0);
        return plan.level;
    };
    options.maxFlatBytes = std::int64_t(1) << 27;
    EXPECT_EQ(level(1), 0);
    EXPECT_EQ(level(8), 1) << "channels cost memory";
    EXPECT_NE(planFlatGrid(tree, 8, options).note.find("--max-memory"), std::string::npos);
    options.maxFlatVoxels = (std::int64_t(1) << 21) - 1;
    EXPECT_EQ(level(1), 2);
    const std::string note = planFlatGrid(tree, 1, options).note;
    EXPECT_NE(note.find("spacing 2 (level 2) instead of 0.5"), std::string::npos) << note;
    EXPECT_NE(note.find("--max-voxels"), std::string::npos) << note;
}

TEST_F(VdbFileTest, ReportComesBackExactly) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {{0, {0, 0, 0}}}, 1);
    result.report = sampleReport();
    writeVdb(file("out.vdb"), kScalar, result, {}, {});
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
    writeVdb(file("out.vdb"), kScalar, result, {}, {});
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

TEST_F(VdbFileTest, GridsHaveTheBytesThatOpenVdbWrites) {
    for (const bool half : {false, true}) {
        VdbWriteOptions options;
        options.halfFloat = half;
        options.background = 0.25f;
        const auto make = [] { return makeResult({0, 0, 0}, 1, 16, nestedLeaves(), 10, holed, coveredAt); };
        BrickResult packed = make(), plain = make();
        writeVdb(file("out.vdb"), kMixed, packed, options, {});
        const std::string bytes = readBytes(file("out.vdb"));
        VdbWriteResult written;
        for (const openvdb::GridBase::Ptr& grid : buildVdbGrids(kMixed, plain, options, written, {})) {
            std::ostringstream stream;
            openvdb::io::setDataCompression(stream, kVdbCompression);
            const openvdb::GridBase::Ptr theirs = grid->deepCopyGrid();
            theirs->writeTopology(stream);
            theirs->writeBuffers(stream);
            EXPECT_NE(bytes.find(stream.str()), std::string::npos) << grid->getName();
        }
    }
}

TEST_F(VdbFileTest, ValuesThatAreNotFiniteAreInactiveButCovered) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {{0, {0, 0, 0}}}, 10, holed, everywhere);
    writeVdb(file("out.vdb"), kMixed, result, {}, {});
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
    addExtension(result.store, 0, uncovered, 0.5f);
    addExtension(result.store, 0, {100, 200, -300}, 10.5f);
    addExtension(result.store, 3, {-40, 0, 0}, 20.5f);
    result.store.extension()[{3, {-5, 0, 0}}].values[kTilePoints] = kNaN;
    VdbWriteOptions options;
    options.layers = 1;
    writeVdb(file("out.vdb"), kMixed, result, options, {});

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
    const VdbFile read = readVdb(file("out.vdb"));
    expectStored(read, 10, valueAt, coveredAt);
    EXPECT_EQ(read.layers, 1);
    EXPECT_EQ(read.store.extension().size(), 3u);
    const Tile* tile = read.store.extensionAt(3, {-40, 0, 0});
    ASSERT_TRUE(tile);
    EXPECT_EQ(tile->channel(0)[0], 20.5f);
    EXPECT_TRUE(std::isnan(tile->channel(2)[0])) << "the vector is inactive as a whole";
    EXPECT_EQ(tile->channel(4)[0], 24.5f);
    EXPECT_TRUE(read.store.extensionAt(0, uncovered));
    EXPECT_TRUE(read.store.extensionAt(0, {100, 200, -300}));
}

TEST_F(VdbFileTest, BackgroundIsWrittenAndInactiveVoxelsCarryIt) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {{0, {0, 0, 0}}}, 10);
    VdbWriteOptions options;
    options.background = -7.25f;
    writeVdb(file("out.vdb"), kMixed, result, options, {});
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
    const VdbWriteResult written = writeVdb(file("out.vdb"), kScalar, result, {}, {});
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
    EXPECT_EQ(writeVdb(file("out.vdb"), kScalar, result, options, {}).unitScale, 1000);
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f_level_0");
    EXPECT_EQ(grid->indexToWorld(openvdb::Coord(2, 0, 0)), openvdb::Vec3d(2000, 2000, 3000));
    options.unitScale = 1e-5;
    BrickResult second = makeResult({1, 2, 3}, 0.5, 8, {{0, {0, 0, 0}}}, 1);
    EXPECT_THROW(writeVdb(file("second.vdb"), kScalar, second, options, {}), InputError);
    options.unitScale = -1;
    EXPECT_THROW(writeVdb(file("second.vdb"), kScalar, second, options, {}), InputError);
    EXPECT_FALSE(fs::exists(file("second.vdb")));
}

TEST_F(VdbFileTest, VoxelsFromSmallToLargeCanBeWritten) {
    for (double spacing : {1e-30, 1.4e-5, 1.5e-5, 2e-5, 1e9, 1e30}) {
        for (UpAxis axis : {UpAxis::keep, UpAxis::y}) {
            SCOPED_TRACE(spacing);
            BrickResult result = makeResult({0, 0, 0}, spacing, 8, {{0, {0, 0, 0}}}, 1);
            VdbWriteOptions options;
            options.upAxis = axis;
            const VdbWriteResult written = writeVdb(file("out.vdb"), kScalar, result, options, {});
            const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f_level_0");
            EXPECT_NEAR(grid->voxelSize().x() / (spacing * written.unitScale), 1, 1e-12);
            EXPECT_GE(grid->voxelSize().x(), 1.9e-5);
            EXPECT_EQ(readVdb(file("out.vdb")).tree.spacingWorld(), spacing);
        }
    }
}

TEST_F(VdbFileTest, SaysWhatDistanceFromTheOriginCosts) {
    const auto write = [&](double far) {
        BrickResult result = makeResult({0, far, 0}, 0.05, 8, {{0, {0, 0, 0}}}, 1);
        return writeVdb(file("out.vdb"), kScalar, result, {}, {}).notes;
    };
    EXPECT_TRUE(write(1e6).empty());
    // At 1e14 places are multiples of 2^-6: a voxel of 0.05 becomes one of 3 / 64, off by 1/16 a voxel, 8 of
    // them by a half.
    ASSERT_EQ(write(1e14).size(), 1u);
    EXPECT_NE(write(1e14)[0].find("off by up to 0.5 voxels"), std::string::npos) << write(1e14)[0];
    EXPECT_EQ(readVdb(file("out.vdb")).tree.spacingWorld(), 0.05);
    fs::remove(file("out.vdb"));
    for (double far : {1e15, 1e16, -1e300}) {
        EXPECT_THROW(write(far), InputError) << far;
        EXPECT_EQ(fileCount(), 0u);
    }
}

TEST_F(VdbFileTest, VoxelsTooSmallForAnyUnitAreRefused) {
    BrickResult result = makeResult({0, 0, 0}, 5e-322, 8, {}, 1);
    EXPECT_THROW(writeVdb(file("out.vdb"), kScalar, result, {}, {}), InputError);
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(VdbFileTest, UpAxisTurnsPlacesAndVectorsTogether) {
    for (UpAxis axis : {UpAxis::y, UpAxis::z}) {
        BrickResult result = makeResult({1, 2, 3}, 0.5, 8, nestedLeaves(), 10);
        const BrickTree tree = result.tree;
        VdbWriteOptions options;
        options.upAxis = axis;
        writeVdb(file("out.vdb"), kMixed, result, options, {});
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

// The transform alone moves, by a share of each level's voxel and before the axes are turned.
TEST_F(VdbFileTest, VoxelShiftMovesTheTransformsOnly) {
    for (UpAxis axis : {UpAxis::keep, UpAxis::y, UpAxis::z}) {
        BrickResult plain = makeResult({1, 2, 3}, 0.5, 8, nestedLeaves(), 10);
        BrickResult shifted = makeResult({1, 2, 3}, 0.5, 8, nestedLeaves(), 10);
        const BrickTree tree = plain.tree;
        VdbWriteOptions options;
        options.upAxis = axis;
        options.unitScale = 10;
        writeVdb(file("plain.vdb"), kMixed, plain, options, {});
        options.voxelShift = -0.5;
        writeVdb(file("shifted.vdb"), kMixed, shifted, options, {});
        for (int level : {0, 1, 3}) {
            const std::string name = "T_level_" + std::to_string(level);
            const auto before = findGrid<openvdb::FloatGrid>(file("plain.vdb"), name);
            const auto after = findGrid<openvdb::FloatGrid>(file("shifted.vdb"), name);
            EXPECT_EQ(before->activeVoxelCount(), after->activeVoxelCount());
            const openvdb::Vec3d index(4, -7, 9), half(0.5, 0.5, 0.5);
            for (int a = 0; a < 3; ++a)
                EXPECT_NEAR(after->indexToWorld(index)[a], before->indexToWorld(index - half)[a], 1e-12);
        }
        const VdbFile read = readVdb(file("shifted.vdb"));
        EXPECT_EQ(read.voxelShift, -0.5);
        expectSameTree(read.tree, tree);
        expectStored(read, 10, valueAt, coveredAt);
        const FixedFrame like = readVdbLattice(file("shifted.vdb"));
        EXPECT_EQ(like.originWorld, Vec3d(1, 2, 3));
        EXPECT_EQ(like.spacingWorld, 0.5);
        EXPECT_NE(readBytes(file("shifted.vdb")).find("tessera_voxel_shift"), std::string::npos);
        EXPECT_EQ(readBytes(file("plain.vdb")).find("tessera_voxel_shift"), std::string::npos);
    }
}

float smallIntegers(int level, const Vec3i& p, int channel) {
    return float(int(pointKey(level, p, channel) % 2001) - 1000);
}
float pressures(int, const Vec3i& p, int) {
    return 101325.0f + float(p.x);
}

// Leaf nodes are compressed by code of ours: OpenVDB, given the grids it reads from the file, writes the same
// bytes but for the digest, with statistics and the table for delayed loading.
TEST_F(VdbFileTest, OpenVdbWritesTheSameBytes) {
    for (const bool toHalf : {false, true}) {
        BrickResult result =
            makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, [](int level, const Vec3i& p, int channel) {
                return channel == 0 ? kNaN : valueAt(level, p, channel);
            });  // a grid without values
        addExtension(result.store, 0, {-200, 3, 5}, 1.5f);
        addExtension(result.store, 2, {-1, -1, 0}, 1.5f);
        VdbWriteOptions options;
        options.halfFloat = toHalf;
        options.background = 0.25f;
        writeVdb(file("ours.vdb"), kMixed, result, options, {});
        std::ifstream stream(file("ours.vdb"), std::ios::binary);
        openvdb::io::Stream ours(stream, false);  // keeps the grids' order
        openvdb::io::File theirs(file("theirs.vdb"));
        theirs.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
        theirs.write(*ours.getGrids(), *ours.getMetadata());
        theirs.close();
        const auto withoutUuid = [&](const std::string& name) { return readBytes(file(name)).erase(21, 36); };
        EXPECT_EQ(withoutUuid("ours.vdb").size(), withoutUuid("theirs.vdb").size());
        EXPECT_TRUE(withoutUuid("ours.vdb") == withoutUuid("theirs.vdb"));
    }
}

TEST_F(VdbFileTest, HalfFloatsReadBack) {
    // Integers to 2048 are exact in half floats.
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, smallIntegers, coveredAt);
    VdbWriteOptions options;
    const std::int64_t full = writeVdb(file("full.vdb"), kMixed, result, options, {}).fileBytes;
    result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, smallIntegers, coveredAt);
    options.halfFloat = true;
    const VdbWriteResult half = writeVdb(file("half.vdb"), kMixed, result, options, {});
    EXPECT_TRUE(half.notes.empty());
    EXPECT_LT(half.fileBytes, full);
    EXPECT_TRUE(findGrid<openvdb::FloatGrid>(file("half.vdb"), "T_level_0")->saveFloatAsHalf());
    const VdbFile read = readVdb(file("half.vdb"));
    EXPECT_TRUE(read.halfFloat);
    expectStored(read, 10, smallIntegers, coveredAt);
}

// Values with gaps: one channel of a vector isn't finite at every seventh point.
float withGaps(int level, const Vec3i& p, int channel) {
    return channel == 2 && pointKey(level, p, 14) % 7 == 0 ? kNaN : smallIntegers(level, p, channel);
}

/// Range and histogram of each brick, counted point by point.
void expectStatistics(const BrickStatistics& statistics, const BrickTree& tree) {
    constexpr double kLow = -1000, kHigh = 1000;  // so many points that each channel has both
    for (int channel = 0; channel < 10; ++channel) {
        EXPECT_EQ(statistics.channelRange(channel).min, kLow);
        EXPECT_EQ(statistics.channelRange(channel).max, kHigh);
    }
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        const BrickKey& key = tree.leaves()[leaf];
        for (int channel = 0; channel < 10; ++channel) {
            std::array<std::uint32_t, 256> counts{};
            float low = kInfinity, high = -kInfinity;
            const Vec3i first = key.index * tree.brickCells();
            for (int n = 0; n < 16 * 16 * 16; ++n) {
                const Vec3i p = first + Vec3i(n & 15, n >> 4 & 15, n >> 8);
                const bool isOut = channel >= 1 && channel <= 3 && std::isnan(withGaps(key.level, p, 2));
                if (!coveredAt(key.level, p) || isOut) continue;
                const float value = withGaps(key.level, p, channel);
                low = std::min(low, value);
                high = std::max(high, value);
                ++counts[std::size_t(std::min(255, int((double(value) - kLow) / (kHigh - kLow) * 256)))];
            }
            EXPECT_EQ(statistics.range(leaf, channel).min, low);
            EXPECT_EQ(statistics.range(leaf, channel).max, high);
            for (const BinCount& bin : statistics.histogram(leaf, channel)) {
                EXPECT_EQ(bin.samples, counts[bin.bin]) << int(bin.bin);
                counts[bin.bin] = 0;
            }
            EXPECT_EQ(std::ranges::count(counts, 0u), 256) << "no bin is left out";
        }
    }
}

TEST_F(VdbFileTest, BrickStatisticsAreThoseOfTheSamples) {
    for (UpAxis axis : {UpAxis::keep, UpAxis::y}) {
        BrickResult result = makeResult({0, 0, 0}, 1, 16, nestedLeaves(), 10, withGaps);
        for (std::size_t leaf = 0; leaf < result.tree.leafCount(); ++leaf)
            result.leafErrors.push_back(0.125 * double(leaf));
        VdbWriteOptions options;
        options.brickStatistics = true;
        options.upAxis = axis;
        options.halfFloat = axis == UpAxis::y;  // holds these integers exactly
        writeVdb(file("out.vdb"), kMixed, result, options, {});
        const VdbFile read = readVdb(file("out.vdb"));
        ASSERT_TRUE(read.statistics);
        ASSERT_EQ(read.statistics->brickCount(), read.tree.leafCount());
        expectStatistics(*read.statistics, read.tree);
        EXPECT_EQ(read.statistics->errors[5], 0.625f);
        const auto bricks = std::int64_t(read.tree.leafCount());
        BrickStatistics found = measureStatistics(read.fields, read.store, {.threads = 3});
        EXPECT_EQ(countSameSamples(*read.statistics, found), bricks);
        ++found.bins[found.firstBins[25]].samples;
        found.ranges[3].max = 999.5f;
        EXPECT_EQ(countSameSamples(*read.statistics, found), bricks - 2);
    }
}

TEST_F(VdbFileTest, BrickStatisticsAreOfRoundedValues) {
    const auto thirds = [](int level, const Vec3i& p, int channel) {
        return 1.0f / 3 + smallIntegers(level, p, channel);
    };
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, thirds);
    VdbWriteOptions options;
    options.brickStatistics = true;
    options.halfFloat = true;
    writeVdb(file("out.vdb"), kMixed, result, options, {});
    const VdbFile read = readVdb(file("out.vdb"));
    EXPECT_EQ(countSameSamples(*read.statistics, measureStatistics(read.fields, read.store, {})),
              std::int64_t(read.tree.leafCount()));
    EXPECT_TRUE(std::isnan(read.statistics->errors[0])) << "not measured";
}

TEST_F(VdbFileTest, DamagedBrickStatisticsNameTheFile) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 1);
    writeVdb(file("out.vdb"), kScalar, result, {}, {});
    openvdb::io::File source(file("out.vdb"));
    source.open(false);
    const openvdb::MetaMap::Ptr metadata = source.getMetadata();
    metadata->insertMeta("tessera_brick_statistics", openvdb::StringMetadata("AQAAAAEAAAABAAAA"));
    openvdb::io::File(file("again.vdb")).write(*source.getGrids(), *metadata);
    try {
        readVdb(file("again.vdb"));
        ADD_FAILURE() << "one brick in place of many";
    } catch (const InputError& error) {
        const std::string what = error.what();
        EXPECT_NE(what.find("again.vdb"), std::string::npos) << what;
        EXPECT_NE(what.find("is of 1 bricks"), std::string::npos) << what;
    }
}

// A vector with a component that isn't finite is left out, and its others with it.
TEST_F(VdbFileTest, ValuesThatAreLeftOutDontDecideOnHalfFloats) {
    BrickResult result =
        makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, [](int, const Vec3i& p, int channel) {
            return p.x & 1 ? float(channel) : channel == 1 ? kNaN : channel == 2 ? 1e6f : 1.0f;
        });
    VdbWriteOptions options;
    options.halfFloat = true;
    EXPECT_TRUE(writeVdb(file("half.vdb"), kMixed, result, options, {}).notes.empty());
    EXPECT_TRUE(findGrid<openvdb::Vec3SGrid>(file("half.vdb"), "U_level_0")->saveFloatAsHalf());
}

TEST_F(VdbFileTest, ValuesBeyondHalfFloatsStayFull) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 1, pressures, coveredAt);
    VdbWriteOptions options;
    options.halfFloat = true;
    const VdbWriteResult written = writeVdb(file("out.vdb"), kScalar, result, options, {});
    ASSERT_EQ(written.notes.size(), 1u);
    EXPECT_NE(written.notes[0].find("65504"), std::string::npos);
    expectStored(readVdb(file("out.vdb")), 1, pressures, coveredAt);
}

}  // namespace
}  // namespace tessera
