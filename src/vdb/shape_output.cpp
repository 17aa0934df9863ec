#include "vdb/shape_output.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/machine_memory.h"
#include "base/text.h"
#include "brick/extend.h"
#include "brick/flatten.h"
#include "brick/surface_distance.h"
#include "refine/brick_result.h"
#include "refine/measure_error.h"
#include "tessera/lattice.h"
#include "vdb/vdb_metadata.h"
#include "vdb/vdb_write.h"

namespace tessera {

namespace {

constexpr std::int64_t kDefaultFlatPoints = std::int64_t(1) << 26;  // seconds of work
constexpr std::int64_t kMostFlatPoints = std::int64_t(1) << 31;

int finestLevel(const BrickTree& tree) {
    return tree.leafCount() > 0 ? tree.leaves().front().level : 0;
}

FlatBricks makeFlat(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                    const BindOptions& bind, const OutputShape& shape, int level,
                    const NearestOnDemand& nearest, BrickResult& result, const Execution& execution) {
    const CoverageSource coverage = [&](const Lattice& lattice, std::span<const IndexBox> boxes,
                                        const BlockSink& sink) {
        BindOptions geometry = bind;
        geometry.format = SampleFormat::r32f;  // there are no values
        result.statistics += resampler.bind(mesh, {}, geometry)->resample(lattice, boxes, sink, execution);
    };
    return flatten(mesh, fields, result.tree, result.store, nearest, coverage,
                   {level, shape.boundsWorld, shape.layers}, execution);
}

}  // namespace

FlatGridPlan planFlatGrid(const BrickTree& tree, int channels, const OutputShape& shape) {
    const double pointBytes = 4.0 * channels + 0.125;
    const std::int64_t maxBytes = shape.maxFlatBytes > 0 ? shape.maxFlatBytes : machineMemoryBytes() / 4;
    const std::int64_t byMemory = std::int64_t(double(maxBytes) / pointBytes);
    const int finest = finestLevel(tree);
    // Bricks of one level are the grid already: the plan has bounded them.
    const std::int64_t byDefault = tree.levelCount() == finest + 1 ? kMostFlatPoints : kDefaultFlatPoints;
    const std::int64_t byCount =
        shape.maxFlatVoxels > 0 ? std::min(shape.maxFlatVoxels, kMostFlatPoints) : byDefault;
    const std::int64_t limit = std::min(byCount, byMemory);
    FlatGridPlan plan;
    plan.level = std::max(finest, chooseFlatLevel(tree, limit));
    plan.isCapped = plan.level > finest;
    const double points = flatPointCount(tree, plan.level);
    plan.points = std::int64_t(std::ceil(points));
    plan.bytes = std::int64_t(std::ceil(points * pointBytes));
    if (!plan.isCapped) return plan;
    // Where memory decides, more voxels alone would change nothing.
    std::string more = "give a larger --max-voxels for a finer grid";
    if (byCount >= kMostFlatPoints && byMemory >= kMostFlatPoints) {
        more = "no flat grid can hold more; --layout levels keeps every level";
    } else if (byMemory < byCount) {
        more = "the memory allowed for it decides: give a larger --max-memory";
        if (shape.maxFlatVoxels == 0) more += " and --max-voxels";
        more += " for a finer grid";
    }
    plan.note = "the flat grid has spacing " + exactText(tree.spacingWorld(plan.level)) + " (level " +
                std::to_string(plan.level) + ") instead of " + exactText(tree.spacingWorld(finest)) +
                ": at the finest it would hold " +
                std::to_string(std::int64_t(std::min(flatPointCount(tree, finest), 9e18))) +
                " voxels, the limit is " + std::to_string(limit) + "; " + more;
    return plan;
}

void shapeForFile(const TetMesh& mesh, std::span<const int> fields, const std::vector<OutputField>& outputs,
                  const Resampler& resampler, const BindOptions& bind, const OutputShape& shape,
                  BrickResult& result, const Execution& execution) {
    const bool isFlat = shape.layout == VdbLayout::flat;
    const NearestOnDemand nearest(mesh, execution.threads);
    bool isCoarser = false;
    if (isFlat) {
        const FlatGridPlan plan = planFlatGrid(result.tree, result.store.channels(), shape);
        FlatBricks flat =
            makeFlat(mesh, fields, resampler, bind, shape, plan.level, nearest, result, execution);
        result.bricks = std::exchange(result.tree, std::move(flat.tree));
        result.store = std::move(flat.store);
        result.flatLevel = plan.level;
        isCoarser = plan.isCapped;
    } else if (shape.hasSurface()) {
        const Reconstruction reconstruction(mesh, fields, result.tree, result.store, nearest);
        const KeptPoints kept(shape.boundsWorld, result.tree.originWorld(), result.tree.spacingWorld(),
                              result.tree.levelCount());
        extendOutside(
            mesh, result.tree, result.store, reconstruction, kept, shape.layers,
            [&](int level, const Vec3i& p, std::span<double> values) {
                reconstruction.nearestValues(level, p, 0, values);
            },
            execution);
        measureSurface(result.tree, result.store, reconstruction, nearest, kept, execution);
    }
    bool isRounded = false;
    if (shape.halfFloat) {
        const std::vector<bool> toHalf = gridsInHalf(outputs, result.store);
        roundToHalf(outputs, toHalf, result.store, execution);
        isRounded = std::find(toHalf.begin(), toHalf.end(), true) != toHalf.end();
    }
    const bool isChanged = isFlat || isRounded;
    if (!isChanged && !shape.leafErrors) return;
    MeasureOptions measure;
    measure.boundsWorld = shape.boundsWorld;
    measure.outside = isFlat ? Outside::missing : Outside::nearest;
    if (shape.leafErrors) measure.leafErrors = &result.leafErrors;
    ErrorReport ofFile = measureError(mesh, fields, result.tree, result.store, nearest, execution, measure);
    if (!isChanged) return;
    for (std::size_t f = 0; f < ofFile.fields.size(); ++f)
        ofFile.fields[f].name = result.report.fields[f].name;
    // With an extension only voxels without a finite value are absent, and those were skipped.
    if (shape.layers > 0) ofFile.incomplete = 0;
    if (isCoarser || isRounded || ofFile.incomplete > 0) result.samplesReport = std::move(result.report);
    result.report = std::move(ofFile);
}

}  // namespace tessera
