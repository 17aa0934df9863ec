#include <glm/vector_relational.hpp>

#include "brick/flatten.h"
#include "refine/brick_result.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_read.h"
#include "vdb/vdb_write.h"
#include "vdb_case.h"

namespace tessera {
namespace {

class VdbFlatTest : public VdbFileTest {};

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
    BrickTree bricks;
    BrickResult result;
    CoverFunction covered;
    FlatCase(const Box3d& box, CoverFunction coverFunction)
        : mesh(linearMesh({box.min * kSpacing, box.max * kSpacing})),
          result(makeResult({0, 0, 0}, kSpacing, 8, nestedLeaves(), 1, linear, coverFunction)),
          covered(coverFunction) {
        bricks = result.tree;
    }
    void flatten(const FlattenOptions& options, const Execution& execution = {}) {
        const NearestOnDemand nearest(mesh, 1);
        const CoverageSource coverage = [&](const Lattice& lattice, std::span<const IndexBox> boxes,
                                            const BlockSink& sink) {
            for (std::size_t i = 0; i < boxes.size(); ++i) {
                Block block{lattice, boxes[i], 0, {}, {}};
                Vec3i p;
                for (p.z = block.box.min.z; p.z < block.box.max.z; ++p.z)
                    for (p.y = block.box.min.y; p.y < block.box.max.y; ++p.y)
                        for (p.x = block.box.min.x; p.x < block.box.max.x; ++p.x)
                            block.coverage.push_back(covered(options.level, p));
                sink(i, block);
            }
        };
        FlatBricks flat =
            tessera::flatten(mesh, fields, result.tree, result.store, nearest, coverage, options, execution);
        result.bricks = std::exchange(result.tree, std::move(flat.tree));
        result.store = std::move(flat.store);
        result.flatLevel = options.level;
    }
};

TEST_F(VdbFlatTest, FlatLayoutReconstructsCoarseBricks) {
    FlatCase flat(kWide, wide);
    flat.flatten({0, {}, 0});
    writeVdb(file("out.vdb"), kScalar, flat.result, flatOptions(0), {});
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
    ASSERT_TRUE(read.bricks);
    expectSameTree(*read.bricks, flat.bricks);
    EXPECT_EQ(read.store.coveredPoints(), std::int64_t(coverage->activeVoxelCount()));
    EXPECT_EQ(read.gridNames, (std::vector<std::string>{"coverage", "f"}));
    EXPECT_EQ(read.gridVoxels[1], std::int64_t(grid->activeVoxelCount()));
}

TEST_F(VdbFlatTest, FlatCoverageIsThatOfTheMeshInCoarseBricksToo) {
    FlatCase flat(kSlab, slab);
    flat.flatten({0, {}, 0});
    writeVdb(file("out.vdb"), kScalar, flat.result, flatOptions(0), {});
    const auto coverage = findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage");
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f");
    std::int64_t wrong = 0, covered = 0;
    for (int x = -64; x < 64; ++x)
        for (int y = -56; y < -16; y += 3)
            for (int z = -56; z < -16; z += 3) {
                const bool expected = slab(0, {x, y, z});
                const openvdb::Coord c(x, y, z);
                wrong += coverage->tree().isValueOn(c) != expected || grid->tree().isValueOn(c) != expected;
                covered += expected;
            }
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(covered, 0);
}

// Every cell that the mesh touches has its eight voxels, whatever the size of the bricks there.
TEST_F(VdbFlatTest, FlatExtensionLeavesNoGapBesideCoarseBricks) {
    for (const int level : {0, 1}) {
        FlatCase flat(kSlab, slab);
        flat.flatten({level, {}, 1});
        writeVdb(file("out.vdb"), kScalar, flat.result, flatOptions(1), {});
        const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f");
        const auto coverage = findGrid<openvdb::BoolGrid>(file("out.vdb"), "coverage");
        EXPECT_GT(grid->activeVoxelCount(), coverage->activeVoxelCount());
        const int step = 1 << level;
        std::int64_t missing = 0, cells = 0;
        const Box3d& box = kSlab;
        for (int x = -11 / step - 1; x <= 10 / step; ++x)
            for (int y = -63 / step - 1; y <= -2 / step; ++y)
                for (int z = -63 / step - 1; z <= -2 / step; ++z) {
                    const Vec3d low = Vec3d(x, y, z) * double(step), high = low + double(step);
                    if (glm::any(glm::greaterThan(low, box.max)) || glm::any(glm::lessThan(high, box.min)))
                        continue;
                    ++cells;
                    for (int c = 0; c < 8; ++c)
                        missing += !grid->tree().isValueOn(
                            openvdb::Coord(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)));
                }
        EXPECT_EQ(missing, 0) << "of " << cells << " cells";
        EXPECT_GT(cells, 1000);
        // Inside the mesh every voxel holds the linear field, but where a coarse cell ends outside.
        std::int64_t wrong = 0;
        for (auto it = grid->cbeginValueOn(); it; ++it) {
            const openvdb::Coord c = it.getCoord();
            const Vec3i p(c.x(), c.y(), c.z());
            if (!slab(level, p)) continue;
            wrong += !coverage->tree().isValueOn(c);
            if (inside({kSlab.min + 8.0, kSlab.max - 8.0}, level, p))
                wrong += !(std::abs(double(*it) - double(linear(level, p, 0))) <= 1e-5 * 40);
        }
        EXPECT_EQ(wrong, 0);
    }
}

TEST_F(VdbFlatTest, FlatGridOfACoarserLevelTakesEverySecondPoint) {
    FlatCase flat(kWide, wide);
    flat.flatten({1, {}, 0});
    writeVdb(file("out.vdb"), kScalar, flat.result, flatOptions(0), {});
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f");
    EXPECT_EQ(grid->voxelSize().x(), 2 * kSpacing);
    EXPECT_EQ(readVdb(file("out.vdb")).flatLevel, 1);
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

TEST_F(VdbFlatTest, FlatGridIsCroppedToTheBounds) {
    FlatCase flat(kWide, wide);
    const Box3d bounds{Vec3d(-20.5, -40, -40) * kSpacing, Vec3d(9, -12.25, -16) * kSpacing};
    flat.flatten({0, bounds, 1});
    writeVdb(file("out.vdb"), kScalar, flat.result, flatOptions(1), {});
    const auto grid = findGrid<openvdb::FloatGrid>(file("out.vdb"), "f");
    EXPECT_EQ(grid->evalActiveVoxelBoundingBox(),
              openvdb::CoordBBox(openvdb::Coord(-21, -40, -40), openvdb::Coord(9, -12, -16)));
    EXPECT_EQ(grid->activeVoxelCount(), 31u * 29u * 25u);
}

TEST_F(VdbFlatTest, SameBytesForAnyNumberOfThreads) {
    for (VdbLayout layout : {VdbLayout::levels, VdbLayout::flat}) {
        std::string first;
        for (int threads : {1, 2, 5, 16}) {
            FlatCase flat(kSlab, slab);
            VdbWriteOptions options;
            options.layout = layout;
            Execution execution;
            execution.threads = threads;
            if (layout == VdbLayout::flat) flat.flatten({0, {}, 2}, execution);
            const std::string path = file("threads_" + std::to_string(threads) + ".vdb");
            writeVdb(path, kScalar, flat.result, options, execution);
            const std::string bytes = readBytes(path);
            if (first.empty()) first = bytes;
            EXPECT_TRUE(bytes == first) << threads;
        }
    }
}

}  // namespace
}  // namespace tessera
