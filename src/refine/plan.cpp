#include "refine/plan.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/check.h"
#include "base/parallel.h"
#include "base/text.h"
#include "refine/element_size.h"
#include "refine/plan_frame.h"
#include "refine/refine_options.h"
#include "refine/wish_plan.h"
#include "refine/wishes.h"
#include "tessera/error.h"

namespace tessera {

namespace {

// Without any bound or spacing from the user a plan by element size stays below this.
constexpr std::int64_t kDefaultElementSizeVoxels = 20'000'000;

// A box inside a mesh may hold few elements: the coarsest spacing is what the largest of them asks for, up to
// two points along the box.
void coarsenRoot(PlanFrame& frame, std::vector<float>& sizes, double samplesPerElement) {
    const double wanted = double(*std::max_element(sizes.begin(), sizes.end())) / samplesPerElement;
    const Vec3d box = frame.boundsWorld->size();
    const double most = std::max({box.x, box.y, box.z}) / frame.rootSpacingWorld;
    int up = 0;
    while (std::ldexp(1.0, up + 1) <= std::min(wanted, most)) ++up;
    frame.rootSpacingWorld = std::ldexp(frame.rootSpacingWorld, up);
    frame.maxDepth = frame.maxDepth + up;
    for (float& size : sizes) size = std::ldexp(size, -up);
}

// Whether the size that a brick's spacing follows, the kSizeQuantile quantile of its elements' sizes, is too
// small for a spacing. Counting tells without sorting; elements without a size don't count.
bool hasTooSmall(const PlannedBrick& brick, const std::vector<float>& sizes, double spacing,
                 double samplesPerElement) {
    std::int64_t count = 0, smaller = 0;
    for (const std::int32_t e : brick.elements) {
        const float size = sizes[std::size_t(e)];
        if (!(size > 0)) continue;
        ++count;
        smaller += spacing > double(size) / samplesPerElement;
    }
    return smaller > mostTooSmall(count);
}

std::int64_t countUniform(const TetMesh& mesh, PlanFrame frame, std::size_t maxLeaves,
                          std::vector<BrickKey>* keys, const Execution& execution) {
    const std::int64_t count = touchedBricks(mesh, frame, std::int64_t(maxLeaves), keys, execution);
    if (count >= 0) return count;
    // Too large a box of bricks for a grid of marks: go down from coarse bricks, leaving empty space out on
    // the way.
    const int down = 8;
    frame.rootSpacingWorld = std::ldexp(frame.rootSpacingWorld, down);
    frame.maxDepth = Depth(down);
    BrickPlan plan(mesh, frame, execution);
    for (int depth = 0; depth < down; ++depth) {
        std::vector<DepthKey> all;
        for (const PlannedBrick* brick : plan.leaves()) all.push_back(brick->key);
        if (!plan.split(all, maxLeaves, execution)) return std::int64_t(maxLeaves) + 1;
    }
    if (keys)
        for (const PlannedBrick* brick : plan.leaves()) keys->push_back({0, brick->key.index});
    return std::int64_t(plan.leafCount());
}

// Largest resolution whose plan fits, by bisection; 0 when none does.
int largestResolution(const TetMesh& mesh, const Box3d& meshBox, RefineOptions options, std::size_t maxLeaves,
                      int tooLarge, const Execution& execution) {
    options.frame.reset();
    options.spacingWorld = 0;
    int fits = 1, fails = tooLarge;
    while (fails - fits > std::max(1, fits / 64)) {
        // Counts grow with the cube; aim at a tenth of the interval first when it is wide.
        options.resolution =
            fails > 8 * fits ? std::max(fits + 1, int(std::sqrt(double(fits) * fails))) : (fits + fails) / 2;
        const std::int64_t count =
            countUniform(mesh, chooseFrame(meshBox, options), maxLeaves, nullptr, execution);
        (count <= std::int64_t(maxLeaves) ? fits : fails) = options.resolution;
    }
    return fits > 1 ? fits : 0;
}

std::string budgetText(const RefineOptions& options, std::size_t maxLeaves) {
    const double brickPoints = std::pow(options.brickCells, 3);
    const bool byVoxels =
        options.maxVoxels > 0 && double(maxLeaves + 1) * brickPoints > double(options.maxVoxels);
    const std::string ofMemory = "the share of the memory here that is taken without --max-memory";
    if (maxLeaves == 0)  // zero voxels would say nothing of the bound that was given
        return (byVoxels ? "the given bound of " + shortNumber(double(options.maxVoxels)) + " voxels"
                : options.maxMemoryBytes > 0
                    ? "the given bound of " + shortNumber(double(options.maxMemoryBytes)) + " bytes"
                    : ofMemory) +
               " holds (one brick is " + shortNumber(brickPoints) + " voxels)";
    const double points = double(maxLeaves) * brickPoints;
    return shortNumber(points) + " voxels (" +
           (byVoxels || options.maxMemoryBytes > 0 ? "the given bound" : ofMemory) + ")";
}

BrickTree planUniform(const TetMesh& mesh, const Box3d& meshBox, const RefineOptions& options,
                      std::size_t maxLeaves, const Execution& execution) {
    const PlanFrame frame = chooseFrame(meshBox, options);
    std::vector<BrickKey> keys;
    const std::int64_t count = countUniform(mesh, frame, maxLeaves, &keys, execution);
    if (count > std::int64_t(maxLeaves)) {
        const Vec3d size = (options.boundsWorld ? *options.boundsWorld : meshBox).size();
        const double longest = std::max({size.x, size.y, size.z});
        const int points = int(std::min(5e8, std::ceil(longest / frame.spacingWorld(Depth(0))) + 1));
        const int fits = largestResolution(mesh, meshBox, options, maxLeaves, points, execution);
        throw InputError("the uniform lattice of " + std::to_string(points) +
                         " points along the longest axis needs more than " + budgetText(options, maxLeaves) +
                         (fits ? "; a resolution of " + std::to_string(fits) + " (spacing " +
                                     shortNumber(longest / (fits - 1)) + ") fits"
                               : "; not even one brick fits"));
    }
    return BrickTree(frame.originWorld, frame.spacingWorld(frame.maxDepth), frame.brickCells,
                     std::move(keys));
}

BrickTree planByElementSize(const TetMesh& mesh, const Box3d& meshBox, const RefineOptions& options,
                            std::size_t maxLeaves, const Execution& execution,
                            std::vector<std::string>* notes) {
    PlanFrame frame = chooseFrame(meshBox, options);
    const bool isDefault =
        options.maxVoxels == 0 && options.maxMemoryBytes == 0 && !hasFinestSpacing(options);
    const std::size_t brickPoints = std::size_t(std::pow(options.brickCells, 3));
    if (isDefault) maxLeaves = std::min(maxLeaves, kDefaultElementSizeVoxels / brickPoints);
    std::vector<float> sizes = elementSizes(mesh, frame.rootSpacingWorld, options.boundsWorld, execution);
    if (options.boundsWorld && !hasFinestSpacing(options) && options.maxLevels == 0)
        coarsenRoot(frame, sizes, options.samplesPerElement);
    BrickPlan plan(mesh, frame, execution, builtIndex(options));
    if (plan.leafCount() > maxLeaves)
        throw InputError("the coarsest plan has " + std::to_string(plan.leafCount() * brickPoints) +
                         " voxels, more than " + budgetText(options, maxLeaves) +
                         "; smaller bricks, a larger spacing or smaller bounds need fewer");
    const int depths = frame.maxDepth.halvings();
    for (int d = 0; d < depths; ++d) {
        const Depth depth(d);
        execution.report(Stage::planning, d, depths);
        const auto leaves = plan.leaves();
        std::vector<std::uint8_t> wanted(leaves.size(), 0);
        parallelFor(execution, std::int64_t(leaves.size()), [&](std::int64_t i) {
            const PlannedBrick& brick = *leaves[std::size_t(i)];
            if (brick.key.depth != depth) return;
            const double spacing = std::ldexp(1.0, -d);  // in units of the root spacing, as the sizes are
            wanted[std::size_t(i)] = hasTooSmall(brick, sizes, spacing, options.samplesPerElement) ? 1 : 0;
        });
        std::vector<DepthKey> splits;
        for (std::size_t i = 0; i < leaves.size(); ++i)
            if (wanted[i]) splits.push_back(leaves[i]->key);
        if (splits.empty()) break;
        if (plan.split(splits, maxLeaves, execution)) continue;
        const std::string fits = shortNumber(frame.spacingWorld(depth));
        if (hasFinestSpacing(options))
            throw InputError("bricks down to a spacing of " +
                             shortNumber(frame.spacingWorld(frame.maxDepth)) + " need more than " +
                             budgetText(options, maxLeaves) + "; a finest spacing of " + fits + " fits");
        if (notes)
            notes->push_back("the elements ask for a spacing below " + fits +
                             ", which would take more than " + shortNumber(double(maxLeaves * brickPoints)) +
                             " voxels: the finest spacing is " + fits);
        break;
    }
    return plan.tree(options.frame ? frame.maxDepth : plan.deepest());
}

BrickTree planByWishes(const TetMesh& mesh, const Box3d& meshBox, const RefineOptions& options,
                       std::size_t maxLeaves, const Execution& execution, std::vector<std::string>* notes) {
    const std::size_t brickPoints = std::size_t(std::pow(options.brickCells, 3));
    const bool isDefault = options.maxVoxels == 0 && options.maxMemoryBytes == 0;
    if (isDefault && options.criterion.has(Criterion::elementSize) && !hasFinestSpacing(options))
        maxLeaves = std::min(maxLeaves, kDefaultElementSizeVoxels / brickPoints);
    WishPlanning planning(mesh, meshBox, options, maxLeaves, execution);
    planning.plan.complete(execution);
    const WishPlan& plan = planning.plan;
    const PlanFrame& frame = planning.bricks.frame();
    if (plan.isCutShort() && notes) {
        std::int64_t unmet = 0;
        for (const MeshBricks::Number brick : plan.leaves())
            unmet += isTooCoarse(planning.bricks.spacingWorld(brick), plan.wishedSpacing(brick));
        notes->push_back("no more than " + shortNumber(double(maxLeaves * brickPoints)) +
                         " voxels fit: " + std::to_string(unmet) + " of " + std::to_string(plan.leafCount()) +
                         " bricks are coarser than wished for; the finest spacing is " +
                         shortNumber(frame.spacingWorld(plan.deepest())));
    }
    return plan.brickTree(options.frame ? frame.maxDepth : plan.deepest());
}

}  // namespace

WishPlanning::WishPlanning(const TetMesh& mesh, const Box3d& meshBox, const RefineOptions& options,
                           std::size_t maxLeaves, const Execution& execution)
    : bricks(options.bind.index ? options.bind.index : std::make_shared<const SharedElementIndex>(mesh),
             chooseFrame(meshBox, options),
             options.criterion.has(Criterion::elementSize) ? options.samplesPerElement : 0, execution),
      plan(bricks,
           Wishes{.focus = options.criterion.has(Criterion::focus) ? options.focus : std::vector<Focus>{},
                  .finestSpacingWorld = focusSpacing(meshBox, options)},
           {PlanLimit::Counts::leaves, maxLeaves}) {}

BrickTree planBricks(const TetMesh& mesh, const RefineOptions& options, const Execution& execution,
                     int channels, std::vector<std::string>* notes) {
    const Box3d meshBox = meshBounds(mesh, execution, builtIndex(options));
    checkOptions(mesh, meshBox, options);
    const Criteria criteria = options.criterion;
    TESSERA_CHECK(!criteria.has(Criterion::error), "error-driven refinement plans as it samples");
    execution.report(Stage::planning, 0, 1);
    const std::size_t maxLeaves = leafBudget(options, channels);
    BrickTree tree = criteria.has(Criterion::uniform)
                         ? planUniform(mesh, meshBox, options, maxLeaves, execution)
                     : criteria.has(Criterion::focus)
                         ? planByWishes(mesh, meshBox, options, maxLeaves, execution, notes)
                         : planByElementSize(mesh, meshBox, options, maxLeaves, execution, notes);
    if (tree.leafCount() == 0) throw InputError("the bounds do not meet the mesh");
    execution.report(Stage::planning, 1, 1);
    return tree;
}

PlanEstimate estimatePlan(const BrickTree& tree, int channels) {
    PlanEstimate estimate;
    const std::int64_t b = tree.brickCells();
    estimate.bricksPerLevel.assign(std::size_t(tree.levelCount()), 0);
    double flat = 0;
    int finest = tree.levelCount();
    for (const BrickKey& key : tree.leaves()) {
        ++estimate.bricksPerLevel[std::size_t(key.level)];
        finest = std::min(finest, key.level);
        flat += std::ldexp(double(b * b * b), 3 * key.level);
    }
    flat = std::ldexp(flat, -3 * finest);
    constexpr double kMost = 9e18;
    const double bytesPerPoint = 4.0 * channels + 0.125;
    estimate.storedPoints = std::int64_t(tree.leafCount()) * b * b * b;
    estimate.levelsBytes = std::int64_t(double(estimate.storedPoints) * bytesPerPoint);
    estimate.flatPoints = std::int64_t(std::min(flat, kMost));
    estimate.flatBytes = std::int64_t(std::min(flat * bytesPerPoint, kMost));
    return estimate;
}

}  // namespace tessera
