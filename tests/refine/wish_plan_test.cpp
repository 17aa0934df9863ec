#include "refine/wish_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "brick_test_meshes.h"
#include "refine/brick_touch.h"
#include "refine/plan.h"
#include "refine/plan_frame.h"
#include "refine/wishes.h"
#include "tessera/error.h"

namespace tessera {
namespace {

RefineOptions optionsFor(Criteria criteria, int resolution) {
    RefineOptions options;
    options.criterion = criteria;
    options.brickCells = 8;
    options.resolution = resolution;
    options.focus = {pointFocus({0.3, 0.2, 0.1}, 0.1)};
    return options;
}

using Leaves = std::set<std::array<int, 4>>;
Leaves leavesOf(const BrickTree& tree) {
    Leaves leaves;
    for (const BrickKey& key : tree.leaves())
        leaves.insert({key.level, key.index.x, key.index.y, key.index.z});
    return leaves;
}

/// The closed box of a leaf.
Box3d boxOf(const BrickTree& tree, const BrickKey& key) {
    const double edge = tree.spacingWorld(key.level) * tree.brickCells();
    const Vec3d low = tree.originWorld() + Vec3d(key.index) * edge;
    return {low, low + edge};
}

void expectBalanced(const BrickTree& tree) {
    for (const BrickKey& key : tree.leaves())
        for (int n = 0; n < 27; ++n) {
            const BrickKey near{key.level, key.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)};
            const std::int64_t other = tree.findCovering(near);
            if (other >= 0) {
                ASSERT_LE(tree.leaves()[std::size_t(other)].level, key.level + 1);
            }
        }
}

TEST(SplitQueue, GivesTheLargestFirstAndOfEqualOnesTheFirst) {
    SplitQueue queue;
    EXPECT_FALSE(queue.pop().has_value());
    std::mt19937 random(3);
    std::vector<double> values;
    for (std::uint32_t n = 0; n < 5000; ++n) {
        values.push_back(std::exp2(std::uniform_real_distribution<double>(-70, 70)(random)));
        queue.push(values.back(), n);
        if (n % 3 == 0) queue.pop();
    }
    double last = 1e300;
    while (const auto number = queue.pop()) {
        // Beyond the range that is told apart all are alike.
        const double value = std::clamp(values[*number], 0x1p-65, 0x1p63);
        EXPECT_LE(value, last * (1 + 1.0 / 8));
        last = value;
    }
    EXPECT_TRUE(queue.empty());
    for (std::uint32_t n = 0; n < 3; ++n) queue.push(1.01 + 0.01 * n, n);
    for (std::uint32_t n = 0; n < 3; ++n) EXPECT_EQ(*queue.pop(), n);
}

TEST(WishPlan, ByElementSizeAloneIsThePlanByElementSize) {
    for (const TetMesh& mesh : {gradedMesh(8, 2.5), ballMesh(10, 0.7)})
        for (const int resolution : {0, 150}) {
            RefineOptions options = optionsFor(Criterion::elementSize, resolution);
            options.samplesPerElement = 4;
            const BrickTree tree = planBricks(mesh, options, {});
            WishPlanning planning(mesh, mesh.boundsWorld(), options, GrowingTree::kNoLimit, {});
            planning.plan.complete();
            EXPECT_EQ(leavesOf(planning.plan.brickTree(planning.plan.deepest())), leavesOf(tree));
            EXPECT_GE(tree.levelCount(), 2);
        }
}

// From the formula alone: a leaf has the spacing nearest to the finest wish in it, or balance asks for a
// finer one.
TEST(WishPlan, AroundAFocusFollowsTheDistance) {
    const TetMesh mesh = ballMesh(8, 1);
    const RefineOptions options = optionsFor(Criterion::focus, 256);
    const BrickTree tree = planBricks(mesh, options, {});
    expectBalanced(tree);
    const double finest = 2.0 / 255;
    EXPECT_NEAR(tree.spacingWorld(0), finest, 1e-12);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> share(0, 1);
    std::size_t needless = 0;
    const auto wished = [&](const Vec3d& p) {
        return std::sqrt(2.0) * finest * std::max(1.0, glm::distance(p, options.focus[0].boxWorld.min) / 0.1);
    };
    const Box3d bounds = mesh.boundsWorld();
    for (const BrickKey& key : tree.leaves()) {
        const Box3d box = boxOf(tree, key);
        const double spacing = tree.spacingWorld(key.level);
        for (int i = 0; i < 50; ++i) {
            const Vec3d p = glm::mix(box.min, box.max, Vec3d(share(random), share(random), share(random)));
            if (glm::clamp(p, bounds.min, bounds.max) != p) continue;
            EXPECT_LE(spacing, wished(p) * (1 + 1e-6));
        }
        const Box3d parent = boxOf(tree, {key.level + 1, key.index >> 1});
        const Vec3d nearest = glm::clamp(options.focus[0].boxWorld.min, parent.min, parent.max);
        needless += key.level + 1 < tree.levelCount() && 2 * spacing <= wished(nearest);
    }
    // The wish grows more slowly than bricks do, so balance hardly ever asks for more.
    EXPECT_LT(double(needless), 0.05 * double(tree.leafCount()));
    EXPECT_GE(tree.levelCount(), 3);
}

TEST(WishPlan, CombinedCriteriaAreTheFinestOfBoth) {
    const TetMesh mesh = gradedMesh(8, 2.5);
    RefineOptions options = optionsFor(Criterion::elementSize, 200);
    options.samplesPerElement = 3;
    options.focus = {pointFocus({0.8, 0.8, 0.9}, 0.05)};
    const BrickTree bySize = planBricks(mesh, options, {});
    options.criterion = Criterion::focus;
    const BrickTree byFocus = planBricks(mesh, options, {});
    options.criterion = Criterion::elementSize | Criterion::focus;
    const BrickTree both = planBricks(mesh, options, {});
    expectBalanced(both);
    for (const BrickTree* single : {&bySize, &byFocus})
        for (const BrickKey& key : single->leaves())
            EXPECT_TRUE(both.findLeaf(key) >= 0 || both.isRefined(key));
    EXPECT_LE(both.leafCount(), bySize.leafCount() + byFocus.leafCount());
    EXPECT_GT(both.leafCount(), std::max(bySize.leafCount(), byFocus.leafCount()));
}

TEST(WishPlan, ALimitKeepsTheBestSplits) {
    const TetMesh mesh = ballMesh(8, 1);
    RefineOptions options = optionsFor(Criterion::focus, 256);
    const std::size_t all = planBricks(mesh, options, {}).leafCount();
    options.maxVoxels = std::int64_t(all) / 2 * 512;
    std::vector<std::string> notes;
    const BrickTree half = planBricks(mesh, options, {}, 1, &notes);
    expectBalanced(half);
    EXPECT_LE(half.leafCount(), all / 2);
    EXPECT_GT(half.leafCount(), all / 2 - 60);
    ASSERT_EQ(notes.size(), 1u);
    EXPECT_NE(notes[0].find("coarser than wished for"), std::string::npos) << notes[0];
    // The focus itself is as fine as ever.
    const Vec3d index0 = (options.focus[0].boxWorld.min - half.originWorld()) / half.spacingWorld();
    const std::int64_t leaf = half.findLeafAt(index0);
    ASSERT_GE(leaf, 0);
    EXPECT_NEAR(half.spacingWorld(half.leaves()[std::size_t(leaf)].level), 2.0 / 255, 1e-12);
    options.maxVoxels = 512;
    EXPECT_THROW(planBricks(mesh, options, {}), InputError);
}

TEST(WishPlan, GivesBalanceFirstAndStaysBalanced) {
    const TetMesh mesh = gradedMesh(6, 2);
    const RefineOptions options = optionsFor(Criterion::elementSize | Criterion::focus, 200);
    WishPlanning planning(mesh, mesh.boundsWorld(), options, GrowingTree::kNoLimit, {});
    GrowingTree shown(planning.bricks.roots());
    std::size_t splits = 0;
    while (const auto split = planning.plan.next()) {
        shown.split(
            planning.bricks.key(split->brick),
            [&](std::span<const GrowingLeaf>, std::span<ChildBits> bits) { bits[0] = split->children; });
        ASSERT_EQ(shown.change().removed.size(), 1u);
        ++splits;
    }
    EXPECT_GT(splits, 20u);
    const auto leaves = shown.leaves();
    const auto planned = planning.plan.leaves();
    ASSERT_EQ(leaves.size(), planned.size());
    ASSERT_EQ(leaves.size(), planning.plan.leafCount());
    for (std::size_t i = 0; i < leaves.size(); ++i) EXPECT_EQ(leaves[i].key, planning.bricks.key(planned[i]));
}

TEST(ExpectedPoints, AreThoseOfTheLatticeOrOfTheElements) {
    const TetMesh mesh = ballMesh(7, 0.9);
    const Box3d bounds{Vec3d(0), Vec3d(2, 1, 1)};
    RefineOptions options;
    options.criterion = Criterion::uniform;
    options.resolution = 101;
    EXPECT_NEAR(double(expectedPoints(mesh, bounds, options)), 101 * 51 * 51, 1);
    options.boundsWorld = Box3d{Vec3d(1, 0.5, -1), Vec3d(3, 2, 2)};  // 101 points along 3
    EXPECT_NEAR(double(expectedPoints(mesh, bounds, options)),
                (1 / 0.03 + 1) * (0.5 / 0.03 + 1) * (1 / 0.03 + 1), 1);
    options.boundsWorld.reset();
    options.criterion = Criterion::elementSize;
    EXPECT_EQ(expectedPoints(mesh, bounds, options),
              std::min<std::int64_t>(8 * mesh.elementCount(), 101 * 51 * 51));
    options.maxVoxels = 16 * 16 * 16;
    EXPECT_EQ(expectedPoints(mesh, bounds, options), 16 * 16 * 16);
    // Not yet checked ones.
    options.samplesPerElement = std::nan("");
    options.spacingWorld = std::nan("");
    options.resolution = -3;
    EXPECT_GE(expectedPoints(mesh, Box3d(), options), 1);
}

// The bricks are those that lists of elements give, within bounds too.
TEST(MeshBricks, FindTheBricksThatHoldElements) {
    for (const bool bounded : {false, true}) {
        const TetMesh mesh = ballMesh(7, 0.9);
        RefineOptions options = optionsFor(Criterion::focus, 100);
        if (bounded) options.boundsWorld = Box3d{Vec3d(-0.2, 0.1, -0.5), Vec3d(0.7, 0.6, 0.8)};
        const PlanFrame frame = chooseFrame(mesh.boundsWorld(), options);
        BrickPlan plan(mesh, frame, {});
        const auto index = std::make_shared<const SharedElementIndex>(mesh);
        MeshBricks bricks(index, frame, 0, {});
        ASSERT_EQ(bricks.roots().size(), plan.leafCount());
        for (int depth = 0; depth < 3; ++depth) {
            std::vector<DepthKey> split;
            for (const PlannedBrick* leaf : plan.leaves()) {
                if (leaf->key.depth == Depth(depth)) split.push_back(leaf->key);
                const auto near = double(index->get({}).count(boxAround(leaf->key, frame)));
                const auto number = bricks.find(leaf->key);
                ASSERT_TRUE(number.has_value());
                EXPECT_GE(double(bricks.elementsNear(*number)), near / 3 - 8);
                EXPECT_LE(double(bricks.elementsNear(*number)), 4 * near + 32);
            }
            std::vector<DepthKey> expected, found;
            plan.split(split, GrowingTree::kNoLimit, {});
            for (const PlannedBrick* child : plan.leaves())
                if (child->key.depth == Depth(depth + 1)) expected.push_back(child->key);
            for (const DepthKey& key : split) {
                const MeshBricks::Number number = *bricks.find(key);
                const ChildBits children = bricks.children(number);
                for (unsigned c = 0; c < 8; ++c)
                    if (children >> c & 1) found.push_back(childKey(key, c));
            }
            for (auto* keys : {&expected, &found})
                std::sort(keys->begin(), keys->end(),
                          [](const DepthKey& a, const DepthKey& b) { return inStorageOrder(a, b); });
            EXPECT_EQ(found, expected);
        }
    }
}

TEST(Focus, OfACameraIsAsFineAsItsPixels) {
    Camera camera;
    camera.eyeWorld = {0, 0, 5};
    camera.openingDegrees = 60;
    camera.widthPixels = 200;
    camera.heightPixels = 100;
    const double finest = 0.01;
    const Focus focus = cameraFocus(camera, finest);
    const auto wished = [&](const Vec3d& p) { return wishedByFocus({&focus, 1}, finest, {p, p}); };
    for (const double distance : {0.1, 1.0, 3.0, 8.0}) {
        const double pixel = 2 * distance * std::tan(M_PI / 6) / 100;
        EXPECT_NEAR(wished({0, 0, 5 - distance}), std::max(finest, pixel), 1e-9);
        // Borders of the picture: twice as wide as high.
        const double half = distance * std::tan(M_PI / 6);
        EXPECT_LT(wished({1.99 * half, 0.99 * half, 5 - distance}), kNoWish);
        EXPECT_EQ(wished({2.01 * half, 0, 5 - distance}), kNoWish);
        EXPECT_EQ(wished({0, -1.01 * half, 5 - distance}), kNoWish);
    }
    EXPECT_EQ(wished({0, 0, 5.1}), kNoWish);
    camera.upWorld = camera.forwardWorld;
    EXPECT_THROW(cameraFocus(camera, finest), InputError);
}

TEST(Focus, OfABoxAndABallCountDistancesFromTheirSurface) {
    const Focus shapes[] = {boxFocus({Vec3d(0), Vec3d(1)}, 0.5), pointFocus({3, 0, 0}, 0.5, 1)};
    EXPECT_EQ(wishedByFocus({shapes, 1}, 0.1, {Vec3d(0.2, 0.4, 0.9), Vec3d(0.3, 2, 3)}), 0.1);
    EXPECT_NEAR(wishedByFocus({shapes, 1}, 0.1, {Vec3d(2, 0, 0), Vec3d(3, 1, 1)}), 0.2, 1e-12);
    EXPECT_NEAR(wishedByFocus({shapes + 1, 1}, 0.1, {Vec3d(6, 0, 0), Vec3d(7, 1, 1)}), 0.4, 1e-12);
    EXPECT_EQ(wishedByFocus({shapes + 1, 1}, 0.1, {Vec3d(4.4, 0, 0), Vec3d(7, 1, 1)}), 0.1);
    EXPECT_EQ(wishedByFocus({}, 0.1, {Vec3d(0), Vec3d(1)}), kNoWish);
    EXPECT_THROW(checkFocus(std::vector{pointFocus(Vec3d(0), 0)}), InputError);
    EXPECT_THROW(checkFocus(std::vector{pointFocus({0, NAN, 0}, 1)}), InputError);
}

TEST(Focus, JitterIsASmallMove) {
    const std::vector<Focus> at{pointFocus({1, 2, 3}, 0.5)};
    EXPECT_TRUE(isJitter(at, at, 0.01));
    EXPECT_TRUE(isJitter(at, std::vector{pointFocus({1.03, 2, 3}, 0.5)}, 0.01));
    EXPECT_FALSE(isJitter(at, std::vector{pointFocus({1.04, 2, 3}, 0.5)}, 0.01));
    EXPECT_TRUE(isJitter(at, std::vector{pointFocus({1.04, 2, 3}, 0.5)}, 0.03));
    EXPECT_FALSE(isJitter(at, std::vector{pointFocus({1, 2, 3}, 0.4)}, 0.01));
    EXPECT_FALSE(isJitter(at, {}, 0.01));
}

}  // namespace
}  // namespace tessera
