#include "refine/brick_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include "reference/generators.h"

namespace tessera {
namespace {

PlanFrame frameOf(const TetMesh& mesh, const std::optional<Box3d>& boundsWorld,
                  double rootSpacing = 1.0 / 21) {
    PlanFrame frame;
    frame.meshBoundsWorld = mesh.boundsWorld();
    frame.originWorld = frame.meshBoundsWorld.min - Vec3d(0.013, 0.007, 0.031);
    frame.rootSpacingWorld = rootSpacing;
    frame.maxDepth = Depth(5);
    frame.brickCells = 8;
    frame.boundsWorld = boundsWorld;
    return frame;
}

/// The ancestors of a plan's leaves, coarse ones first.
std::vector<DepthKey> splitBricks(BrickPlan& plan) {
    std::set<std::tuple<int, int, int, int>> seen;
    for (const PlannedBrick* brick : plan.leaves())
        for (int up = 1; up <= brick->key.depth.halvings(); ++up) {
            const Vec3i index = brick->key.index >> up;
            seen.emplace(brick->key.depth.halvings() - up, index.x, index.y, index.z);
        }
    std::vector<DepthKey> keys;
    for (const auto& [depth, x, y, z] : seen) keys.push_back({Depth(depth), {x, y, z}});
    return keys;
}

void expectAsBuiltAnew(BrickPlan& plan, const TetMesh& mesh, std::size_t sampleCount) {
    BrickPlan fresh(mesh, plan.frame(), {});
    fresh.placeOfSample = plan.placeOfSample;
    for (const DepthKey& key : splitBricks(plan)) {
        const auto leaves = fresh.leaves();
        const bool isLeaf =
            std::any_of(leaves.begin(), leaves.end(), [&](const PlannedBrick* b) { return b->key == key; });
        ASSERT_TRUE(isLeaf);
        fresh.split({&key, 1}, ~std::size_t(0), {});
    }
    // A brick vanishes when it is split and only its slack holds elements.
    const auto got = plan.leaves();
    for (bool isSame = false; !isSame;) {
        isSame = true;
        for (const PlannedBrick* brick : fresh.leaves()) {
            if (std::any_of(got.begin(), got.end(),
                            [&](const PlannedBrick* b) { return b->key == brick->key; }))
                continue;
            const std::size_t before = fresh.leafCount();
            const DepthKey key = brick->key;
            fresh.split({&key, 1}, ~std::size_t(0), {});
            ASSERT_EQ(fresh.leafCount(), before - 1);
            isSame = false;
            break;
        }
    }
    const auto expected = fresh.leaves();
    ASSERT_EQ(got.size(), expected.size());
    std::size_t samples = 0;
    for (std::size_t i = 0; i < got.size(); ++i) {
        ASSERT_EQ(got[i]->key, expected[i]->key);
        EXPECT_EQ(got[i]->elements, expected[i]->elements);
        EXPECT_FALSE(got[i]->elements.empty());
        EXPECT_TRUE(std::is_sorted(got[i]->samples.begin(), got[i]->samples.end()));
        samples += got[i]->samples.size();
    }
    EXPECT_EQ(samples, sampleCount);
}

/// Splits and merges at random; what is left is compared with a plan that was built anew.
void runRandomly(const TetMesh& mesh, const std::optional<Box3d>& boundsWorld, unsigned seed) {
    const ElementIndex index(mesh);
    BrickPlan plan(mesh, frameOf(mesh, boundsWorld), {}, &index);
    const Vec3d origin = plan.frame().originWorld;
    plan.placeOfSample = [&mesh, origin](std::uint32_t n) { return mesh.points[n] - origin; };
    std::size_t sampleCount = 0;
    for (PlannedBrick* brick : plan.leaves()) {
        // Nodes inside the brick and the bounds.
        std::set<std::uint32_t> nodes;
        const double edge = plan.frame().rootSpacingWorld * plan.frame().brickCells;
        for (const std::int32_t e : brick->elements)
            for (const std::int32_t n : mesh.tets[std::size_t(e)]) {
                const Vec3d& p = mesh.points[std::size_t(n)];
                if (Vec3i(glm::floor((p - origin) / edge)) != brick->key.index) continue;
                if (!boundsWorld || (glm::clamp(p, boundsWorld->min, boundsWorld->max) == p))
                    nodes.insert(std::uint32_t(n));
            }
        brick->samples.assign(nodes.begin(), nodes.end());
        sampleCount += nodes.size();
    }
    std::mt19937 random(seed);
    int splits = 0, merges = 0;
    for (int step = 0; step < 400; ++step) {
        const auto leaves = plan.leaves();
        const DepthKey key = leaves[random() % leaves.size()]->key;
        if (random() % 2 == 0) {
            if (key.depth == plan.frame().maxDepth || leaves.size() > 1500) continue;
            splits += plan.split({&key, 1}, ~std::size_t(0), {});
        } else if (key.depth > Depth(0)) {
            merges += plan.merge({key.depth - 1, key.index >> 1}, index);
        }
        if (step % 100 == 99) expectAsBuiltAnew(plan, mesh, sampleCount);
    }
    EXPECT_GT(sampleCount, 20u);
    EXPECT_GT(splits, 50);
    EXPECT_GT(merges, 20);
}

TEST(BrickPlan, HoldsAfterSplitsAndMergesWhatAPlanBuiltAnewHolds) {
    const TetMesh graded = gradedBoxMesh(7, 2.2, 0.2, 5);
    runRandomly(graded, {}, 1);
    runRandomly(graded, Box3d{{0.2, 0.3, 0.1}, {0.63, 0.55, 0.8}}, 2);
    runRandomly(thinTetsMesh(ThinKind::sliver, 1e-6, 0.2, 300, 7), {}, 3);
}

TEST(BrickPlan, TakesItsBricksFromTheIndexWithinBounds) {
    const TetMesh mesh = gradedBoxMesh(9, 2, 0.2, 6);
    const ElementIndex index(mesh);
    const PlanFrame frame = frameOf(mesh, Box3d{{0.4, 0.41, 0.45}, {0.5, 0.6, 0.55}}, 1.0 / 120);
    BrickPlan byPass(mesh, frame, {}), byIndex(mesh, frame, {}, &index);
    const auto expected = byPass.leaves(), got = byIndex.leaves();
    ASSERT_EQ(got.size(), expected.size());
    EXPECT_GT(got.size(), 3u);
    for (std::size_t i = 0; i < got.size(); ++i) {
        EXPECT_EQ(got[i]->key, expected[i]->key);
        EXPECT_EQ(got[i]->elements, expected[i]->elements);
    }
}

}  // namespace
}  // namespace tessera
