#include "schedule/schedule_bricks.h"

#include <algorithm>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "base/text.h"
#include "base/timer.h"
#include "brick/kept_points.h"
#include "brick/leaf_tiles.h"
#include "brick/root_grid.h"
#include "refine/measure_error.h"
#include "refine/plan_frame.h"
#include "refine/refine.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Of a run to its end nobody sees the states between.
class Unseen : public BrickTarget {
  public:
    void publish(const Publication&) override {}
};

/// While a scheduler works, errors are judged within single bricks. This judges leaves that border on coarser
/// ones as they are shown: on the border the coarser brick's samples decide.
class BorderJudge {
  public:
    BorderJudge(const TetMesh& mesh, std::span<const int> fields, const BrickScheduler& scheduler)
        : mesh_(mesh), fields_(fields), scheduler_(scheduler) {}

    std::vector<LeafFindings> judge(const BricksShown& shown, Depth finest, const NearestOnDemand& nearest,
                                    const Execution& execution) {
        const BrickTree& tree = shown.tree;
        const Reconstruction reconstruction(mesh_, fields_, tree, shown.store, nearest);
        std::vector<LeafFindings> findings;
        std::vector<bool> bordersOnCoarser;
        for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
            const BrickKey& key = tree.leaves()[leaf];
            const DepthKey depthKey{finest - key.level, key.index};
            const bool borders = hasCoarserNeighbour(tree, leaf);
            // What was found across a border that is no more is found anew.
            if (!borders && !judged_.contains(depthKey)) continue;
            findings.push_back({depthKey, {}});
            bordersOnCoarser.push_back(borders);
            judged_.insert(depthKey);
        }
        parallelFor(execution.withoutProgress(), std::int64_t(findings.size()), [&](std::int64_t i) {
            auto& [leaf, found] = findings[std::size_t(i)];
            const int level = levelOf(leaf.depth, finest);
            BrickInspector::BorderValues border;
            if (bordersOnCoarser[std::size_t(i)])
                border = [&](const Vec3i& p, std::span<double> values) {
                    reconstruction.resolve(level, p, 0, values);
                };
            found = scheduler_.wishes().inspector->inspect(leaf, *scheduler_.samples(leaf),
                                                           scheduler_.frame(), border);
        });
        return findings;
    }

  private:
    const TetMesh& mesh_;
    std::span<const int> fields_;
    const BrickScheduler& scheduler_;
    std::unordered_set<DepthKey, DepthKeyHash> judged_;
};

// Where a bound on visible errors isn't kept: what was reached.
std::string exceededWhereSeen(const std::string& field, const BrickScheduler& scheduler) {
    double worst = 1;
    for (const GrowingLeaf& leaf : scheduler.tree().leaves())
        worst = std::max(worst, scheduler.errorOverBound(leaf.key));
    if (worst <= 1) return {};
    const double bound = scheduler.wishes().inspector->watchedBound();
    return "a largest error of " + shortNumber(worst * bound) + " in " + field + " where it is seen (bound " +
           shortNumber(bound) + ")";
}

const std::string& watchedField(const TetMesh& mesh, std::span<const int> fields,
                                const RefineOptions& options) {
    return options.transferFunction && !options.transferFunction->field.empty()
               ? options.transferFunction->field
               : mesh.fields[std::size_t(fields[0])].name;
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
    const bool byError = options.criterion.has(Criterion::error);
    if (byError && options.measure == ErrorMeasure::rms)
        throw InputError(
            "an RMS error is one of the whole mesh: with visibility, or bricks that are kept in a log, "
            "choose the largest error");
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
    BorderJudge borders(mesh, fields, scheduler);
    for (std::int64_t published = -1;;) {
        scheduler.finish(execution);
        if (scheduler.counts().published == published) break;  // what was found asks for no more
        published = scheduler.counts().published;
        if (scheduler.tree().leafCount() == 0) throw InputError("the bounds do not meet the mesh");
        const Depth finest = options.frame ? scheduler.frame().maxDepth : scheduler.tree().deepest();
        shown = {};
        shown = bricksOf(scheduler, finest);
        // Without room for all that is wished for already there is none for more.
        if (!byError || scheduler.isCutShort()) break;
        std::vector<LeafFindings> findings = borders.judge(shown, finest, nearest, execution);
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
    const std::string exceeded = !byError ? std::string()
                                 : isBoundedEverywhere(options)
                                     ? exceededBound(mesh, fields, options, result.report)
                                     : exceededWhereSeen(watchedField(mesh, fields, options), scheduler);
    result.bounded = exceeded.empty();
    if (result.bounded) return result;
    result.stoppedBecause = scheduler.isCutShort() ? "the bound on voxels"
                            : scheduler.tree().deepest() < scheduler.frame().maxDepth
                                ? "no brick left to split"
                                : "the finest spacing allowed";
    result.stoppedBecause += " ended the refinement at " + exceeded;
    return result;
}

}  // namespace tessera
