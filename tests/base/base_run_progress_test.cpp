#include <gtest/gtest.h>

#include <string>
#include <thread>
#include <vector>

#include "base/run_progress.h"

namespace tessera {
namespace {

const std::vector<ExpectedStage> kStages{{Stage::reading, 1},  {Stage::planning, 1},  {Stage::sampling, 4},
                                         {Stage::checking, 2}, {Stage::measuring, 2}, {Stage::writing, 2}};

/// Progress on a clock that the test moves.
struct TimedRun {
    double nowMs = 0;
    RunProgress progress{[this] { return nowMs; }};
    double share() { return progress.state().share; }
    /// Lets a stage take this long in ten reports.
    void pass(Stage stage, double ms) {
        for (int i = 0; i <= 10; ++i) {
            progress.update(stage, i, 10);
            if (i < 10) nowMs += ms / 10;
        }
    }
};

TEST(RunProgress, PassesThroughTheDeclaredShares) {
    TimedRun run;
    run.progress.declare({{Stage::reading, 1}, {Stage::sampling, 2}, {Stage::writing, 1}});
    EXPECT_EQ(run.share(), 0);
    run.pass(Stage::reading, 10);
    EXPECT_NEAR(run.share(), 0.25, 1e-6);
    run.progress.update(Stage::sampling, 1, 2);
    EXPECT_NEAR(run.share(), 0.5, 1e-6);
    run.pass(Stage::writing, 10);
    EXPECT_NEAR(run.share(), 1, 1e-6);
}

TEST(RunProgress, AStageThatIsLeftOutGivesItsShareToTheOthers) {
    TimedRun run;
    run.progress.declare({{Stage::reading, 1}, {Stage::repairing, 5}, {Stage::writing, 1}});
    run.pass(Stage::reading, 10);
    const double before = run.share();
    run.progress.update(Stage::writing, 1, 2);
    EXPECT_NEAR(run.share(), before + (1 - before) / 2, 1e-6);
}

/// Whatever is expected of the rounds to come, the share never falls and ends at 1.
TEST(RunProgress, NeverGoesBackThroughRoundsThatWereExpectedWrongly) {
    for (const double expected : {0.0, 3.0, 500.0}) {
        TimedRun run;
        run.progress.declare(kStages);
        double last = 0;
        const auto check = [&] {
            const double share = run.share();
            EXPECT_GE(share, last);
            EXPECT_LE(share, 1);
            last = share;
        };
        run.pass(Stage::reading, 100), check();
        run.pass(Stage::planning, 10), check();
        double bricks = 8;
        for (int round = 0; round < 6; ++round, bricks *= 3) {
            run.progress.beginRound(bricks, expected);
            for (const Stage stage : {Stage::sampling, Stage::checking})
                for (int i = 0; i <= 20; ++i, run.nowMs += bricks / 10)
                    run.progress.update(stage, i, 20), check();
        }
        run.pass(Stage::measuring, 100), check();
        EXPECT_LT(last, 1);
        run.pass(Stage::writing, 100), check();
        EXPECT_NEAR(last, 1, 1e-6);
    }
}

TEST(RunProgress, GrowsWithTimeWhileAStageReportsNothing) {
    TimedRun run;
    run.progress.declare(kStages);
    run.progress.expect(Stage::reading, 1000);
    run.progress.update(Stage::reading, 0, 1);
    double last = run.share();
    for (int i = 0; i < 20; ++i) {
        run.nowMs += 250;
        EXPECT_GT(run.share(), last);
        last = run.share();
    }
    EXPECT_LT(last, 1.0 / 12);  // the stage's own share is the most
}

TEST(RunProgress, TellsTheTimeLeftByWhatOthersTook) {
    TimedRun run;
    run.progress.declare({{Stage::reading, 1}, {Stage::sampling, 2}, {Stage::writing, 1}});
    run.pass(Stage::reading, 60000);
    EXPECT_LT(run.progress.state().leftMs, 0);  // reading says nothing about it
    run.progress.beginRound(10, 0);
    run.pass(Stage::sampling, 8000);
    EXPECT_NEAR(run.progress.state().leftMs, 4000, 1);
    run.progress.update(Stage::writing, 0, 2);
    run.nowMs += 2000;
    run.progress.update(Stage::writing, 1, 2);
    EXPECT_NEAR(run.progress.state().leftMs, 2000, 1);
}

TEST(RunProgress, ASeriesIsOneRun) {
    TimedRun run;
    run.progress.declare({{Stage::reading, 1}, {Stage::sampling, 3}});
    double last = 0;
    for (int step = 0; step < 4; ++step) {
        run.progress.beginStep("step " + std::to_string(step), 1, 3 - step);
        EXPECT_EQ(run.progress.state().step, "step " + std::to_string(step));
        EXPECT_NEAR(run.share(), 0.25 * step, 1e-6);
        for (const Stage stage : {Stage::reading, Stage::sampling}) {
            run.pass(stage, 1000);
            EXPECT_GE(run.share(), last);
            last = run.share();
        }
        if (step == 1) {
            EXPECT_NEAR(run.progress.state().leftMs, 4000, 1);
        }
    }
    EXPECT_NEAR(last, 1, 1e-6);
}

TEST(RunProgress, TakesReportsOfManyThreads) {
    TimedRun run;
    run.progress.declare({{Stage::sampling, 1}, {Stage::writing, 1}});
    std::atomic<std::int64_t> done{0};
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back([&] {
            for (int i = 0; i < 1000; ++i) run.progress.update(Stage::sampling, ++done, 4000);
        });
    double last = 0;
    for (int i = 0; i < 1000; ++i) {
        const double share = run.share();
        EXPECT_GE(share, last);
        last = share;
    }
    for (std::thread& thread : threads) thread.join();
    run.progress.update(Stage::sampling, 4000, 4000);
    EXPECT_NEAR(run.share(), 0.5, 1e-6);
}

}  // namespace
}  // namespace tessera
