#include "schedule/schedule_bricks.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/text.h"
#include "base/timer.h"
#include "brick/kept_points.h"
#include "refine/measure_error.h"
#include "refine/plan_frame.h"
#include "refine/refine.h"

namespace tessera {

namespace {

/// Of a run to its end nobody sees the states between.
class Unseen : public BrickTarget {
  public:
    void publish(const Publication&) override {}
};

bool bordersOnCoarser(const BrickTree& tree, const BrickKey& key) {
    for (int n = 0; n < 27; ++n) {
        const BrickKey near{key.level, key.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)};
        const std::int64_t leaf = tree.findCovering(near);
        if (leaf >= 0 && tree.leaves()[std::size_t(leaf)].level > key.level) return true;
    }
    return false;
}

// While a scheduler works, errors are judged within single bricks. These are of leaves that border on coarser
// ones, where the coarser brick's samples decide.
std::vector<LeafFindings> findAcrossBorders(const BrickScheduler& scheduler, const BricksShown& shown,
                                            Depth finest, const Reconstruction& reconstruction,
                                            const Execution& execution) {
    std::vector<LeafFindings> findings;
    for (const BrickKey& key : shown.tree.leaves())
        if (bordersOnCoarser(shown.tree, key)) findings.push_back({{finest - key.level, key.index}, {}});
    parallelFor(execution.withoutProgress(), std::int64_t(findings.size()), [&](std::int64_t i) {
        auto& [leaf, found] = findings[std::size_t(i)];
        const int level = levelOf(leaf.depth, finest);
        found = scheduler.wishes().inspector->inspect(
            leaf, *scheduler.samples(leaf), scheduler.frame(),
            [&](const Vec3i& p, std::span<double> values) { reconstruction.resolve(level, p, 0, values); });
    });
    return findings;
}

// Where a bound on visible errors isn't kept: what was reached.
std::string exceededWhereSeen(const RefineOptions& options, const BrickScheduler& scheduler) {
    double worst = 1;
    for (const GrowingLeaf& leaf : scheduler.tree().leaves())
        worst = std::max(worst, scheduler.errorOverBound(leaf.key));
    if (worst <= 1) return {};
    const double bound = scheduler.wishes().inspector->watchedBound();
    return "a largest error of " + shortNumber(worst * bound) + " in " + options.transferFunction->field +
           " where it is seen (bound " + shortNumber(bound) + ")";
}

}  // namespace

BricksShown bricksOf(const BrickScheduler& scheduler, Depth finest) {
    const PlanFrame& frame = scheduler.frame();
    BricksShown shown{
        scheduler.tree().brickTree(frame.originWorld, frame.rootSpacingWorld, frame.brickCells, finest), {}};
    const BrickTree& tree = shown.tree;
    std::vector<std::shared_ptr<const Block>> samples;
    for (const BrickKey& key : tree.leaves())
        samples.push_back(scheduler.samples({finest - key.level, key.index}));
    shown.store = BrickStore(frame.brickCells, tree.leafCount(), samples.empty() ? 0 : samples[0]->channels);
    for (std::size_t leaf = 0; leaf < samples.size(); ++leaf)
        shown.store.put(leaf, tree.leaves()[leaf], *samples[leaf]);
    return shown;
}

BrickResult makeBricks(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                       const RefineOptions& options, const Execution& execution,
                       std::shared_ptr<BrickArchive> archive) {
    if (!options.criterion.has(Criterion::visibility) && !archive)
        return refineAndResample(mesh, fields, resampler, options, execution);
    Timer timer;
    execution.report(Stage::planning, 0, 1);
    ScheduleOptions schedule{
        .refine = options, .transferFunction = options.transferFunction, .archive = std::move(archive)};
    int channels = 0;
    for (const int f : fields) channels += mesh.fields[std::size_t(f)].components;
    schedule.budgetBytes =
        std::int64_t(leafBudget(options, channels)) * bytesOfBrick(channels, options.brickCells);
    Unseen target;
    BrickScheduler scheduler(mesh, fields, resampler, schedule, target, execution);
    BrickResult result;
    result.times.planMs = timer.restart();
    execution.report(Stage::sampling, 0, 1);
    const NearestOnDemand nearest(mesh, execution.threads);
    BricksShown shown;
    for (std::size_t leaves = 0;;) {
        scheduler.finish(execution);
        if (scheduler.tree().leafCount() == leaves) break;
        leaves = scheduler.tree().leafCount();
        const Depth finest = options.frame ? scheduler.frame().maxDepth : scheduler.tree().deepest();
        shown = bricksOf(scheduler, finest);
        if (!options.criterion.has(Criterion::error)) break;
        const Reconstruction reconstruction(mesh, fields, shown.tree, shown.store, nearest);
        std::vector<LeafFindings> findings =
            findAcrossBorders(scheduler, shown, finest, reconstruction, execution);
        scheduler.setFindings(findings);
    }
    result.tree = std::move(shown.tree);
    result.store = std::move(shown.store);
    result.statistics = scheduler.statistics();
    result.target = scheduler.resamplerTarget();
    if (scheduler.isCutShort())
        result.notes.push_back(
            "no more bricks fit: some are coarser than wished for; the finest spacing is " +
            shortNumber(result.tree.spacingWorld()));
    cropToKept(result.tree,
               {options.boundsWorld, result.tree.originWorld(), result.tree.spacingWorld(),
                result.tree.levelCount()},
               result.store);
    result.times.resampleMs = timer.restart();
    MeasureOptions measure;
    measure.boundsWorld = options.boundsWorld;
    result.report = measureError(mesh, fields, result.tree, result.store, nearest, execution, measure);
    result.times.verifyMs = timer.elapsedMs();
    const std::string exceeded = !options.criterion.has(Criterion::error) ? std::string()
                                 : isBoundedEverywhere(options)
                                     ? exceededBound(mesh, fields, options, result.report)
                                     : exceededWhereSeen(options, scheduler);
    result.bounded = exceeded.empty();
    if (result.bounded) return result;
    result.stoppedBecause = scheduler.isCutShort() ? "the bound on voxels" : "the finest spacing allowed";
    result.stoppedBecause += " ended the refinement at " + exceeded;
    return result;
}

}  // namespace tessera
