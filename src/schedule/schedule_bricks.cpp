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
    scheduler.finish(execution);
    const Depth finest = options.frame ? scheduler.frame().maxDepth : scheduler.tree().deepest();
    BricksShown shown = bricksOf(scheduler, finest);
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
    const NearestOnDemand nearest(mesh, execution.threads);
    MeasureOptions measure;
    measure.boundsWorld = options.boundsWorld;
    result.report = measureError(mesh, fields, result.tree, result.store, nearest, execution, measure);
    result.times.verifyMs = timer.elapsedMs();
    result.bounded = true;
    if (!isBoundedEverywhere(options)) return result;
    const std::string exceeded = exceededBound(mesh, fields, options, result.report);
    result.bounded = exceeded.empty();
    if (result.bounded) return result;
    // Errors are judged within single bricks; across borders between levels more can be measured.
    result.stoppedBecause = scheduler.isCutShort() ? "the bound on voxels"
                            : scheduler.tree().deepest() < scheduler.frame().maxDepth
                                ? "single bricks within the bound"
                                : "the finest spacing allowed";
    result.stoppedBecause += " ended the refinement at " + exceeded;
    return result;
}

}  // namespace tessera
