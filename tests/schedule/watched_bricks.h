#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <map>
#include <vector>

#include "refine/brick_plan.h"
#include "schedule/brick_target.h"
#include "tessera/resampler.h"

namespace tessera {

/// A target that keeps what it is shown, and checks at each publication that the state is whole: its leaves
/// cover what the ones before covered, touching ones differ by one depth at most, and samples are those that
/// sampling the brick alone gives, bit for bit.
class WatchedBricks : public BrickTarget {
  public:
    /// @param bound best one that passes over the whole mesh, to be independent of what is tested.
    WatchedBricks(BoundResampler& bound, const PlanFrame& frame) : bound_(bound), frame_(frame) {}

    void publish(const Publication& publication) override {
        ++publications;
        for (const GrowingLeaf& leaf : publication.removed) {
            const auto found = leaves.find(leaf.slot);
            ASSERT_TRUE(found != leaves.end() && found->second.leaf == leaf);
            leaves.erase(found);
        }
        for (const ShownBrick& brick : publication.added) {
            ASSERT_TRUE(leaves.emplace(brick.leaf.slot, brick).second);
            expectFresh(brick);
        }
        for (const GrowingLeaf& leaf : publication.findBordering())
            ASSERT_TRUE(leaves.contains(leaf.slot) && leaves[leaf.slot].leaf == leaf);
        // Of a brick and its children one side is removed, the other one added.
        const auto areBelow = [](const auto& keys, const DepthKey& key) {
            for (const DepthKey& below : keys)
                if (below.depth <= key.depth || ancestorKey(below, key.depth) != key) return false;
            return true;
        };
        std::vector<DepthKey> removed, added;
        for (const GrowingLeaf& leaf : publication.removed) removed.push_back(leaf.key);
        for (const ShownBrick& brick : publication.added) added.push_back(brick.leaf.key);
        EXPECT_TRUE(removed.empty() || (removed.size() == 1 && areBelow(added, removed[0])) ||
                    (added.size() == 1 && areBelow(removed, added[0])));
        if (afterEach) afterEach();
    }

    std::map<std::uint32_t, ShownBrick> leaves;  ///< by slot
    int publications = 0;
    std::function<void()> afterEach;

  private:
    void expectFresh(const ShownBrick& brick) {
        const DepthKey& key = brick.leaf.key;
        ASSERT_TRUE(brick.samples);
        const Lattice lattice = Lattice::axisParallel(frame_.originWorld, frame_.spacingWorld(key.depth));
        const int cells = frame_.brickCells;
        const IndexBox box{key.index * cells, (key.index + 1) * cells + 1};
        ASSERT_EQ(brick.samples->box, box);
        bound_.resample(lattice, std::span(&box, 1),
                        [&](std::size_t, const Block& fresh) {
                            EXPECT_EQ(fresh.lattice, brick.samples->lattice);
                            EXPECT_EQ(fresh.coverage, brick.samples->coverage);
                            ASSERT_EQ(fresh.values.size(), brick.samples->values.size());
                            EXPECT_EQ(std::memcmp(fresh.values.data(), brick.samples->values.data(),
                                                  fresh.values.size() * sizeof(float)),
                                      0);
                        },
                        {.threads = 1});
    }

    BoundResampler& bound_;
    PlanFrame frame_;
};

}  // namespace tessera
