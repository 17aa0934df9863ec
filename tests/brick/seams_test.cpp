#include "brick/seams.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>

#include "brick/extend.h"
#include "brick_test_meshes.h"
#include "brute_force_resampler.h"
#include "refine/measure_error.h"
#include "refine/plan.h"
#include "refine/refine.h"
#include "refine/refine_options.h"
#include "refine/resample_tree.h"

namespace tessera {
namespace {

struct Sampled {
    TetMesh mesh;
    std::vector<int> fields;
    BrickTree tree;
    BrickStore store;
};

Sampled sampledByElementSize(TetMesh mesh, int maxLevels, int resolution, double samplesPerElement = 2) {
    Sampled result;
    result.mesh = std::move(mesh);
    addPointField(result.mesh, "wave",
                  [](const Vec3d& p) { return std::sin(9 * p.x) * std::cos(7 * p.y) + p.z * p.z; });
    result.fields = {0};
    RefineOptions options;
    options.brickCells = 8;
    options.maxLevels = maxLevels;
    options.resolution = resolution;
    options.samplesPerElement = samplesPerElement;
    result.tree = planBricks(result.mesh, options, {});
    ResampleStatistics statistics;
    const auto bound = BruteForceResampler().bind(result.mesh, result.fields, {});
    result.store = resampleTree(result.tree, *bound, 1, {}, statistics);
    return result;
}

Vec3d firstOf(const BrickTree& tree, const BrickKey& key) {
    return Vec3d(key.index) * std::ldexp(double(tree.brickCells()), key.level);
}
double sizeOf(const BrickTree& tree, const BrickKey& key) {
    return std::ldexp(double(tree.brickCells()), key.level);
}

// Random places that closed boxes of two or more leaves share, in index space of level 0: on faces, on edges
// and at corners.
std::vector<Vec3d> sharedPlaces(const BrickTree& tree, int perLeaf) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> unit(0, 1);
    std::vector<Vec3d> places;
    for (const BrickKey& key : tree.leaves())
        for (int i = 0; i < perLeaf; ++i) {
            Vec3d t(unit(random), unit(random), unit(random));
            const int fixed = 1 + int(random() % 3);  // how many coordinates lie on the brick's border
            const int first = int(random() % 3);
            for (int a = 0; a < fixed; ++a) t[(first + a) % 3] = double(random() % 2);
            places.push_back(firstOf(tree, key) + t * sizeOf(tree, key));
        }
    return places;
}

void expectContinuous(const Sampled& sampled, int perLeaf) {
    const NearestOnDemand nearest(sampled.mesh, 1);
    const Reconstruction reconstruction(sampled.mesh, sampled.fields, sampled.tree, sampled.store, nearest);
    std::map<int, int> comparedAcross;  // levels apart -> pairs
    for (const Vec3d& place : sharedPlaces(sampled.tree, perLeaf)) {
        // Every leaf whose closed box holds the place, found from the 8 directions around it.
        std::set<std::int64_t> leaves;
        for (int c = 0; c < 8; ++c) {
            const Vec3d nudge = (2.0 * Vec3d(cornerOffset(c)) - 1.0) * 1e-9;
            const std::int64_t leaf = sampled.tree.findLeafAt(place + nudge);
            if (leaf >= 0) leaves.insert(leaf);
        }
        double first = 0;
        int firstLevel = -1;
        for (const std::int64_t leaf : leaves) {
            const int level = sampled.tree.leaves()[std::size_t(leaf)].level;
            const double value = reconstruction.interpolate(std::size_t(leaf), place / double(1 << level), 0);
            if (firstLevel < 0) {
                first = value;
                firstLevel = level;
                continue;
            }
            ASSERT_NEAR(value, first, 1e-12 * 2) << "place " << place.x << " " << place.y << " " << place.z;
            ++comparedAcross[std::abs(level - firstLevel)];
        }
    }
    EXPECT_GT(comparedAcross[0], 100);
    EXPECT_GT(comparedAcross[1], 100);
    EXPECT_EQ(comparedAcross.size(), 2u) << "2:1 balance";
}

TEST(Seams, ReconstructionIsContinuousAcrossThreeAndMoreLevels) {
    const Sampled sampled = sampledByElementSize(gradedMesh(8, 3.0), 4, 257);
    ASSERT_GE(sampled.tree.levelCount(), 3);
    expectContinuous(sampled, 40);
}

TEST(Seams, ReconstructionIsContinuousAtTheMeshBoundaryToo) {
    TetMesh ball = ballMesh(8, 0.9);
    for (Vec3d& p : ball.points) p += Vec3d(0.2, 0.1, 0) * glm::dot(p, p);
    // Elements shrink towards one side, so levels change along the boundary.
    for (Vec3d& p : ball.points)
        p = Vec3d(std::exp(2 * p.x), p.y * std::exp(2 * p.x), p.z * std::exp(2 * p.x));
    const Sampled sampled = sampledByElementSize(std::move(ball), 4, 257, 4);
    ASSERT_GE(sampled.tree.levelCount(), 3);
    expectContinuous(sampled, 40);
}

TEST(Seams, BorderPointsTakeTheCoarseBricksInterpolation) {
    const Sampled sampled = sampledByElementSize(gradedMesh(8, 3.0), 4, 257, 3);
    const NearestOnDemand nearest(sampled.mesh, 1);
    const Reconstruction reconstruction(sampled.mesh, sampled.fields, sampled.tree, sampled.store, nearest);
    int checked = 0;
    for (const BrickKey& key : sampled.tree.leaves()) {
        const std::int64_t coarse = sampled.tree.findCovering({key.level, key.index + Vec3i(1, 0, 0)});
        if (coarse < 0 || sampled.tree.leaves()[std::size_t(coarse)].level != key.level + 1) continue;
        const Vec3i onFace = key.index * 8 + Vec3i(8, 3, 3);  // between coarse lattice points in y and z
        const BrickKey& coarseKey = sampled.tree.leaves()[std::size_t(coarse)];
        double expected = 0;
        bool allCovered = true;
        for (int y = 0; y < 2; ++y)
            for (int z = 0; z < 2; ++z) {
                const Vec3i corner((key.index.x + 1) * 4, key.index.y * 4 + 1 + y, key.index.z * 4 + 1 + z);
                bool covered = false;
                expected += 0.25 * double(sampled.store.value(std::size_t(coarse),
                                                              corner - coarseKey.index * 8, 0, covered));
                allCovered = allCovered && covered;
            }
        if (!allCovered) continue;  // bricks that hold little more than the cube's far side
        const SeamValue got = reconstruction.at(key.level, onFace, 0);
        EXPECT_TRUE(got.covered);
        EXPECT_NEAR(got.value, expected, 1e-14);
        ++checked;
    }
    EXPECT_GT(checked, 10);
}

void extend(Sampled& sampled, const NearestOnDemand& nearest, int layers) {
    const Reconstruction reconstruction(sampled.mesh, sampled.fields, sampled.tree, sampled.store, nearest);
    extendOutside(sampled.mesh, sampled.tree, sampled.store, reconstruction, {}, layers,
                  [&](int level, const Vec3i& p, std::span<double> values) {
                      reconstruction.nearestValues(level, p, 0, values);
                  },
                  {});
}

// Level, z, y and x of every point of the extension.
std::set<std::array<int, 4>> extendedPoints(const BrickStore& store) {
    std::set<std::array<int, 4>> points;
    for (const auto& [key, tile] : store.extension())
        for (int offset = 0; offset < kTilePoints; ++offset) {
            const Vec3i p = key.index * kTileSize + pointInTile(offset);
            if (tile.covered(offset)) points.insert({key.level, p.z, p.y, p.x});
        }
    return points;
}

TEST(Seams, ExtensionHoldsEveryPointWithinTheLayersAndTheNearestValue) {
    Sampled sampled = sampledByElementSize(ballMesh(6, 1.0), 2, 40);
    const NearestOnDemand nearest(sampled.mesh, 1);
    const int layers = 2;
    extend(sampled, nearest, layers);
    const std::set<std::array<int, 4>> got = extendedPoints(sampled.store);
    const BrickTree& tree = sampled.tree;
    for (const auto& [level, z, y, x] : got) {
        const Vec3i p(x, y, z);
        const NearestPoint near = nearest.get().find(tree.lattice(level).worldFromIndex(Vec3d(p)), 1e9);
        const Tile* tile = sampled.store.extensionAt(level, p);
        ASSERT_TRUE(tile);
        EXPECT_FLOAT_EQ(tile->channel(0)[offsetInTile(p)], float(near.value(sampled.mesh.fields[0], 0)));
    }
    std::set<std::array<int, 4>> expected;
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        const BrickKey& key = tree.leaves()[leaf];
        for (int i = 0; i < 512; ++i) {
            const Vec3i local(i % 8, i / 8 % 8, i / 64);
            bool covered = false;
            sampled.store.value(leaf, local, 0, covered);
            if (!covered) continue;
            for (int dz = -layers; dz <= layers; ++dz)
                for (int dy = -layers; dy <= layers; ++dy)
                    for (int dx = -layers; dx <= layers; ++dx) {
                        const Vec3i p = key.index * 8 + local + Vec3i(dx, dy, dz);
                        const std::int64_t owner = tree.findLeafAt(key.level, p);
                        if (owner >= 0) {
                            const BrickKey& ownerKey = tree.leaves()[std::size_t(owner)];
                            if (ownerKey.level != key.level) continue;
                            bool inMesh = false;
                            sampled.store.value(std::size_t(owner), p - ownerKey.index * 8, 0, inMesh);
                            if (inMesh) continue;
                        }
                        expected.insert({key.level, p.z, p.y, p.x});
                    }
        }
    }
    EXPECT_GT(expected.size(), 1000u);
    EXPECT_TRUE(std::includes(got.begin(), got.end(), expected.begin(), expected.end()));
    // Beyond these there is only what cells need that the mesh touches, and a layer around it.
    EXPECT_LT(got.size(), expected.size() * 3 / 2);
}

// With one layer the whole mesh can be read from the store, tips included that no lattice point lies in.
TEST(Seams, ExtensionGivesEveryPlaceOfTheMeshItsCorners) {
    TetMesh mesh = ballMesh(6, 1.0);
    for (Vec3d& p : mesh.points)
        p = Vec3d(std::exp(2 * p.x), p.y * std::exp(2 * p.x), p.z * std::exp(2 * p.x));
    // A needle of a fraction of a voxel's thickness.
    const auto base = std::int32_t(mesh.points.size());
    for (const Vec3d& p :
         {Vec3d(7.3, 0, 0), Vec3d(7.3, 0.003, 0), Vec3d(7.3, 0, 0.003), Vec3d(8.37, 0.411, 0.333)})
        mesh.points.push_back(p);
    mesh.tets.push_back({base, base + 1, base + 2, base + 3});
    Sampled sampled = sampledByElementSize(std::move(mesh), 4, 257, 4);
    ASSERT_GE(sampled.tree.levelCount(), 3);
    const NearestOnDemand nearest(sampled.mesh, 1);
    extend(sampled, nearest, 1);
    const Reconstruction stored(sampled.mesh, sampled.fields, sampled.tree, sampled.store, nearest,
                                Outside::missing);
    MeasureOptions options;
    options.outside = Outside::missing;
    const ErrorReport fromStore =
        measureError(sampled.mesh, sampled.fields, sampled.tree, sampled.store, nearest, {}, options);
    EXPECT_EQ(fromStore.incomplete, 0);
    sampled.store.extension().clear();
    const ErrorReport withMesh =
        measureError(sampled.mesh, sampled.fields, sampled.tree, sampled.store, nearest, {});
    EXPECT_NEAR(fromStore.fields[0].max, withMesh.fields[0].max, 1e-6);
    EXPECT_EQ(fromStore.nodes, withMesh.nodes);
    const ErrorReport without =
        measureError(sampled.mesh, sampled.fields, sampled.tree, sampled.store, nearest, {}, options);
    EXPECT_GT(without.incomplete, 10);
    EXPECT_EQ(without.fields[0].skippedSamples, without.incomplete);
}

}  // namespace
}  // namespace tessera
