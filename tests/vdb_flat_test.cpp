#include <glm/vector_relational.hpp>

#include "io/vdb_file.h"
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
    NearestPointIndex nearest;
    BrickResult result;
    Reconstruction reconstruction;
    FlatCase(const Box3d& box, CoverFunction covered)
        : mesh(linearMesh({box.min * kSpacing, box.max * kSpacing})),
          nearest(mesh),
          result(makeResult({0, 0, 0}, kSpacing, 8, nestedLeaves(), 1, linear, covered)),
          reconstruction(mesh, fields, result.tree, result.store, nearest) {}
};

TEST_F(VdbFlatTest, FlatLayoutReconstructsCoarseBricks) {
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

TEST_F(VdbFlatTest, FlatCoverageNeedsAllCornersInCoarseBricks) {
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

TEST_F(VdbFlatTest, FlatExtensionFillsCutCellsOfCoarseBricks) {
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

TEST_F(VdbFlatTest, FlatSizeCanBeCapped) {
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

TEST_F(VdbFlatTest, SameBytesForAnyNumberOfThreads) {
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

}  // namespace
}  // namespace tessera
