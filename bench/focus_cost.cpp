// What a focus that moves costs: focus_cost [mesh.vtu...] [--elements 1000000] [--resolution 512] [--jumps
// 200]
//
// A scheduler comes to rest around a first focus. Then the focus jumps to random nodes: "better" is the time
// until the brick that holds the node is shown one depth finer than before, with what balance asks for; "at
// rest" until everything is. Beside that: what update() overshoots its deadline by, what a new plan costs
// alone, a uniform resampling at the same finest spacing, and schedulers that come to rest around other
// places, each from nothing. radius is a sixteenth of the longest side.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "arguments.h"
#include "base/timer.h"
#include "benchmark/graded_box.h"
#include "mesh_files/read_mesh.h"
#include "reference/random.h"
#include "refine/plan.h"
#include "refine/plan_frame.h"
#include "refine/resample_tree.h"
#include "schedule/brick_scheduler.h"
#include "tessera/registry.h"

namespace {

using namespace tessera;
using Clock = BrickScheduler::Clock;

struct Options {
    std::vector<std::string> meshPaths;
    std::vector<std::int64_t> elements{1000000};
    std::string algorithm = "software";
    int resolution = 512, brickCells = 16, jumps = 200, places = 15, threads = 2, frameMs = 8;
    double budgetMb = 2000;
    double radius = 1.0 / 16;
};

double quantile(std::vector<double> values, double share) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    return values[std::min(values.size() - 1, std::size_t(share * double(values.size())))];
}

/// Notes when the leaf at a place becomes finer than it was.
class Watch : public BrickTarget {
  public:
    void publish(const Publication& publication) override {
        if (isBetter) return;
        for (const ShownBrick& brick : publication.added)
            if (brick.leaf.key.depth > before && ancestorKey(wanted, brick.leaf.key.depth) == brick.leaf.key)
                isBetter = true, betterMs = timer.elapsedMs();
    }
    DepthKey wanted;  ///< the finest brick at the place
    Depth before;
    bool isBetter = true;  ///< or nothing is watched for
    double betterMs = 0;
    Timer timer;
};

/// A scheduler from nothing to rest.
struct FromNothing {
    FromNothing(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                const ScheduleOptions& schedule, const Execution& execution)
        : scheduler(mesh, fields, resampler, schedule, watch, execution) {
        scheduler.finish(execution);
        ms = timer.elapsedMs();
    }
    double voxels() const {
        return double(scheduler.tree().leafCount()) * std::pow(scheduler.frame().brickCells, 3);
    }
    double ms = 0;
    Timer timer;
    Watch watch;
    BrickScheduler scheduler;
};

/// A tree that was planned and sampled at once.
struct AtOnce {
    double ms = 0, voxels = 0, inMesh = 0;
};

std::string figures(const std::vector<double>& ms) {
    return fmt::format("median {:.2f} ms, 99 % {:.2f}, most {:.2f}", quantile(ms, 0.5), quantile(ms, 0.99),
                       quantile(ms, 1));
}

std::string shares(const std::vector<double>& percent) {
    return fmt::format("least {:.2f} %, median {:.2f}, most {:.2f}", quantile(percent, 0),
                       quantile(percent, 0.5), quantile(percent, 1));
}

/// Plans of many leaves, without sampling: bricks of 8^3 cells and a spacing four times finer.
void measurePlans(const TetMesh& mesh, const Box3d& bounds, RefineOptions refine,
                  const Execution& execution) {
    refine.brickCells = 8;
    refine.resolution *= 4;
    Timer timer;
    WishPlanning planning(mesh, bounds, refine, GrowingTree::kNoLimit, execution);
    planning.plan.complete();
    const double firstMs = timer.elapsedMs();
    const auto replan = [&](const Wishes& wishes) {
        timer.restart();
        WishPlan plan(planning.bricks, wishes, {});
        plan.complete();
        return std::pair(timer.elapsedMs(), plan.leafCount());
    };
    Wishes wishes = planning.plan.wishes();
    std::vector<double> again, ranked;
    for (int n = 0; n < 20; ++n) again.push_back(replan(wishes).first);
    std::printf("  a plan of %zu leaves: %.0f ms; again, bricks looked at before: %s\n",
                planning.plan.leafCount(), firstMs, figures(again).c_str());
    const std::vector<int> fields{0};
    wishes.inspector = std::make_shared<const BrickInspector>(
        std::make_shared<const SharedElementIndex>(mesh), fields, refine, 0, execution);
    const ValueRange range = wishes.inspector->watchedRange();
    std::size_t most = 0;
    for (int n = 0; n < 21; ++n) {
        // All is seen but for a part that moves.
        const double low = range.min + (0.1 + 0.04 * n) * range.width(), high = low + 0.05 * range.width();
        const auto stop = [](double value, double opacity) {
            return TransferFunction::Stop{.value = value, .color = {1, 1, 1}, .opacity = opacity};
        };
        const TransferFunction function{
            .field = {},
            .stops = {stop(range.min, 1), stop(low, 1), stop(low, 0), stop(high, 0), stop(high, 1)}};
        wishes.visible = std::make_shared<const VisibleValues>(function, range);
        const auto [ms, leaves] = replan(wishes);
        most = std::max(most, leaves);
        if (n > 0) ranked.push_back(ms);  // the first looks at the values of all elements
    }
    std::printf("    with another transfer function, up to %zu leaves: %s\n", most, figures(ranked).c_str());
}

void measure(const Options& options, const std::string& name, const TetMesh& mesh) {
    const std::vector<int> fields{0};
    const int channels = mesh.fields[0].components;
    const Resampler& resampler = findResampler(options.algorithm);
    const Execution execution{.threads = options.threads};
    Timer timer;
    ScheduleOptions schedule;
    schedule.refine.criterion = Criterion::focus;
    schedule.refine.resolution = options.resolution;
    schedule.refine.brickCells = options.brickCells;
    schedule.refine.bind.index = std::make_shared<const SharedElementIndex>(mesh);
    schedule.refine.bind.index->get(execution);
    const double indexMs = timer.restart();
    const Box3d bounds = meshBounds(mesh, execution, schedule.refine.bind.index->ifBuilt());
    const Vec3d size = bounds.size();
    const double longest = std::max({size.x, size.y, size.z}), radius = options.radius * longest;
    Random jumps(1), places(2);
    const auto node = [&](Random& random) {
        const auto& tet = mesh.tets[std::size_t(random.below(int(mesh.elementCount())))];
        return mesh.points[std::size_t(tet[0])];
    };
    schedule.refine.focus = {pointFocus(node(jumps), radius)};
    schedule.budgetBytes = std::int64_t(options.budgetMb * 1e6);
    std::printf("\n%s: %lld elements, index in %.0f ms; finest spacing of %d points along the longest side\n",
                name.c_str(), static_cast<long long>(mesh.elementCount()), indexMs, options.resolution);
    FromNothing first(mesh, fields, resampler, schedule, execution);
    BrickScheduler& scheduler = first.scheduler;
    Watch& watch = first.watch;
    const double firstVoxels = first.voxels();
    const int cells = scheduler.frame().brickCells;
    std::printf("  from nothing to rest: %.0f ms, %zu leaves, %.3g voxels, %.0f MB\n", first.ms,
                scheduler.tree().leafCount(), firstVoxels, double(scheduler.bytes()) / 1e6);

    // The same without ways to stop: the tree at once.
    RefineOptions refine = schedule.refine;
    refine.maxVoxels = std::int64_t(1) << 34;
    const auto sampleAtOnce = [&](Criterion criterion) {
        refine.criterion = criterion;
        timer.restart();
        const BrickTree tree = planBricks(mesh, refine, execution, channels);
        const double planMs = timer.restart();
        const auto bound = resampler.bind(mesh, fields, refine.bind);
        ResampleStatistics statistics;
        const BrickStore store = resampleTree(tree, *bound, channels, execution, statistics);
        AtOnce made{timer.elapsedMs() + planMs, double(tree.leafCount()) * std::pow(cells, 3),
                    double(store.coveredPoints())};
        std::printf("  %s: plan %.0f ms, samples %.0f ms, %.3g voxels, %.3g of them in the mesh\n",
                    criterion == Criterion::uniform ? "uniform" : "focus, offline", planMs, made.ms - planMs,
                    made.voxels, made.inMesh);
        return made;
    };
    const AtOnce offline = sampleAtOnce(Criterion::focus), uniform = sampleAtOnce(Criterion::uniform);
    std::printf(
        "  over uniform: %.2f %% of the voxels, %.2f %% of those in the mesh; from nothing to rest %.1f %% "
        "of the time, offline %.1f %%\n",
        100 * firstVoxels / uniform.voxels, 100 * offline.inMesh / uniform.inMesh,
        100 * first.ms / uniform.ms, 100 * offline.ms / uniform.ms);

    // Around other places, each from nothing.
    std::vector<double> voxelsFromNothing, timeFromNothing;
    for (int place = 0; place < options.places; ++place) {
        ScheduleOptions there = schedule;
        there.refine.focus = {pointFocus(node(places), radius)};
        const FromNothing fresh(mesh, fields, resampler, there, execution);
        timeFromNothing.push_back(100 * fresh.ms / uniform.ms);
        voxelsFromNothing.push_back(100 * fresh.voxels() / uniform.voxels);
    }
    if (options.places > 0)
        std::printf("  from nothing to rest around %d other places, over uniform: voxels %s; time %s\n",
                    options.places, shares(voxelsFromNothing).c_str(), shares(timeFromNothing).c_str());

    std::vector<double> better, rest, late, cut, call;
    const std::int64_t sampledBefore = scheduler.counts().sampled;
    for (int jump = 0; jump < options.jumps; ++jump) {
        const Vec3d place = node(jumps);
        const Depth finest = scheduler.frame().maxDepth;
        const double edge = scheduler.frame().spacingWorld(finest) * cells;
        watch.wanted = {finest, Vec3i(glm::floor((place - scheduler.frame().originWorld) / edge))};
        const auto leaf = scheduler.tree().findCovering(watch.wanted);
        const bool canImprove = leaf && leaf->key.depth < finest;
        if (leaf) watch.before = leaf->key.depth;
        watch.isBetter = !canImprove;
        watch.timer.restart();
        scheduler.setFocus({pointFocus(place, radius)});
        call.push_back(watch.timer.elapsedMs());
        while (true) {
            const auto deadline = Clock::now() + std::chrono::milliseconds(options.frameMs);
            const bool atRest = scheduler.update(deadline, execution);
            const double ms = std::chrono::duration<double, std::milli>(Clock::now() - deadline).count();
            late.push_back(std::max(ms, 0.0));
            if (atRest) break;
            cut.push_back(ms);
        }
        rest.push_back(watch.timer.elapsedMs());
        if (canImprove && watch.isBetter) better.push_back(watch.betterMs);
    }
    const ScheduleCounts& counts = scheduler.counts();
    std::printf(
        "  %d jumps (%zu to places that weren't fine yet), %lld bricks sampled, %lld reused, %lld dropped\n",
        options.jumps, better.size(), static_cast<long long>(counts.sampled - sampledBefore),
        static_cast<long long>(counts.reused), static_cast<long long>(counts.dropped));
    std::printf(
        "    better: %s\n    at rest: %s\n    call of setFocus(): %s\n    past its deadline update() ends, "
        "of %zu "
        "calls: %s\n      of the %zu with work left: %s\n",
        figures(better).c_str(), figures(rest).c_str(), figures(call).c_str(), late.size(),
        figures(late).c_str(), cut.size(), figures(cut).c_str());
    // On one thread all that isn't sampling is planning and bookkeeping.
    FromNothing alone(mesh, fields, resampler, schedule, {.threads = 1});
    BrickScheduler& single = alone.scheduler;
    const auto shareOfRest = [&](const char* what) {
        const double samplingMs = single.samplingMs(), restMs = alone.timer.elapsedMs() - samplingMs;
        std::printf("  one thread, %s: sampling %.0f ms, planning and bookkeeping %.1f ms (%.1f %% of it)\n",
                    what, samplingMs, restMs, 100 * restMs / samplingMs);
    };
    shareOfRest("from nothing to rest");
    std::vector<double> voxelShares;
    for (int jump = 0; jump < options.jumps; ++jump) {
        single.setFocus({pointFocus(node(jumps), radius)});
        single.finish({.threads = 1});
        voxelShares.push_back(100 * alone.voxels() / uniform.voxels);
    }
    shareOfRest("and the jumps");
    if (!voxelShares.empty())
        std::printf("  voxels over uniform, at rest around these places: %s\n", shares(voxelShares).c_str());
    measurePlans(mesh, bounds, schedule.refine, execution);
}

}  // namespace

int main(int count, char** words) {
    Options options;
    bench::Arguments arguments("What a focus that moves costs");
    arguments.add("meshes", options.meshPaths, "mesh files; without, graded boxes of --elements");
    arguments.add("--elements", options.elements, "sizes of the graded boxes");
    arguments.add("--algorithm", options.algorithm, "");
    arguments.add("--resolution", options.resolution, "of the finest spacing");
    arguments.add("--brick-size", options.brickCells, "cells along a brick's edge");
    arguments.add("--radius", options.radius, "share of the longest side");
    arguments.add("--jumps", options.jumps, "");
    arguments.add("--places", options.places, "beside the first, each from nothing");
    arguments.add("--threads", options.threads, "");
    arguments.add("--frame", options.frameMs, "milliseconds of one update()");
    arguments.add("--budget", options.budgetMb, "megabytes");
    return arguments.run(count, words, [&] {
        for (const std::string& path : options.meshPaths) measure(options, path, readMesh(path, {}, {}).mesh);
        if (options.meshPaths.empty())
            for (const std::int64_t elements : options.elements)
                measure(options, "graded box", gradedBox(elements));
        return 0;
    });
}
