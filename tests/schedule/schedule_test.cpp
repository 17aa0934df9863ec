#include "schedule/brick_scheduler.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>
#include <set>
#include <thread>

#include "brick_test_meshes.h"
#include "refine/plan_frame.h"
#include "schedule/schedule_bricks.h"
#include "schedule/watched_bricks.h"
#include "software/software_resampler.h"
#include "tessera/error.h"

namespace tessera {
namespace {

using Clock = BrickScheduler::Clock;

/// Under a sanitizer all is many times slower.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kIsWatched = true;
#else
constexpr bool kIsWatched = false;
#endif

TetMesh meshWithField(TetMesh mesh) {
    addPointField(mesh, "wave", [](const Vec3d& p) { return std::sin(5 * p.x) + p.y * p.z; });
    return mesh;
}

#ifdef __SANITIZE_THREAD__
#define TESSERA_ON_ONE_THREAD GTEST_SKIP() << "runs on one thread: nothing for this sanitizer to find"
#else
#define TESSERA_ON_ONE_THREAD static_cast<void>(0)
#endif

struct Bench {
    explicit Bench(TetMesh made, ScheduleOptions with) : mesh(meshWithField(std::move(made))), options(with) {
        BindOptions pass;
        pass.route = Route::pass;
        bound = resampler->bind(mesh, fields, pass);
        frame = chooseFrame(mesh.boundsWorld(), options.refine);
        target = std::make_unique<WatchedBricks>(*bound, frame);
        scheduler = std::make_unique<BrickScheduler>(mesh, fields, *resampler, options, *target);
        target->afterEach = [this] { expectWithinBudget(); };
    }

    void expectWithinBudget() const { EXPECT_LE(scheduler->bytes(), budget()); }
    std::int64_t budget() const { return options.budgetBytes; }

    /// The leaves shown are the tree's, disjoint and balanced.
    void expectWhole() const {
        const std::vector<GrowingLeaf> leaves = scheduler->tree().leaves();
        ASSERT_EQ(leaves.size(), target->leaves.size());
        for (const GrowingLeaf& leaf : leaves) {
            const auto found = target->leaves.find(leaf.slot);
            ASSERT_TRUE(found != target->leaves.end() && found->second.leaf == leaf);
            for (int n = 0; n < 27; ++n) {
                const DepthKey near{leaf.key.depth,
                                    leaf.key.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)};
                const auto other = scheduler->tree().findCovering(near);
                if (other) {
                    ASSERT_LE(leaf.key.depth - other->key.depth, 1);
                }
            }
        }
    }

    /// Lists of elements, an independent way to the bricks of a tree, give the same leaves: none is missing.
    void expectDomainCovered() const {
        if (scheduler->tree().leafCount() == 0) return;
        BrickPlan plan(mesh, frame, {});
        std::set<std::array<int, 4>> above;
        const std::vector<GrowingLeaf> leaves = scheduler->tree().leaves();
        for (const GrowingLeaf& leaf : leaves)
            for (Depth d; d < leaf.key.depth; d = d + 1) {
                const DepthKey key = ancestorKey(leaf.key, d);
                above.insert({d.halvings(), key.index.x, key.index.y, key.index.z});
            }
        for (const auto& [d, x, y, z] : above) {
            const DepthKey key{Depth(d), {x, y, z}};
            const auto planned = plan.leaves();
            if (std::any_of(planned.begin(), planned.end(),
                            [&](const PlannedBrick* b) { return b->key == key; }))
                plan.split({&key, 1}, GrowingTree::kNoLimit, {});
        }
        // A brick vanishes when it is split and none of its children holds elements.
        std::vector<DepthKey> vanished;
        for (const PlannedBrick* brick : plan.leaves())
            if (!scheduler->tree().findLeaf(brick->key)) vanished.push_back(brick->key);
        for (const DepthKey& key : vanished) {
            const std::size_t before = plan.leafCount();
            plan.split({&key, 1}, GrowingTree::kNoLimit, {});
            ASSERT_EQ(plan.leafCount(), before - 1) << "a brick is missing";
        }
        ASSERT_EQ(plan.leafCount(), leaves.size());
    }

    /// At rest the leaves are those of a plan made anew.
    void expectPlan(std::int64_t budgetBytes) const {
        const auto index = std::make_shared<const SharedElementIndex>(mesh);
        const bool bySize = options.refine.criterion.has(Criterion::elementSize);
        MeshBricks bricks(index, frame, bySize ? options.refine.samplesPerElement : 0, {});
        const std::size_t most = std::size_t(budgetBytes / scheduler->brickBytes()) - 8;
        WishPlan plan(bricks, scheduler->wishes(), {PlanLimit::Counts::all, most});
        do {
            plan.complete();
            for (const MeshBricks::Number brick : plan.waitsFor())
                bricks.setFindings(brick, findingsAlone(bricks.key(brick)));
        } while (!plan.waitsFor().empty());
        const auto shown = scheduler->tree().leaves();
        const auto planned = plan.leaves();
        ASSERT_EQ(shown.size(), planned.size());
        for (std::size_t i = 0; i < shown.size(); ++i) ASSERT_EQ(shown[i].key, bricks.key(planned[i]));
        EXPECT_EQ(scheduler->isCutShort(), plan.isCutShort());
    }

    BrickFindings findingsAlone(const DepthKey& key) const {
        const Lattice lattice = Lattice::axisParallel(frame.originWorld, frame.spacingWorld(key.depth));
        const IndexBox box{key.index * frame.brickCells, (key.index + 1) * frame.brickCells + 1};
        BrickFindings findings;
        const auto inspect = [&](std::size_t, const Block& block) {
            findings = scheduler->wishes().inspector->inspect(key, block, frame);
        };
        bound->resample(lattice, std::span(&box, 1), inspect, {.threads = 1});
        return findings;
    }

    TetMesh mesh;
    std::vector<int> fields{0};
    ScheduleOptions options;
    std::unique_ptr<Resampler> resampler = std::make_unique<SoftwareResampler>();
    std::unique_ptr<BoundResampler> bound;
    PlanFrame frame;
    std::unique_ptr<WatchedBricks> target;
    std::unique_ptr<BrickScheduler> scheduler;
};

ScheduleOptions optionsFor(Criteria criteria, std::int64_t bricks) {
    ScheduleOptions options;
    options.refine.criterion = criteria;
    options.refine.brickCells = 8;
    options.refine.resolution = 200;
    options.refine.focus = {pointFocus({0.3, 0.2, 0.1}, 0.1)};
    options.refine.maxError = 0.03;
    options.budgetBytes = bricks * 9 * 9 * 9 * 5;
    return options;
}

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

/// Shows values from a to b alone, in shares of the field's range.
TransferFunction showing(const ValueRange& range, double a, double b) {
    const double low = range.min + a * (range.max - range.min),
                 high = range.min + b * (range.max - range.min);
    const std::array<double, 3> white{1, 1, 1};
    return {"", {{low, white, 0}, {low, white, 0.5}, {high, white, 0.5}, {high, white, 0}}};
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

int asked(const char* name, int otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atoi(text) : otherwise;
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
    const int states = 10, places = asked("TESSERA_SCHEDULE_FACES", kIsWatched ? 2000 : 20'000) / states;
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

// Focus jumps and jitter, changes of the budget, cancelled calls and updates of any length, with threads or
// without.
void runAtRandom(unsigned seed, int steps, int& cutShort, ScheduleCounts& sum) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    const auto share = [&] { return std::uniform_real_distribution<double>(0, 1)(random); };
    const bool isSeen = seed % 3 == 1;
    const Criteria criteria = isSeen          ? Criterion::error | Criterion::focus
                              : seed % 3 == 0 ? Criterion::elementSize | Criterion::focus
                                              : Criteria(Criterion::focus);
    ScheduleOptions options = optionsFor(criteria, 400 + std::int64_t(600 * share()));
    options.refine.resolution = seed % 2 == 0 ? 0 : 150;
    if (seed % 5 == 4) options.refine.boundsWorld = Box3d{Vec3d(-0.4, -0.7, 0), Vec3d(0.5, 0.8, 0.9)};
    options.threads = seed % 4 == 2 ? 2 : 0;
    const ValueRange range{-1, 2};
    if (isSeen) options.transferFunction = showing(range, 0.3, 0.6);
    Bench bench(seed % 2 == 0 ? gradedMesh(6, 2) : ballMesh(6, 1), options);
    BrickScheduler& scheduler = *bench.scheduler;
    const Box3d bounds = bench.mesh.boundsWorld();
    std::atomic<bool> cancel{false};
    for (int step = 0; step < steps && !testing::Test::HasFailure(); ++step) {
        const double what = share();
        if (what < 0.06) {
            std::vector<Focus> focus;
            for (int n = 0; n < 1 + int(2 * share() * share()); ++n) {
                const Vec3d at = glm::mix(bounds.min, bounds.max, Vec3d(share(), share(), share()));
                focus.push_back(pointFocus(at, 0.02 + 0.2 * share() * share()));
            }
            scheduler.setFocus(focus);
        } else if (what < 0.12) {
            std::vector<Focus> focus = scheduler.wishes().focus;
            for (Focus& one : focus) {
                const Vec3d by = scheduler.wishes().finestSpacingWorld * Vec3d(share(), share(), share());
                one.boxWorld.min += by, one.boxWorld.max += by;
            }
            EXPECT_FALSE(scheduler.setFocus(focus));
        } else if (what < 0.14) {
            const std::int64_t bytes =
                scheduler.leastBudgetBytes() + std::int64_t(900 * share() * share()) * scheduler.brickBytes();
            // While it shrinks what is shown still has the bytes that it had.
            bench.options.budgetBytes = std::max(bench.options.budgetBytes, bytes);
            scheduler.setBudget(bytes);
            bench.options.budgetBytes = bytes;
        } else if (what < 0.15) {
            scheduler.forget();
        } else if (what < 0.16) {
            const double low = share();
            if (isSeen) scheduler.setTransferFunction(showing(range, low, low + share()));
        } else if (what < 0.2) {
            cancel = true;
            const auto soon = Clock::now() + std::chrono::milliseconds(1);
            try {
                EXPECT_TRUE(scheduler.update(soon, {.threads = 1, .cancel = &cancel})) << "not cancelled";
            } catch (const Cancelled&) {
            }
            cancel = false;
            continue;
        }
        const int threads = share() < 0.2 ? 3 : 1;
        const auto deadline = Clock::now() + std::chrono::microseconds(int(2000 * share() * share()));
        scheduler.update(deadline, {.threads = threads});
        bench.expectWithinBudget();
        bench.expectWhole();
        if (step % 100 == 99) {
            bench.expectDomainCovered();
            scheduler.finish();
            bench.expectWhole();
            bench.expectDomainCovered();
            bench.expectPlan(bench.budget());
            cutShort += scheduler.isCutShort();
        }
    }
    sum.dropped += scheduler.counts().dropped;
    sum.reused += scheduler.counts().reused;
}

// TESSERA_SCHEDULE_SEEDS and TESSERA_SCHEDULE_STEPS ask for more.
TEST(Schedule, EveryPublishedStateIsWhole) {
    const int seeds = asked("TESSERA_SCHEDULE_SEEDS", 3),
              steps = asked("TESSERA_SCHEDULE_STEPS", kIsWatched ? 100 : 300);
    int cutShort = 0;
    ScheduleCounts sum;
    for (int seed = 0; seed < seeds && !HasFailure(); ++seed)
        runAtRandom(unsigned(seed), steps, cutShort, sum);
    EXPECT_GT(cutShort, 0);
    EXPECT_GT(sum.dropped, 0);
    EXPECT_GT(sum.reused, 0);
}

}  // namespace
}  // namespace tessera
