#include "schedule/brick_scheduler.h"

#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "base/sanitizers.h"
#include "schedule/random_schedule.h"
#include "schedule/schedule_bricks.h"
#include "software/software_resampler.h"

namespace tessera {
namespace {

using Clock = BrickScheduler::Clock;

#define TESSERA_ON_ONE_THREAD \
    if (kIsThreadSanitized) GTEST_SKIP() << "runs on one thread: nothing for this sanitizer to find"

struct Bench : ScheduleBench {
    Bench(TetMesh made, const ScheduleOptions& with)
        : ScheduleBench(std::move(made), with, std::make_unique<SoftwareResampler>()) {}
};

TEST(Schedule, AtRestShowsThePlan) {
    for (const Criteria criteria : {Criteria(Criterion::focus), Criteria(Criterion::elementSize),
                                    Criterion::elementSize | Criterion::focus}) {
        Bench bench(ballMesh(8, 1), optionsFor(criteria, 100'000));
        EXPECT_EQ(bench.scheduler->tree().leafCount(), 0u);
        bench.scheduler->finish({.threads = 2});
        bench.expectWhole();
        bench.expectDomainCovered();
        bench.expectPlan(bench.budget());
        EXPECT_FALSE(bench.scheduler->isCutShort());
        EXPECT_EQ(bench.scheduler->counts().dropped, 0);
        EXPECT_TRUE(bench.scheduler->update(Clock::now()));
        const std::int64_t sampled = bench.scheduler->counts().sampled;
        EXPECT_EQ(bench.scheduler->bytes(), sampled * bench.scheduler->brickBytes());
    }
}

TEST(Schedule, CoarseBricksComeFirstAndAtOnce) {
    TESSERA_ON_ONE_THREAD;
    Bench bench(ballMesh(8, 1), optionsFor(Criterion::focus, 100'000));
    std::vector<std::size_t> sizes;
    bench.target->afterEach = [&] { sizes.push_back(bench.target->leaves.size()); };
    while (!bench.scheduler->update(Clock::now())) {
    }
    const auto index = std::make_shared<const SharedElementIndex>(bench.mesh);
    EXPECT_EQ(sizes.front(), MeshBricks(index, bench.frame, 0, {}).roots().size());
    EXPECT_GT(sizes.size(), 10u);
}

TEST(Schedule, ThreadsOfItsOwnWorkBetweenCalls) {
    ScheduleOptions options = optionsFor(Criterion::focus, 100'000);
    options.threads = 2;
    Bench bench(ballMesh(8, 1), options);
    int calls = 0;
    for (; !bench.scheduler->publish() && calls < 20'000; ++calls)
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    EXPECT_GT(calls, 0);
    bench.expectWhole();
    bench.expectPlan(bench.budget());
    // It may end with work begun.
    bench.scheduler->setFocus({pointFocus({-0.5, -0.4, 0.2}, 0.1)});
    bench.scheduler->publish();
}

TEST(Schedule, JitterMovesNothing) {
    TESSERA_ON_ONE_THREAD;
    Bench bench(ballMesh(8, 1), optionsFor(Criterion::focus, 2'000));
    bench.scheduler->finish();
    const ScheduleCounts before = bench.scheduler->counts();
    std::mt19937 random(3);
    std::uniform_real_distribution<double> voxel(-2.0 / 199, 2.0 / 199);
    for (int frame = 0; frame < 1000; ++frame) {
        const Vec3d moved =
            Vec3d(0.3, 0.2, 0.1) + Vec3d(voxel(random), voxel(random), voxel(random)) / std::sqrt(3.0);
        EXPECT_FALSE(bench.scheduler->setFocus({pointFocus(moved, 0.1)}));
        EXPECT_TRUE(bench.scheduler->update(Clock::now()));
    }
    EXPECT_EQ(bench.scheduler->counts().sampled, before.sampled);
    EXPECT_EQ(bench.scheduler->counts().dropped, before.dropped);
    EXPECT_EQ(bench.scheduler->counts().published, before.published);
}

TEST(Schedule, ComingBackSamplesNothing) {
    TESSERA_ON_ONE_THREAD;
    Bench bench(ballMesh(8, 1), optionsFor(Criterion::focus, 100'000));
    bench.scheduler->finish();
    bench.scheduler->setFocus({pointFocus({-0.5, -0.4, 0.2}, 0.1)});
    bench.scheduler->finish();
    bench.expectPlan(bench.budget());
    const std::int64_t sampled = bench.scheduler->counts().sampled;
    EXPECT_TRUE(bench.scheduler->setFocus({pointFocus({0.3, 0.2, 0.1}, 0.1)}));
    bench.scheduler->finish();
    EXPECT_EQ(bench.scheduler->counts().sampled, sampled);
    EXPECT_GT(bench.scheduler->counts().reused, 0);
    bench.expectPlan(bench.budget());
    bench.scheduler->forget();
    bench.scheduler->setFocus({pointFocus({-0.5, -0.4, 0.2}, 0.1)});
    bench.scheduler->finish();
    EXPECT_GT(bench.scheduler->counts().sampled, sampled);
}

// Measured without the scheduler: no leaf has an error beyond the bound, but at the finest spacing.
TEST(Schedule, ByErrorEndsWithinTheBound) {
    TESSERA_ON_ONE_THREAD;
    ScheduleOptions options = optionsFor(Criterion::error, 100'000);
    options.refine.maxError = 0.006;
    Bench bench(ballMesh(8, 1), options);
    bench.scheduler->finish();
    std::size_t fine = 0;
    for (const GrowingLeaf& leaf : bench.scheduler->tree().leaves()) {
        const float worst = bench.findingsAlone(leaf.key).worst;
        EXPECT_TRUE(worst <= 1 || leaf.key.depth == bench.frame.maxDepth) << worst;
        fine += leaf.key.depth > Depth(0);
    }
    EXPECT_GT(fine, 50u);
}

/// Keeps nothing.
struct NoArchive : BrickArchive {
    bool contains(const DepthKey&) const override { return false; }
    std::shared_ptr<const Block> read(const DepthKey&, const Lattice&, const IndexBox&) const override {
        return nullptr;
    }
    void append(const DepthKey&, const Block&) override {}
};

// Measured over all bricks together: on borders the coarser one decides. Of vectors the length counts.
TEST(Schedule, BricksKeepToTheBoundAcrossBorders) {
    TESSERA_ON_ONE_THREAD;
    TetMesh mesh = meshWithField(ballMesh(6, 1));
    Field& vectors = mesh.fields.emplace_back(mesh.fields[0]);
    vectors.name = "vectors";
    vectors.components = 3;
    vectors.values.clear();
    for (const double v : mesh.fields[0].values)
        for (const double factor : {1.0, -0.7, 0.4}) vectors.values.push_back(v * v * factor);
    const std::vector<int> fields{0, 1};
    const SoftwareResampler resampler;
    RefineOptions refine = optionsFor(Criterion::error, 1).refine;
    refine.resolution = 0;  // as fine as need be
    for (const double bound : {0.03, 0.015}) {
        refine.maxError = bound;
        const BrickResult result =
            makeBricks(mesh, fields, resampler, refine, {.threads = 1}, std::make_shared<NoArchive>());
        EXPECT_TRUE(result.bounded) << result.stoppedBecause;
        EXPECT_GT(result.tree.levelCount(), 1);
        for (const FieldError& error : result.report.fields) EXPECT_LE(error.relativeMax, bound);
    }
}

// Within bounds and of what is seen; a bound that can't be kept is told, one that can't be judged refused.
TEST(Schedule, BoundsOfVisibleErrorsAreJudged) {
    TESSERA_ON_ONE_THREAD;
    const TetMesh mesh = meshWithField(ballMesh(6, 1));
    const std::vector<int> fields{0};
    const SoftwareResampler resampler;
    RefineOptions refine = optionsFor(Criterion::error | Criterion::visibility, 1).refine;
    const ValueRange range = finiteFloatRange(mesh.fields[0], 0);
    refine.transferFunction = {"", {{range.min, {0, 0, 0}, 0.5}, {range.max, {1, 1, 1}, 0.5}}};
    refine.boundsWorld = Box3d{Vec3d(-0.4, -0.7, 0), Vec3d(0.5, 0.8, 0.9)};
    for (const int resolution : {0, 12}) {
        refine.resolution = resolution;
        const BrickResult result = makeBricks(mesh, fields, resampler, refine, {.threads = 1});
        // All differences are seen, so the measured error tells the same.
        EXPECT_EQ(result.bounded, result.report.fields[0].relativeMax <= refine.maxError);
        EXPECT_EQ(result.bounded, resolution == 0);
        EXPECT_EQ(result.stoppedBecause.find("wave where it is seen") != std::string::npos, !result.bounded);
    }
    const auto make = [&] { makeBricks(mesh, fields, resampler, refine, {.threads = 1}); };
    refine.measure = ErrorMeasure::rms;
    EXPECT_THROW(make(), InputError);
    refine.measure = ErrorMeasure::max;
    refine.boundsWorld = Box3d{Vec3d(5), Vec3d(6)};
    EXPECT_THROW(make(), InputError);
}

TEST(Schedule, RefinesOnlyWhatIsSeen) {
    TESSERA_ON_ONE_THREAD;
    ScheduleOptions options = optionsFor(Criterion::error, 100'000);
    options.refine.maxError = 0.01;
    Bench everything(ballMesh(8, 1), options);
    everything.scheduler->finish();
    const std::size_t all = everything.scheduler->tree().leafCount();
    const ValueRange range = finiteFloatRange(everything.mesh.fields[0], 0);
    options.transferFunction = showing(range, 0.4, 0.5);
    Bench bench(ballMesh(8, 1), options);
    bench.scheduler->finish();
    bench.expectPlan(bench.budget());
    const std::size_t tenth = bench.scheduler->tree().leafCount();
    EXPECT_LT(double(tenth), 0.5 * double(all));
    EXPECT_GT(tenth, everything.scheduler->bricks().roots().size());
    // Nothing is seen: nothing beyond the coarsest.
    bench.scheduler->setTransferFunction(showing(range, 2, 3));
    bench.scheduler->finish();
    EXPECT_EQ(bench.scheduler->tree().leafCount(), everything.scheduler->bricks().roots().size());
    // Everything again, without a sample taken twice.
    bench.scheduler->setTransferFunction({});
    bench.scheduler->finish();
    EXPECT_EQ(bench.scheduler->tree().leafCount(), all);
    EXPECT_LE(bench.scheduler->counts().sampled, everything.scheduler->counts().sampled);
    TransferFunction other = showing(range, 0, 1);
    other.field = "no such field";
    EXPECT_THROW(bench.scheduler->setTransferFunction(other), InputError);
    EXPECT_THROW(Bench(ballMesh(4, 1),
                       [&] {
                           ScheduleOptions wrong = options;
                           wrong.transferFunction = other;
                           return wrong;
                       }()),
                 InputError);
}

TEST(Schedule, RefusesWhatItCannotKeep) {
    TESSERA_ON_ONE_THREAD;
    EXPECT_THROW(Bench(ballMesh(4, 1), optionsFor(Criterion::focus, 4)), InputError);
    EXPECT_THROW(Bench(ballMesh(4, 1), optionsFor(Criterion::uniform, 1000)), InputError);
    Bench bench(ballMesh(4, 1), optionsFor(Criterion::focus, 1000));
    EXPECT_THROW(bench.scheduler->setBudget(100), InputError);
    EXPECT_THROW(bench.scheduler->setFocus({pointFocus(Vec3d(0), -1)}), InputError);
    bench.scheduler->finish();
    bench.expectPlan(bench.budget());
}

// Told once each time it comes to rest, and how far it is in between.
TEST(Schedule, TellsItsTargetHowFarItIs) {
    struct Events : BrickTarget {
        void publish(const Publication&) override { ++published; }
        void progress(const ScheduleProgress& progress) override { told.push_back(progress); }
        void rest() override { ++rests; }
        int published = 0, rests = 0;
        std::vector<ScheduleProgress> told;
    } events;
    const TetMesh mesh = meshWithField(ballMesh(6, 1));
    const std::vector<int> fields{0};
    const SoftwareResampler resampler;
    const ScheduleOptions options = optionsFor(Criterion::focus, 1000);
    BrickScheduler scheduler(mesh, fields, resampler, options, events);
    for (int round = 1; round <= 2; ++round) {
        events.told.clear();
        while (!scheduler.update(Clock::now(), {.threads = 1})) EXPECT_EQ(events.rests, round - 1);
        scheduler.update(Clock::now(), {.threads = 1});
        EXPECT_EQ(events.rests, round);
        ASSERT_GT(events.told.size(), 1u);
        for (const ScheduleProgress& progress : events.told) {
            EXPECT_LE(progress.bytes, progress.budgetBytes);
            EXPECT_EQ(progress.budgetBytes, options.budgetBytes);
        }
        EXPECT_EQ(scheduler.progress().leavesShown, scheduler.progress().leavesPlanned);
        EXPECT_EQ(scheduler.progress().bricksAtWork, 0u);
        scheduler.setFocus({pointFocus(Vec3d(-0.3), 0.05)});
    }
    EXPECT_LE(events.told.size(), std::size_t(events.published));
}

// Reads a linear field on both sides of faces between leaves, in a state of work half done.
// TESSERA_SCHEDULE_FACES asks for more places.
TEST(Schedule, LinearFieldsHaveNoStepBetweenLeaves) {
    TESSERA_ON_ONE_THREAD;
    TetMesh mesh = ballMesh(6, 1);
    const Vec3d slope(0.7, -1.3, 0.4);
    addPointField(mesh, "linear", [&](const Vec3d& p) { return glm::dot(slope, p) + 2; });
    const std::vector<int> fields{0};
    const SoftwareResampler resampler;
    const auto bound = resampler.bind(mesh, fields, {});
    const ScheduleOptions options = optionsFor(Criterion::focus, 3000);
    WatchedBricks target(*bound, chooseFrame(mesh.boundsWorld(), options.refine));
    BrickScheduler scheduler(mesh, fields, resampler, options, target);
    std::mt19937 random(5);
    const auto share = [&] { return std::uniform_real_distribution<double>(0, 1)(random); };
    const int states = 10, places = asked("TESSERA_SCHEDULE_FACES", kIsSanitized ? 2000 : 20'000) / states;
    const NearestOnDemand nearest(mesh, 1);
    int compared = 0, acrossLevels = 0;
    for (int state = 0; state < states; ++state) {
        scheduler.finish();
        scheduler.setFocus({pointFocus(Vec3d(share(), share(), share()) - 0.5, 0.05)});
        for (int i = 0; i < 20 * state; ++i) scheduler.update(Clock::now());
        const BricksShown shown = bricksOf(scheduler, scheduler.tree().deepest());
        const BrickTree& tree = shown.tree;
        const Reconstruction reconstruction(mesh, fields, tree, shown.store, nearest);
        for (int n = 0; n < places; ++n) {
            const std::size_t leaf = std::size_t(share() * double(tree.leafCount()));
            const BrickKey key = tree.leaves()[leaf];
            // On the face towards an axis, as an index of the leaf's level.
            const int axis = int(3 * share()), side = share() < 0.5 ? 0 : 1;
            Vec3d index = (Vec3d(key.index) + Vec3d(share(), share(), share())) * 8.0;
            index[axis] = (key.index[axis] + side) * 8.0;
            BrickKey beside{key.level, key.index};
            beside.index[axis] += side ? 1 : -1;
            const std::int64_t other = tree.findCovering(beside);
            if (other < 0) continue;
            const BrickKey& far = tree.leaves()[std::size_t(other)];
            int coveredHere = 0, coveredThere = 0;
            const double here = reconstruction.interpolate(leaf, index, 0, &coveredHere);
            const double there = reconstruction.interpolate(
                std::size_t(other), index * std::ldexp(1.0, key.level - far.level), 0, &coveredThere);
            if (coveredHere < 8 || coveredThere < 8) continue;
            const Vec3d place = tree.originWorld() + index * tree.spacingWorld(key.level);
            // A unit in the last place of the values, which lie between 2 and 4 at most.
            constexpr double kUlp = 0x1p-22;
            ASSERT_NEAR(here, there, 4 * kUlp);
            ASSERT_NEAR(here, glm::dot(slope, place) + 2, 4 * kUlp);
            ++compared;
            acrossLevels += far.level != key.level;
        }
    }
    EXPECT_GT(compared, states * places / 4);
    EXPECT_GT(acrossLevels, compared / 20);
}

// TESSERA_SCHEDULE_SEEDS and TESSERA_SCHEDULE_STEPS ask for more.
TEST(Schedule, EveryPublishedStateIsWhole) {
    const int seeds = asked("TESSERA_SCHEDULE_SEEDS", 3),
              steps = asked("TESSERA_SCHEDULE_STEPS", kIsSanitized ? 100 : 300);
    int cutShort = 0;
    ScheduleCounts sum;
    for (int seed = 0; seed < seeds && !HasFailure(); ++seed)
        runAtRandom(unsigned(seed), steps, std::make_unique<SoftwareResampler>(), {}, cutShort, sum);
    EXPECT_GT(cutShort, 0);
    EXPECT_GT(sum.dropped, 0);
    EXPECT_GT(sum.reused, 0);
}

}  // namespace
}  // namespace tessera
