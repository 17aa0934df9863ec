#include "refine/refine.h"
#include "tessera/lattice.h"

#include <gtest/gtest.h>

#include "brick_test_meshes.h"
#include "brute_force_resampler.h"
#include "refine/brick_result.h"
#include "refine/plan.h"
#include "refine/refine_options.h"
#include "refine/resample_tree.h"
#include "tessera/error.h"

namespace tessera {
namespace {

double wave(const Vec3d& p) {
    return std::sin(4 * p.x) * std::cos(3 * p.y) + p.z * p.z;
}

RefineOptions optionsFor(Criterion criterion) {
    RefineOptions options;
    options.criterion = criterion;
    options.brickCells = 8;
    return options;
}

// Any two leaves whose closed boxes touch differ by at most one level.
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

BrickStore sample(const TetMesh& mesh, const BrickTree& tree) {
    const std::vector<int> fields{0};
    ResampleStatistics statistics;
    return resampleTree(tree, *BruteForceResampler().bind(mesh, fields, {}), 1, {}, statistics);
}

// Every covered point of every level's whole lattice over the mesh lies in a leaf, and the store holds
// exactly the covered points of the leaves' own levels.
void expectCompletelyCovered(const TetMesh& mesh, const BrickTree& tree, const BrickStore& store) {
    const std::vector<int> fields{0};
    const Box3d bounds = mesh.boundsWorld();
    std::int64_t expected = 0;
    for (int level = 0; level < tree.levelCount(); ++level) {
        const double h = tree.spacingWorld(level);
        const IndexBox box{Vec3i(glm::floor((bounds.min - tree.originWorld()) / h)) - 1,
                           Vec3i(glm::ceil((bounds.max - tree.originWorld()) / h)) + 2};
        const Block block = resampleBlock(BruteForceResampler(), mesh, fields, tree.lattice(level), box);
        for (int k = box.min.z; k < box.max.z; ++k)
            for (int j = box.min.y; j < box.max.y; ++j)
                for (int i = box.min.x; i < box.max.x; ++i) {
                    if (!block.covered({i, j, k})) continue;
                    const std::int64_t leaf = tree.findLeafAt(level, Vec3i(i, j, k));
                    ASSERT_GE(leaf, 0) << "level " << level << " point " << i << " " << j << " " << k;
                    if (tree.leaves()[std::size_t(leaf)].level != level) continue;
                    ++expected;
                    const Vec3i local =
                        Vec3i(i, j, k) - tree.leaves()[std::size_t(leaf)].index * tree.brickCells();
                    bool covered = false;
                    ASSERT_EQ(store.value(std::size_t(leaf), local, 0, covered), block.value(0, {i, j, k}));
                    ASSERT_TRUE(covered);
                }
    }
    EXPECT_EQ(store.coveredPoints(), expected);
}

TEST(PlanBricks, ResolutionPutsPointsFromBoundsToBounds) {
    const TetMesh mesh = gridMesh({2, 3, 4}, {-1, 5, 2}, {0.5, 6, 5});
    for (const int points : {2, 17, 64, 100, 129}) {
        RefineOptions options = optionsFor(Criterion::uniform);
        options.resolution = points;
        const BrickTree tree = planBricks(mesh, options, {});
        EXPECT_EQ(tree.originWorld(), Vec3d(-1, 5, 2));
        EXPECT_DOUBLE_EQ(tree.spacingWorld(), 3.0 / (points - 1));
        EXPECT_EQ(tree.levelCount(), 1);
        int last = 0;
        for (const BrickKey& key : tree.leaves()) {
            EXPECT_GE(std::min({key.index.x, key.index.y, key.index.z}), 0);
            last = std::max(last, key.index.z);
        }
        EXPECT_EQ(last, (points - 1) / 8)
            << "the last lattice point has an owner, and nothing lies beyond it";
    }
}

TEST(PlanBricks, EveryCoveredPointHasAnOwner) {
    struct Case {
        TetMesh mesh;
        int resolution, levels;
    };
    std::vector<Case> cases;
    cases.push_back(
        {gridMesh({3, 3, 3}, Vec3d(0), Vec3d(1)), 33, 1});  // the mesh ends exactly on a brick's face
    cases.push_back({gridMesh({3, 3, 3}, Vec3d(0), Vec3d(1)), 32, 1});
    cases.push_back({ballMesh(6, 1.0), 61, 1});
    cases.push_back({gradedMesh(8, 3.0), 129, 4});
    cases.push_back({gradedMesh(7, 2.5), 100, 3});
    for (Case& c : cases) {
        addPointField(c.mesh, "wave", wave);
        RefineOptions options = optionsFor(c.levels == 1 ? Criterion::uniform : Criterion::elementSize);
        options.resolution = c.resolution;
        options.maxLevels = c.levels;
        const BrickTree tree = planBricks(c.mesh, options, {});
        if (c.levels > 1) {
            EXPECT_GT(tree.levelCount(), 1);
        }
        expectBalanced(tree);
        expectCompletelyCovered(c.mesh, tree, sample(c.mesh, tree));
    }
}

TEST(PlanBricks, AFixedFrameWithAnyOriginCoversEverythingToo) {
    TetMesh mesh = ballMesh(5, 1.0);
    addPointField(mesh, "wave", wave);
    for (const Criterion criterion : {Criterion::uniform, Criterion::elementSize}) {
        RefineOptions options = optionsFor(criterion);
        options.frame = FixedFrame{{0.123, 7.5, -3.1}, 0.0371};
        const BrickTree tree = planBricks(mesh, options, {});
        EXPECT_EQ(tree.originWorld(), options.frame->originWorld);
        EXPECT_EQ(tree.spacingWorld(), 0.0371) << "level 0 has the frame's spacing";
        expectCompletelyCovered(mesh, tree, sample(mesh, tree));
    }
}

TEST(PlanBricks, EmptySpaceIsNotAllocated) {
    // Two small cubes at opposite corners of a large box.
    TetMesh mesh = gridMesh({1, 1, 1}, Vec3d(0), Vec3d(1));
    const TetMesh other = gridMesh({1, 1, 1}, Vec3d(99), Vec3d(100));
    for (const Vec3d& p : other.points) mesh.points.push_back(p);
    for (const auto& tet : other.tets) mesh.tets.push_back({tet[0] + 8, tet[1] + 8, tet[2] + 8, tet[3] + 8});
    RefineOptions options = optionsFor(Criterion::uniform);
    options.resolution = 1601;  // 16 cells a unit, 200 bricks a side
    const BrickTree tree = planBricks(mesh, options, {});
    EXPECT_EQ(tree.leafCount(), 54u) << "27 at each end: the far side of both cubes lies on brick faces";
}

TEST(PlanBricks, ASlantedSheetTouchesOnlyBricksAlongIt) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {64, 0, 64}, {0, 64, 0}, {0, 0.0, 0.5}};
    mesh.tets = {{0, 1, 2, 3}};
    RefineOptions options = optionsFor(Criterion::uniform);
    options.spacingWorld = 1;
    const BrickTree tree = planBricks(mesh, options, {});
    // In x and z the sheet follows the diagonal: no brick lies more than one off it.
    for (const BrickKey& key : tree.leaves()) EXPECT_LE(std::abs(key.index.x - key.index.z), 1);
    EXPECT_LT(tree.leafCount(), 120u) << "of the 729 of its bounding box";
}

TEST(PlanBricks, PlansAreTheSameForAnyNumberOfThreads) {
    const TetMesh mesh = gradedMesh(20, 3.0);
    for (const Criterion criterion : {Criterion::uniform, Criterion::elementSize}) {
        RefineOptions options = optionsFor(criterion);
        options.resolution = 257;
        Execution one, five;
        one.threads = 1;
        five.threads = 5;
        const BrickTree a = planBricks(mesh, options, one), b = planBricks(mesh, options, five);
        EXPECT_TRUE(std::equal(a.leaves().begin(), a.leaves().end(), b.leaves().begin(), b.leaves().end()));
    }
}

TEST(PlanBricks, ElementSizePutsFineBricksWhereElementsAreSmall) {
    const TetMesh mesh = gradedMesh(12, 4.0);
    const BrickTree tree = planBricks(mesh, optionsFor(Criterion::elementSize), {});
    EXPECT_GT(tree.levelCount(), 3);
    EXPECT_EQ(tree.leaves()[std::size_t(tree.findLeafAt(Vec3d(0.5)))].level, 0);
    const double far = 0.9 / tree.spacingWorld();
    EXPECT_EQ(tree.leaves()[std::size_t(tree.findLeafAt(Vec3d(far)))].level, tree.levelCount() - 1);
}

TEST(PlanBricks, BudgetsAreKeptOrSaySoWithWhatFits) {
    const TetMesh mesh = gradedMesh(12, 4.0);
    RefineOptions options = optionsFor(Criterion::uniform);
    options.resolution = 500;
    options.maxVoxels = 1'000'000;
    int fits = 0;
    try {
        planBricks(mesh, options, {});
        FAIL() << "over the budget";
    } catch (const InputError& error) {
        const std::string text = error.what();
        const auto at = text.find("a resolution of ");
        ASSERT_NE(at, std::string::npos) << text;
        fits = std::atoi(text.c_str() + at + 16);
    }
    EXPECT_GE(fits, 90);
    options.resolution = fits;
    const BrickTree tree = planBricks(mesh, options, {});
    EXPECT_LE(estimatePlan(tree, 1).storedPoints, options.maxVoxels);

    options.criterion = Criterion::elementSize;
    options.resolution = 0;
    options.samplesPerElement = 12;
    std::vector<std::string> notes;
    const BrickTree coarsened = planBricks(mesh, options, {}, 1, &notes);
    EXPECT_LE(estimatePlan(coarsened, 1).storedPoints, options.maxVoxels);
    EXPECT_EQ(notes.size(), 1u);
    options.resolution = 2000;
    EXPECT_THROW(planBricks(mesh, options, {}), InputError);
}

TEST(PlanBricks, RejectsOptionsOutOfRange) {
    const TetMesh mesh = gridMesh({1, 1, 1}, Vec3d(0), Vec3d(1));
    const auto rejects = [&](auto change) {
        RefineOptions options = optionsFor(Criterion::uniform);
        change(options);
        EXPECT_THROW(planBricks(mesh, options, {}), InputError);
    };
    rejects([](RefineOptions& o) { o.brickCells = 12; });
    rejects([](RefineOptions& o) { o.resolution = 1; });
    rejects([](RefineOptions& o) { o.spacingWorld = -1; });
    rejects([](RefineOptions& o) { o.spacingWorld = std::numeric_limits<double>::quiet_NaN(); });
    rejects([](RefineOptions& o) { o.spacingWorld = 1e-12; });
    rejects([](RefineOptions& o) { o.spacingWorld = 0.1, o.resolution = 12; });
    rejects([](RefineOptions& o) { o.boundsWorld = Box3d{Vec3d(2), Vec3d(3)}; });
    rejects([](RefineOptions& o) { o.boundsWorld = Box3d{Vec3d(1), Vec3d(0)}; });
    EXPECT_THROW(planBricks(TetMesh{}, optionsFor(Criterion::uniform), {}), InputError);
}

TEST(PlanBricks, TinyHugeAndShiftedMeshesGiveTheSameBricks) {
    std::size_t leaves = 0;
    for (const double scale : {1.0, 1e-9, 1e9}) {
        TetMesh mesh = ballMesh(8, 1.0);
        for (Vec3d& p : mesh.points) p *= scale;
        RefineOptions options = optionsFor(Criterion::elementSize);
        options.resolution = 200;
        const std::size_t count = planBricks(mesh, options, {}).leafCount();
        if (leaves == 0) leaves = count;
        EXPECT_NEAR(double(count), double(leaves), 0.01 * double(leaves));
    }
    TetMesh shifted = ballMesh(8, 1.0);
    for (Vec3d& p : shifted.points) p += 1e6;
    addPointField(shifted, "x", [](const Vec3d& p) { return p.x - 1e6; });
    RefineOptions options = optionsFor(Criterion::elementSize);
    options.resolution = 100;
    const std::vector<int> fields{0};
    const BrickResult result = refineAndResample(shifted, fields, BruteForceResampler(), options, {});
    EXPECT_EQ(result.report.outsideBricks, 0);
    EXPECT_GT(result.report.coveredPoints, 10000);
}

TEST(RefineAndResample, BoundsCutTheMeshAndWhatIsInsideIsMeasuredExactly) {
    TetMesh mesh = gridMesh({8, 8, 8}, Vec3d(0), Vec3d(1));
    addPointField(mesh, "linear", [](const Vec3d& p) { return p.x + 2 * p.y - p.z; });
    const std::vector<int> fields{0};
    for (const Criterion criterion : {Criterion::uniform, Criterion::elementSize, Criterion::error}) {
        RefineOptions options = optionsFor(criterion);
        options.boundsWorld = Box3d{Vec3d(0.21), Vec3d(0.57, 0.6, 0.63)};
        options.maxError = 0.01;
        options.resolution = criterion == Criterion::uniform ? 50 : 0;
        const BrickResult result = refineAndResample(mesh, fields, BruteForceResampler(), options, {});
        EXPECT_GT(result.report.outsideBricks, 100);
        EXPECT_GT(result.report.nodes, 20);
        EXPECT_LT(result.report.fields[0].relativeMax, 1e-6) << "corners beyond the bounds are sampled too";
    }
}

TEST(RefineByError, KeepsTheBoundOnTheFinalTree) {
    TetMesh mesh = gradedMesh(16, 3.0);
    addPointField(mesh, "peak", [](const Vec3d& p) { return std::exp(-200 * glm::dot(p, p)); });
    const std::vector<int> fields{0};
    for (const double bound : {0.05, 0.01}) {
        RefineOptions options = optionsFor(Criterion::error);
        options.maxError = bound;
        const BrickResult result = refineAndResample(mesh, fields, BruteForceResampler(), options, {});
        EXPECT_TRUE(result.bounded) << result.stoppedBecause;
        EXPECT_TRUE(result.stoppedBecause.empty());
        EXPECT_LE(result.report.fields[0].relativeMax, bound);
        EXPECT_GT(result.tree.levelCount(), 1);
        expectBalanced(result.tree);
        expectCompletelyCovered(mesh, result.tree, result.store);
        // A uniform tree as fine as the finest bricks needs many times more.
        EXPECT_LT(estimatePlan(result.tree, 1).storedPoints * 3, estimatePlan(result.tree, 1).flatPoints);
    }
}

TEST(RefineByError, SaysWhichBudgetEndedItAndWhere) {
    TetMesh mesh = gradedMesh(10, 2.0);
    addPointField(mesh, "peak", [](const Vec3d& p) { return std::exp(-20 * glm::dot(p, p)); });
    const std::vector<int> fields{0};
    RefineOptions options = optionsFor(Criterion::error);
    options.maxError = 1e-4;
    options.maxVoxels = 60'000;
    const BrickResult result = refineAndResample(mesh, fields, BruteForceResampler(), options, {});
    EXPECT_FALSE(result.bounded);
    EXPECT_NE(result.stoppedBecause.find("voxels"), std::string::npos) << result.stoppedBecause;
    EXPECT_NE(result.stoppedBecause.find("worst spot"), std::string::npos) << result.stoppedBecause;
    EXPECT_LE(estimatePlan(result.tree, 1).storedPoints, options.maxVoxels);
    expectBalanced(result.tree);
    expectCompletelyCovered(mesh, result.tree, result.store);

    options.maxVoxels = 0;
    options.maxLevels = 2;
    const BrickResult shallow = refineAndResample(mesh, fields, BruteForceResampler(), options, {});
    EXPECT_FALSE(shallow.bounded);
    EXPECT_NE(shallow.stoppedBecause.find("finest spacing"), std::string::npos) << shallow.stoppedBecause;
    EXPECT_LE(shallow.tree.levelCount(), 2);
}

TEST(RefineByError, RmsRefinesCellFieldsAndMaxRefusesThem) {
    TetMesh mesh = gradedMesh(6, 2.0);
    const int cell = addCellField(mesh, "band", [](std::int64_t e) { return double(e % 6 < 3); });
    const std::vector<int> fields{cell};
    RefineOptions options = optionsFor(Criterion::error);
    options.maxError = 0.2;
    options.errorFields = {cell};
    try {
        refineAndResample(mesh, fields, BruteForceResampler(), options, {});
        FAIL() << "a cell field's maximum never converges";
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find("--error-measure rms"), std::string::npos);
    }
    options.measure = ErrorMeasure::rms;
    const BrickResult result = refineAndResample(mesh, fields, BruteForceResampler(), options, {});
    EXPECT_TRUE(result.bounded) << result.stoppedBecause;
    EXPECT_LE(result.report.fields[0].relativeRms, 0.2);
}

TEST(RefineByError, RejectsABoundBelowFloatPrecision) {
    TetMesh mesh = gridMesh({2, 2, 2}, Vec3d(0), Vec3d(1));
    addPointField(mesh, "offset", [](const Vec3d& p) { return 1e6 + p.x; });
    const std::vector<int> fields{0};
    RefineOptions options = optionsFor(Criterion::error);
    options.maxError = 0.01;
    EXPECT_THROW(refineAndResample(mesh, fields, BruteForceResampler(), options, {}), InputError);
}

TEST(RefineByError, ResultsAreTheSameForAnyNumberOfThreads) {
    TetMesh mesh = gradedMesh(8, 2.0);
    addPointField(mesh, "wave", wave);
    const std::vector<int> fields{0};
    RefineOptions options = optionsFor(Criterion::error);
    options.maxError = 0.02;
    Execution execution;
    execution.threads = 1;
    const BrickResult first = refineAndResample(mesh, fields, BruteForceResampler(), options, execution);
    for (const int threads : {2, 5}) {
        execution.threads = threads;
        const BrickResult again = refineAndResample(mesh, fields, BruteForceResampler(), options, execution);
        ASSERT_TRUE(std::equal(first.tree.leaves().begin(), first.tree.leaves().end(),
                               again.tree.leaves().begin(), again.tree.leaves().end()));
        EXPECT_EQ(first.report.fields[0].max, again.report.fields[0].max);
        EXPECT_EQ(first.report.fields[0].rms, again.report.fields[0].rms);
        EXPECT_EQ(first.report.fields[0].p999, again.report.fields[0].p999);
        EXPECT_EQ(first.report.fields[0].integralLattice, again.report.fields[0].integralLattice);
    }
}

TEST(RefineAndResample, StopsWhenCancelled) {
    TetMesh mesh = gradedMesh(6, 2.0);
    addPointField(mesh, "wave", wave);
    const std::vector<int> fields{0};
    std::atomic<bool> cancel{true};
    Execution execution;
    execution.cancel = &cancel;
    for (const Criterion criterion : {Criterion::uniform, Criterion::elementSize, Criterion::error}) {
        RefineOptions options = optionsFor(criterion);
        options.maxError = 0.01;
        EXPECT_THROW(refineAndResample(mesh, fields, BruteForceResampler(), options, execution), Cancelled);
    }
}

}  // namespace
}  // namespace tessera
