#include "job/predict_cost.h"

#include <algorithm>
#include <vector>

#include "base/timer.h"
#include "refine/plan.h"

namespace tessera {

namespace {

constexpr std::int64_t kTrialLeaves = 64;
constexpr double kWriteBytesPerMs = 250e3;        // Blosc on one thread
constexpr double kReconstructPointsPerMs = 20e3;  // trilinear, one thread and channel

double sampleMs(BoundResampler& bound, const BrickTree& tree, std::int64_t stride,
                const Execution& execution) {
    Timer timer;
    const std::span<const BrickKey> leaves = tree.leaves();
    std::vector<std::vector<IndexBox>> boxes(std::size_t(tree.levelCount()));
    for (std::size_t i = 0; i < leaves.size(); i += std::size_t(stride))
        boxes[std::size_t(leaves[i].level)].push_back(tree.ownedPoints(leaves[i]));
    for (std::size_t l = 0; l < boxes.size(); ++l)
        if (!boxes[l].empty())
            bound.resample(
                tree.lattice(int(l)), boxes[l], [](std::size_t, const Block&) {}, execution);
    return timer.elapsedMs();
}

}  // namespace

CostPrediction predictCost(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                           const PlanEstimate& estimate, int channels, const Resampler& resampler,
                           const BindOptions& bind, const Execution& execution) {
    CostPrediction cost;
    const std::int64_t leaves = std::int64_t(tree.leafCount());
    if (leaves == 0) return cost;
    const auto bound = resampler.bind(mesh, fields, bind);
    const Execution silent = execution.withoutProgress();
    // Every call passes over all elements once, whatever it samples: a call for one leaf tells that part, a
    // call for more the rest.
    const double fixedMs = sampleMs(*bound, tree, leaves, silent);
    const std::int64_t stride = std::max<std::int64_t>(1, leaves / kTrialLeaves);
    const double trialMs = sampleMs(*bound, tree, stride, silent);
    const std::int64_t trialLeaves = (leaves + stride - 1) / stride;
    const double leafMs =
        std::max(0.0, trialMs - fixedMs) / double(std::max<std::int64_t>(1, trialLeaves - 1));
    cost.levelsMs = fixedMs + leafMs * double(leaves) + double(estimate.levelsBytes) / kWriteBytesPerMs;
    cost.flatMs =
        fixedMs + leafMs * double(leaves) + double(estimate.flatBytes) / kWriteBytesPerMs +
        double(estimate.flatPoints) * channels / (kReconstructPointsPerMs * execution.threadCount());
    return cost;
}

}  // namespace tessera
