// Times one split and one merge in growing trees of a thousand to a million bricks: a random leaf is split,
// coarser neighbours with it until the tree is balanced again, then what was split is merged again. "of
// bricks" says how many one split took on average, "a brick" what one of them cost, "of one" the median of
// the splits that took no neighbour with them.
// tree_cost [--changes 20000] [--rounds 3] [--csv bench/results/tree_cost.csv]

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <numeric>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "arguments.h"
#include "bench_statistics.h"
#include "brick/growing_tree.h"

namespace {

using tessera::ChildBits;
using tessera::DepthKey;
using tessera::GrowingLeaf;
using tessera::GrowingTree;
using Clock = std::chrono::steady_clock;

void allChildren(std::span<const GrowingLeaf>, std::span<ChildBits> children) {
    std::fill(children.begin(), children.end(), tessera::kAllChildren);
}

/// Bricks that are the finer the nearer they lie to a sphere, about `bricks` of them.
GrowingTree treeAroundSphere(std::size_t bricks) {
    constexpr int kRoots = 4;
    std::vector<tessera::Vec3i> roots;
    for (int i = 0; i < kRoots * kRoots * kRoots; ++i)
        roots.emplace_back(i % kRoots, i / kRoots % kRoots, i / kRoots / kRoots);
    GrowingTree tree(roots);
    const auto meetsSphere = [](const DepthKey& key) {
        const double size = std::ldexp(1.0, -key.depth.halvings());
        const tessera::Vec3d middle = (tessera::Vec3d(key.index) + 0.5) * size;
        return std::abs(glm::length(middle - tessera::Vec3d(1.97, 2.03, 2.01)) - 1.3) < size;
    };
    while (tree.leafCount() < bricks) {
        const tessera::Depth deepest = tree.deepest();
        for (const GrowingLeaf& leaf : tree.leaves())
            if (tree.leafCount() < bricks && leaf.key.depth == deepest && meetsSphere(leaf.key))
                tree.split(leaf.key, allChildren);
    }
    return tree;
}

struct Times {
    std::vector<double> splitNs, mergeNs, bricksOfSplit;
};

double nanoseconds(Clock::time_point begin, Clock::time_point end) {
    return double(std::chrono::duration_cast<std::chrono::nanoseconds>(end - begin).count());
}

/// Leaves the tree as it was. Of what a change removes, the last bricks were split last.
void timeChanges(GrowingTree& tree, int changes, std::mt19937& random, Times& times) {
    const std::vector<GrowingLeaf> leaves = tree.leaves();
    std::vector<GrowingLeaf> split;
    for (int i = 0; i < changes; ++i) {
        const DepthKey key = leaves[random() % leaves.size()].key;
        const auto begin = Clock::now();
        tree.split(key, allChildren);
        times.splitNs.push_back(nanoseconds(begin, Clock::now()));
        split = tree.change().removed;
        times.bricksOfSplit.push_back(double(split.size()));
        std::stable_sort(split.begin(), split.end(), [](const GrowingLeaf& a, const GrowingLeaf& b) {
            return a.key.depth > b.key.depth;
        });
        for (const GrowingLeaf& leaf : split) {
            const auto start = Clock::now();
            const bool merged = tree.merge(leaf.key);
            times.mergeNs.push_back(nanoseconds(start, Clock::now()));
            if (!merged) throw std::runtime_error("a brick that was just split can't be merged");
        }
    }
}

double quantileOf(std::vector<double> values, double share) {
    const auto at = values.begin() + std::ptrdiff_t(share * double(values.size() - 1));
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

double clockNs() {
    std::vector<double> values;
    for (int i = 0; i < 10000; ++i) {
        const auto begin = Clock::now();
        values.push_back(nanoseconds(begin, Clock::now()));
    }
    return quantileOf(values, 0.5);
}

double sumOf(const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0);
}

/// Prints one row and returns it for the CSV.
std::string report(const GrowingTree& tree, const Times& times, double clock) {
    const double changes = double(times.splitNs.size());
    const double bricks = sumOf(times.bricksOfSplit);
    const double brickNs = (sumOf(times.splitNs) - changes * clock) / bricks;
    const double split = quantileOf(times.splitNs, 0.5) - clock,
                 split99 = quantileOf(times.splitNs, 0.99) - clock;
    std::vector<double> alone;  // calls that split nothing but the brick asked for
    for (std::size_t i = 0; i < times.splitNs.size(); ++i)
        if (times.bricksOfSplit[i] == 1) alone.push_back(times.splitNs[i]);
    const double aloneNs = alone.empty() ? 0 : quantileOf(alone, 0.5) - clock;
    const double merge = quantileOf(times.mergeNs, 0.5) - clock,
                 merge99 = quantileOf(times.mergeNs, 0.99) - clock;
    const int depth = tree.deepest().halvings();
    fmt::print("{:>9} {:>6} {:>9.0f} {:>9.0f} {:>9.2f} {:>9.0f} {:>9.0f} {:>9.0f} {:>9.0f}\n",
               tree.leafCount(), depth, split, split99, bricks / changes, brickNs, aloneNs, merge, merge99);
    return fmt::format("{},{},{:.0f},{:.0f},{:.2f},{:.0f},{:.0f},{:.0f},{:.0f}\n", tree.leafCount(), depth,
                       split, split99, bricks / changes, brickNs, aloneNs, merge, merge99);
}

void run(int changes, int rounds, const std::string& csvPath) {
    const double clock = clockNs();
    fmt::print(
        "nanoseconds; {} splits of random leaves a size; the {:.0f} ns of reading the clock are subtracted\n"
        "{:>9} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n",
        changes * rounds, clock, "bricks", "depth", "split", "99 %", "of bricks", "a brick", "of one",
        "merge", "99 %");
    std::string rows =
        "bricks,deepest,split_median_ns,split_99_ns,bricks_a_split,split_a_brick_ns,split_of_one_median_ns,"
        "merge_median_ns,merge_99_ns\n";
    for (const std::size_t bricks : {1000, 10000, 100000, 1000000}) {
        GrowingTree tree = treeAroundSphere(bricks);
        std::mt19937 random(1);
        Times times, warmUp;
        timeChanges(tree, changes / 4, random, warmUp);
        for (int r = 0; r < rounds; ++r) timeChanges(tree, changes, random, times);
        rows += report(tree, times, clock);
    }
    tessera::bench::writeText(csvPath, rows);
}

}  // namespace

int main(int count, char** words) {
    int changes = 20000, rounds = 3;
    std::string csvPath;
    tessera::bench::Arguments arguments("Times splits and merges in growing trees of bricks.");
    arguments.add("--changes", changes, "splits a round", {100, 10000000});
    arguments.add("--rounds", rounds, "rounds a size", {1, 1000});
    arguments.add("--csv", csvPath, "also write the figures here");
    return arguments.run(count, words, [&] {
        run(changes, rounds, csvPath);
        return 0;
    });
}
