#include "refine/refine.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <tuple>

#include "base/parallel.h"
#include "base/text.h"
#include "base/timer.h"
#include "brick/kept_points.h"
#include "mesh/field_range.h"
#include "refine/brick_result.h"
#include "refine/error_bounds.h"
#include "refine/error_samples.h"
#include "refine/measure_error.h"
#include "refine/plan.h"
#include "refine/plan_frame.h"
#include "refine/refine_options.h"
#include "refine/resample_tree.h"
#include "tessera/error.h"

namespace tessera {

namespace {

// Error-driven refinement without bounds from the user stops here: a gigabyte a channel.
constexpr std::int64_t kDefaultErrorVoxels = std::int64_t(1) << 28;

// Built here, where all threads are free for it, when some place will very likely ask for it.
void buildIfNeeded(const NearestOnDemand& nearest, const BrickStore& store) {
    const std::int64_t points = std::int64_t(store.leafCount()) * store.tileCount() * kTilePoints;
    if (store.coveredPoints() < points) nearest.get();
}

// The bound as the caller gave it, for the message that it is too small.
std::string givenBound(const RefineOptions& options) {
    if (options.maxVoxels > 0) return ", the given bound " + std::to_string(options.maxVoxels) + " voxels";
    if (options.maxMemoryBytes > 0)
        return ", the given bound " + std::to_string(options.maxMemoryBytes) + " bytes";
    if (options.defaultMemoryBytes > 0)
        return ", the share of the memory here that is taken without --max-memory";
    return {};
}

KeptPoints keptPoints(const BrickTree& tree, const RefineOptions& options) {
    return {options.boundsWorld, tree.originWorld(), tree.spacingWorld(), tree.levelCount()};
}

class ErrorRefinement {
  public:
    ErrorRefinement(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                    const RefineOptions& options, const Execution& execution)
        : mesh_(mesh),
          fields_(fields),
          options_(options),
          execution_(execution),
          bound_(resampler.bind(mesh, fields, options.bind)),
          samples_(mesh, fields, execution),
          nearest_(mesh, execution.threads),
          bounds_(errorBounds(mesh, fields, samples_, options)),
          plan_(mesh, chooseFrame(meshBounds(mesh, execution, builtIndex(options)), options), execution,
                builtIndex(options)) {
        plan_.placeOfSample = [this](std::uint32_t sample) {
            return samples_.placeWorld(sample, plan_.frame().originWorld);
        };
        budgetLeaves_ = leafBudget(options, samples_.channels());
        if (options.maxVoxels == 0 && options.maxMemoryBytes == 0)
            budgetLeaves_ = std::min(budgetLeaves_, std::size_t(kDefaultErrorVoxels / brickPoints()));
        if (plan_.leafCount() == 0) throw InputError("the bounds do not meet the mesh");
        if (plan_.leafCount() > budgetLeaves_)
            throw InputError(
                "the coarsest plan has " + std::to_string(std::int64_t(plan_.leafCount()) * brickPoints()) +
                " voxels, more than the " + std::to_string(std::int64_t(budgetLeaves_) * brickPoints()) +
                " allowed; one brick is " + std::to_string(brickPoints()) + " voxels" + givenBound(options));
    }

    BrickResult run();

  private:
    std::int64_t brickPoints() const {
        const std::int64_t b = options_.brickCells;
        return b * b * b;
    }
    std::string budgetText() const {
        return "the bound on voxels (" + std::to_string(std::int64_t(budgetLeaves_) * brickPoints()) + ")";
    }
    void takeSamples();
    void splitByWishes();
    void sampleNewLeaves();
    void measureChanged();
    double expectedLater(double now) const;
    std::vector<DepthKey> wanted(std::size_t limit) const;
    bool refine();
    double totalMeanSquare() const;
    void addNodeWeights();
    bool touchesFresh(std::size_t leaf) const;
    double leafRatio(std::size_t leaf, const PlannedBrick& brick, LeafSampler& sampler) const;
    ErrorReport report();
    std::string whyStopped(const std::string& exceeded) const;

    const TetMesh& mesh_;
    std::span<const int> fields_;
    const RefineOptions& options_;
    const Execution& execution_;
    std::unique_ptr<BoundResampler> bound_;
    ErrorSamples samples_;
    NearestOnDemand nearest_;
    std::vector<FieldBound> bounds_;
    BrickPlan plan_;
    std::size_t budgetLeaves_ = 0;
    std::vector<PlannedBrick*> leaves_;  // in the order of tree_.leaves()
    std::vector<std::uint8_t> fresh_;    // sampled in this round
    BrickTree tree_;
    BrickStore store_;
    std::vector<double> nodeWeight_;  // rms: share of the volume that a node stands for
    double totalWeight_ = 0;
    ResampleStatistics statistics_;
    BrickTimes times_;
    std::string stopped_;
    int rounds_ = 0;
    double sampledBefore_ = 0;  // leaves that the last round sampled
    double worstRatio_ = 0;     // before the last split
};

// Gives every sample to the root brick that it lies in.
void ErrorRefinement::takeSamples() {
    const BrickTree roots = plan_.tree(Depth(0));
    const SamplesByLeaf sorted = sortSamples(samples_, roots, options_.boundsWorld, execution_);
    for (PlannedBrick* brick : plan_.leaves()) {
        const std::int64_t leaf = roots.findLeaf({0, brick->key.index});
        const auto ids = sorted.of(std::size_t(leaf));
        brick->samples.assign(ids.begin(), ids.end());
    }
}

// Other criteria ask for bricks before any error is known.
void ErrorRefinement::splitByWishes() {
    if (options_.criterion.isOnly(Criterion::error)) return;
    WishPlanning planning(mesh_, plan_.frame().meshBoundsWorld, options_, budgetLeaves_, execution_);
    std::vector<std::vector<DepthKey>> ofDepth;
    while (const auto split = planning.plan.next()) {
        const DepthKey& key = planning.bricks.key(split->brick);
        ofDepth.resize(std::max(ofDepth.size(), std::size_t(key.depth.halvings()) + 1));
        ofDepth[std::size_t(key.depth.halvings())].push_back(key);
        execution_.throwIfCancelled();
    }
    for (const auto& keys : ofDepth) plan_.split(keys, GrowingTree::kNoLimit, execution_);
    if (planning.plan.isCutShort()) stopped_ = budgetText();
}

// Builds the tree of the leaves that stand now, keeps the samples there are and takes the missing ones.
void ErrorRefinement::sampleNewLeaves() {
    Timer timer;
    const Depth finest = options_.frame ? plan_.frame().maxDepth : plan_.deepest();
    tree_ = plan_.tree(finest);
    // The plan has them ascending by depth, the tree by level: the finest first, in the same order within
    // one.
    leaves_.clear();
    leaves_.reserve(tree_.leafCount());
    const std::vector<PlannedBrick*> planned = plan_.leaves();
    for (auto end = planned.end(); end != planned.begin();) {
        auto begin = end;
        while (begin != planned.begin() && begin[-1]->key.depth == end[-1]->key.depth) --begin;
        leaves_.insert(leaves_.end(), begin, end);
        end = begin;
    }
    BrickStore next(tree_.brickCells(), tree_.leafCount(), samples_.channels());
    std::vector<std::size_t> missing;
    fresh_.assign(leaves_.size(), 0);
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
        if (leaves_[i]->sampled) {
            next.moveLeaf(i, store_, std::size_t(leaves_[i]->storeLeaf));
        } else {
            missing.push_back(i);
            fresh_[i] = 1;
        }
        leaves_[i]->sampled = true;
        leaves_[i]->storeLeaf = std::int64_t(i);
    }
    store_ = std::move(next);
    times_.planMs += timer.restart();
    const auto now = double(missing.size());
    execution_.beginRound(now, expectedLater(now));
    sampledBefore_ = now;
    resampleLeaves(tree_, missing, *bound_, store_, execution_, statistics_);
    times_.resampleMs += timer.elapsedMs();
}

// About how many leaves the rounds behind this one will sample, for progress alone: a level quarters the
// error, and each round grows or shrinks as this one did over the last.
double ErrorRefinement::expectedLater(double now) const {
    constexpr double kFirstGuess = 8;
    if (sampledBefore_ == 0) return kFirstGuess * now;
    const double growth = std::clamp(now / sampledBefore_, 0.5, 4.0);
    double later = 0, round = now;
    for (double ratio = worstRatio_ / 4; ratio > 1 && later < double(budgetLeaves_); ratio /= 4)
        later += round *= growth;
    return std::min(later, double(budgetLeaves_));
}

bool ErrorRefinement::touchesFresh(std::size_t leaf) const {
    if (fresh_[leaf]) return true;
    const BrickKey& key = tree_.leaves()[leaf];
    for (int n = 0; n < 27; ++n) {
        const BrickKey near{key.level, key.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)};
        const std::int64_t other = tree_.findCovering(near);
        // Only a leaf whose coarser neighbour went away reads other values than before; a finer neighbour
        // changes nothing here.
        if (other >= 0 && fresh_[std::size_t(other)]) return true;
    }
    return false;
}

// max: the largest error over its bound. rms: the leaf's part of the mean square, over the bound's square.
double ErrorRefinement::leafRatio(std::size_t leaf, const PlannedBrick& brick, LeafSampler& sampler) const {
    if (brick.samples.empty()) return 0;
    const bool rms = options_.measure == ErrorMeasure::rms;
    sampler.enter(leaf);
    std::vector<double> errors(samples_.fields().size());
    std::vector<double> ratios(bounds_.size(), 0.0);
    for (const std::uint32_t sample : brick.samples) {
        sampler.measure(sample, errors);
        for (std::size_t i = 0; i < bounds_.size(); ++i) {
            const double error = errors[bounds_[i].field] / bounds_[i].bound;
            if (!(error >= 0)) continue;
            if (!rms) {
                ratios[i] = std::max(ratios[i], error);
                continue;
            }
            const bool isNode = sample < samples_.nodeCount();
            double weight = 0;
            if (isNode)
                weight = nodeWeight_[sample];
            else
                weight = samples_.volumeWorld(sample - samples_.nodeCount()) *
                         (samples_.fields()[bounds_[i].field].isCell() ? 1.0 : 0.8);
            ratios[i] += weight / totalWeight_ * error * error;
        }
    }
    return ratios.empty() ? 0 : *std::max_element(ratios.begin(), ratios.end());
}

void ErrorRefinement::measureChanged() {
    Timer timer;
    if (rounds_ == 0) buildIfNeeded(nearest_, store_);
    const Reconstruction reconstruction(mesh_, fields_, tree_, store_, nearest_);
    constexpr std::int64_t kChunk = 16;
    const auto count = std::int64_t(leaves_.size());
    std::atomic<std::int64_t> done{0};
    execution_.report(Stage::checking, 0, count);
    parallelForChunks(execution_, count, kChunk, [&](std::int64_t begin, std::int64_t end) {
        LeafSampler sampler(samples_, tree_, store_, reconstruction);
        for (std::int64_t i = begin; i < end; ++i)
            if (touchesFresh(std::size_t(i)))
                leaves_[std::size_t(i)]->ratio = leafRatio(std::size_t(i), *leaves_[std::size_t(i)], sampler);
        execution_.report(Stage::checking, done += end - begin, count);
    });
    times_.verifyMs += timer.elapsedMs();
}

void ErrorRefinement::addNodeWeights() {
    nodeWeight_.assign(samples_.nodeCount(), 0.0);
    for (std::size_t e = 0; e < mesh_.tets.size(); ++e) {
        const double volume = samples_.volumeWorld(e);
        totalWeight_ += volume;
        for (const std::int32_t node : mesh_.tets[e]) nodeWeight_[std::size_t(node)] += volume / 20;
    }
}

// An upper estimate over the fields: each leaf counts with its worst field.
double ErrorRefinement::totalMeanSquare() const {
    double sum = 0;
    for (const PlannedBrick* leaf : leaves_) sum += leaf->ratio;
    return sum;
}

// Leaves to split, the worst first, at most `limit`.
std::vector<DepthKey> ErrorRefinement::wanted(std::size_t limit) const {
    std::vector<const PlannedBrick*> worst;
    const bool rms = options_.measure == ErrorMeasure::rms;
    const Depth maxDepth = plan_.frame().maxDepth;
    for (const PlannedBrick* leaf : leaves_)
        if (leaf->key.depth < maxDepth && leaf->ratio > (rms ? 0.0 : 1.0)) worst.push_back(leaf);
    std::stable_sort(worst.begin(), worst.end(),
                     [](const PlannedBrick* a, const PlannedBrick* b) { return a->ratio > b->ratio; });
    if (rms) {
        // Those that hold half of what is above the bound: splitting takes most of a leaf's error away.
        const double total = totalMeanSquare();
        double sum = 0;
        std::size_t count = 0;
        while (count < worst.size() && sum < std::max(0.5 * (total - 1), 0.02 * total))
            sum += worst[count++]->ratio;
        worst.resize(total > 1 ? count : 0);
    }
    if (worst.size() > limit) worst.resize(limit);
    std::vector<DepthKey> keys;
    for (const PlannedBrick* leaf : worst) keys.push_back(leaf->key);
    return keys;
}

// One round. False when nothing is left to split, or no split fits the budget.
bool ErrorRefinement::refine() {
    Timer timer;
    std::vector<DepthKey> keys = wanted(std::numeric_limits<std::size_t>::max());
    const bool any = !keys.empty();
    worstRatio_ = 0;
    for (const PlannedBrick* leaf : leaves_) worstRatio_ = std::max(worstRatio_, leaf->ratio);
    bool done = false;
    while (!keys.empty() && !(done = plan_.split(keys, budgetLeaves_, execution_))) {
        stopped_ = budgetText();
        keys.resize(keys.size() / 2);
    }
    times_.planMs += timer.elapsedMs();
    if (!any && stopped_.empty() &&
        std::any_of(leaves_.begin(), leaves_.end(), [](const PlannedBrick* leaf) { return leaf->ratio > 1; }))
        stopped_ = "the finest spacing allowed (" +
                   shortNumber(plan_.frame().spacingWorld(plan_.frame().maxDepth)) + ")";
    return done;
}

std::string ErrorRefinement::whyStopped(const std::string& exceeded) const {
    return (stopped_.empty() ? std::string("no brick left to split") : stopped_) +
           " ended the refinement at " + exceeded;
}

ErrorReport ErrorRefinement::report() {
    Timer timer;
    MeasureOptions measure;
    measure.boundsWorld = options_.boundsWorld;
    measure.samples = &samples_;
    ErrorReport result = measureError(mesh_, fields_, tree_, store_, nearest_, execution_, measure);
    times_.verifyMs += timer.elapsedMs();
    return result;
}

BrickResult ErrorRefinement::run() {
    Timer timer;
    if (options_.measure == ErrorMeasure::rms) addNodeWeights();
    takeSamples();
    splitByWishes();
    times_.planMs += timer.elapsedMs();
    BrickResult result;
    std::string exceeded;
    for (;;) {
        execution_.throwIfCancelled();
        sampleNewLeaves();
        measureChanged();
        ++rounds_;
        if (refine()) continue;
        result.report = report();
        exceeded = exceededBound(mesh_, fields_, options_, result.report);
        if (exceeded.empty() || !stopped_.empty()) break;
        // A coarse corner's value can change through a chain of level borders, beyond the neighbours that
        // were measured again.
        std::fill(fresh_.begin(), fresh_.end(), std::uint8_t(1));
        measureChanged();
        if (!refine()) break;
    }
    result.bounded = exceeded.empty();
    if (!result.bounded) result.stoppedBecause = whyStopped(exceeded);
    if (options_.boundsWorld) {
        cropToKept(tree_, keptPoints(tree_, options_), store_);
        result.report = report();
    }
    result.tree = std::move(tree_);
    result.store = std::move(store_);
    result.statistics = statistics_;
    result.target = bound_->target();
    result.times = times_;
    result.rounds = rounds_;
    return result;
}

}  // namespace

std::string exceededBound(const TetMesh& mesh, std::span<const int> fields, const RefineOptions& options,
                          const ErrorReport& report) {
    const bool rms = options.measure == ErrorMeasure::rms;
    std::string sentence;
    double worst = 1;
    for (std::size_t f = 0; f < fields.size(); ++f) {
        const FieldError& error = report.fields[f];
        if (!isBounded(mesh, fields[f], options)) continue;
        const double bound = boundOf(options, error.range);
        if (bound == 0) continue;  // a constant field has no relative error
        if (error.samples == 0)
            return report.nodes + report.centroids == 0
                       ? "no measured error: no node or centroid lies inside the bounds"
                   : report.incomplete > 0
                       ? "no measured error: every sample lies beside voxels that aren't there"
                       : "no measured error: no sample of field " + error.name +
                             " has a finite value as a 32-bit float";
        const double reached = rms ? error.rms : error.max;
        if (reached / bound <= worst) continue;
        worst = reached / bound;
        sentence = (rms ? "an RMS error of " : "a largest error of ") + shortNumber(reached) + " in " +
                   error.name + " (bound " + shortNumber(bound) + "); the worst spot is " +
                   placeText(error.worstPlaceWorld);
    }
    return sentence;
}

BrickResult refineAndResample(const TetMesh& mesh, std::span<const int> fields, const Resampler& resampler,
                              const RefineOptions& options, const Execution& execution) {
    Timer timer;
    if (options.criterion.has(Criterion::error)) {
        execution.report(Stage::planning, 0, 1);
        checkOptions(mesh, meshBounds(mesh, execution, builtIndex(options)), options);
        ErrorRefinement refinement(mesh, fields, resampler, options, execution);
        const double setupMs = timer.elapsedMs();
        BrickResult result = refinement.run();
        result.times.planMs += setupMs;
        return result;
    }
    BrickResult result;
    int channels = 0;
    for (const int f : fields) channels += mesh.fields[std::size_t(f)].components;
    result.tree = planBricks(mesh, options, execution, channels, &result.notes);
    result.times.planMs = timer.restart();
    const auto bound = resampler.bind(mesh, fields, options.bind);
    result.target = bound->target();
    execution.beginRound(double(result.tree.leafCount()), 0);
    result.store = resampleTree(result.tree, *bound, channels, execution, result.statistics);
    cropToKept(result.tree, keptPoints(result.tree, options), result.store);
    result.times.resampleMs = timer.restart();
    const NearestOnDemand nearest(mesh, execution.threads);
    buildIfNeeded(nearest, result.store);
    MeasureOptions measure;
    measure.boundsWorld = options.boundsWorld;
    result.report = measureError(mesh, fields, result.tree, result.store, nearest, execution, measure);
    result.times.verifyMs = timer.elapsedMs();
    return result;
}

}  // namespace tessera
