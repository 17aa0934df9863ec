#pragma once

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "brick_test_meshes.h"
#include "refine/plan_frame.h"
#include "schedule/brick_scheduler.h"
#include "schedule/watched_bricks.h"
#include "tessera/error.h"

namespace tessera {

inline TetMesh meshWithField(TetMesh mesh) {
    addPointField(mesh, "wave", [](const Vec3d& p) { return std::sin(5 * p.x) + p.y * p.z; });
    return mesh;
}

/// A scheduler, and everything about its states looked at in other ways.
struct ScheduleBench {
    ScheduleBench(TetMesh made, const ScheduleOptions& with, std::unique_ptr<Resampler> algorithm)
        : mesh(meshWithField(std::move(made))), options(with), resampler(std::move(algorithm)) {
        BindOptions pass = options.refine.bind;
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
    std::unique_ptr<Resampler> resampler;
    std::unique_ptr<BoundResampler> bound;
    PlanFrame frame;
    std::unique_ptr<WatchedBricks> target;
    std::unique_ptr<BrickScheduler> scheduler;
};

inline ScheduleOptions optionsFor(Criteria criteria, std::int64_t bricks) {
    ScheduleOptions options;
    options.refine.criterion = criteria;
    options.refine.brickCells = 8;
    options.refine.resolution = 200;
    options.refine.focus = {pointFocus({0.3, 0.2, 0.1}, 0.1)};
    options.refine.maxError = 0.03;
    options.budgetBytes = bricks * 9 * 9 * 9 * 5;
    return options;
}

/// Shows values from a to b alone, in shares of the field's range.
inline TransferFunction showing(const ValueRange& range, double a, double b) {
    const double low = range.min + a * (range.max - range.min),
                 high = range.min + b * (range.max - range.min);
    const std::array<double, 3> white{1, 1, 1};
    return {"", {{low, white, 0}, {low, white, 0.5}, {high, white, 0.5}, {high, white, 0}}};
}

inline int asked(const char* name, int otherwise) {
    const char* text = std::getenv(name);
    return text ? std::atoi(text) : otherwise;
}

/// Focus jumps and jitter, changes of the budget, cancelled calls and updates of any length, with threads or
/// without. Every state is looked at.
inline void runAtRandom(unsigned seed, int steps, std::unique_ptr<Resampler> algorithm,
                        const BindOptions& bind, int& cutShort, ScheduleCounts& sum) {
    using Clock = BrickScheduler::Clock;
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    const auto share = [&] { return std::uniform_real_distribution<double>(0, 1)(random); };
    const bool isSeen = seed % 3 == 1;
    const Criteria criteria = isSeen          ? Criterion::error | Criterion::focus
                              : seed % 3 == 0 ? Criterion::elementSize | Criterion::focus
                                              : Criteria(Criterion::focus);
    ScheduleOptions options = optionsFor(criteria, 400 + std::int64_t(600 * share()));
    options.refine.bind = bind;
    options.refine.resolution = seed % 2 == 0 ? 0 : 150;
    if (seed % 5 == 4) options.refine.boundsWorld = Box3d{Vec3d(-0.4, -0.7, 0), Vec3d(0.5, 0.8, 0.9)};
    options.threads = seed % 4 == 2 ? 2 : 0;
    const ValueRange range{-1, 2};
    if (isSeen) options.transferFunction = showing(range, 0.3, 0.6);
    ScheduleBench bench(seed % 2 == 0 ? gradedMesh(6, 2) : ballMesh(6, 1), options, std::move(algorithm));
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
    sum.sampled += scheduler.counts().sampled;
    sum.dropped += scheduler.counts().dropped;
    sum.reused += scheduler.counts().reused;
}

}  // namespace tessera
