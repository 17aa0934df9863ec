#include <algorithm>
#include <atomic>
#include <cmath>
#include <unordered_map>

#include "base/floor_div.h"
#include "refine/resample_tree.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

constexpr int kGroupPoints = 64;     // points along the edge of the largest block
constexpr double kGroupBytes = 8e6;  // and its size at most
constexpr double kGroupFill = 0.75;  // share of a block that leaves must own

// One block to sample: the leaves (all of one level) whose points it holds.
struct Group {
    IndexBox box;
    std::vector<std::size_t> leaves;
};

// Bricks along the edge of the largest group: a power of two.
int groupBricks(int brickCells, int channels) {
    int edge = std::max(1, kGroupPoints / brickCells);
    while (edge > 1 && std::pow(double(edge * brickCells), 3) * (4.0 * channels + 1) > kGroupBytes) edge /= 2;
    return edge;
}

// Splits until what a block would sample is mostly owned by its leaves.
void group(const BrickTree& tree, std::vector<std::size_t> members, int edge, std::vector<Group>& groups) {
    if (members.empty()) return;
    Vec3i low(tree.leaves()[members[0]].index), high = low;
    for (const std::size_t leaf : members) {
        low = glm::min(low, tree.leaves()[leaf].index);
        high = glm::max(high, tree.leaves()[leaf].index);
    }
    const Vec3i n = high - low + 1;
    if (double(members.size()) >= kGroupFill * double(n.x) * n.y * n.z) {
        const int b = tree.brickCells();
        groups.push_back({{low * b, (high + 1) * b}, std::move(members)});
        return;
    }
    const int half = edge / 2;
    std::array<std::vector<std::size_t>, 8> parts;
    for (const std::size_t leaf : members) {
        const Vec3i& i = tree.leaves()[leaf].index;
        const auto upper = [&](int v) { return v - floorDiv(v, edge) * edge >= half ? 1 : 0; };
        parts[std::size_t(upper(i.x) | upper(i.y) << 1 | upper(i.z) << 2)].push_back(leaf);
    }
    for (auto& part : parts) group(tree, std::move(part), half, groups);
}

std::vector<Group> groupLevel(const BrickTree& tree, const std::vector<std::size_t>& leaves, int edge) {
    std::unordered_map<BrickKey, std::size_t, BrickKeyHash> groupAt;
    std::vector<std::vector<std::size_t>> cubes;
    for (const std::size_t leaf : leaves) {
        const auto [slot, fresh] =
            groupAt.try_emplace({0, floorDiv(tree.leaves()[leaf].index, edge)}, cubes.size());
        if (fresh) cubes.emplace_back();
        cubes[slot->second].push_back(leaf);
    }
    std::vector<Group> groups;
    for (auto& cube : cubes) group(tree, std::move(cube), edge, groups);
    return groups;
}

}  // namespace

void resampleLeaves(const BrickTree& tree, std::span<const std::size_t> leaves, BoundResampler& resampler,
                    BrickStore& store, const Execution& execution, ResampleStatistics& statistics) {
    std::atomic<std::int64_t> done{0};
    const std::int64_t total = std::int64_t(leaves.size());
    execution.report(Stage::sampling, 0, total);
    const Execution silent = execution.withoutProgress();
    const int edge = groupBricks(tree.brickCells(), store.channels());
    std::vector<std::vector<std::size_t>> byLevel(std::size_t(tree.levelCount()));
    for (const std::size_t leaf : leaves) byLevel[std::size_t(tree.leaves()[leaf].level)].push_back(leaf);
    for (int level = 0; level < tree.levelCount(); ++level) {
        if (byLevel[std::size_t(level)].empty()) continue;
        execution.throwIfCancelled();
        const std::vector<Group> groups = groupLevel(tree, byLevel[std::size_t(level)], edge);
        std::vector<IndexBox> boxes;
        boxes.reserve(groups.size());
        for (const Group& g : groups) boxes.push_back(g.box);
        const auto sink = [&](std::size_t box, const Block& block) {
            for (const std::size_t leaf : groups[box].leaves) store.put(leaf, tree.leaves()[leaf], block);
            const std::int64_t count = std::int64_t(groups[box].leaves.size());
            execution.report(Stage::sampling, done += count, total);
        };
        statistics += resampler.resample(tree.lattice(level), boxes, sink, silent);
    }
}

BrickStore resampleTree(const BrickTree& tree, BoundResampler& resampler, int channels,
                        const Execution& execution, ResampleStatistics& statistics) {
    BrickStore store(tree.brickCells(), tree.leafCount(), channels);
    std::vector<std::size_t> all(tree.leafCount());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    resampleLeaves(tree, all, resampler, store, execution, statistics);
    return store;
}

}  // namespace tessera
