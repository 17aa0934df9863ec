#include "brick/brick_tree.h"
#include "tessera/lattice.h"

#include <gtest/gtest.h>

#include "tessera/error.h"

namespace tessera {
namespace {

// Level 1: bricks (0,0,0) and (1,0,0); the second is refined into all of its eight children but one.
BrickTree twoLevels() {
    std::vector<BrickKey> leaves{{1, {0, 0, 0}}};
    for (int c = 0; c < 7; ++c) leaves.push_back({0, {2 + (c & 1), (c >> 1) & 1, c >> 2}});
    return BrickTree({1, 2, 3}, 0.25, 8, leaves);
}

TEST(BrickTree, LeavesAreOrderedByLevelThenZThenYThenX) {
    const BrickTree tree({0, 0, 0}, 1, 8,
                         {{1, {0, 0, 0}}, {0, {2, 1, 0}}, {0, {3, 0, 0}}, {0, {2, 0, 1}}, {0, {2, 0, 0}}});
    const std::vector<BrickKey> expected{
        {0, {2, 0, 0}}, {0, {3, 0, 0}}, {0, {2, 1, 0}}, {0, {2, 0, 1}}, {1, {0, 0, 0}}};
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), tree.leaves().begin(), tree.leaves().end()));
}

TEST(BrickTree, LatticesOfAllLevelsShareTheOriginAndDoubleTheSpacing) {
    const BrickTree tree = twoLevels();
    EXPECT_EQ(tree.levelCount(), 2);
    for (int level = 0; level < 2; ++level) {
        EXPECT_EQ(tree.lattice(level).originWorld, Vec3d(1, 2, 3));
        EXPECT_EQ(tree.lattice(level).uWorld.x, 0.25 * (1 << level));
    }
    EXPECT_EQ(tree.ownedPoints({0, {2, -1, 0}}), (IndexBox{{16, -8, 0}, {24, 0, 8}}));
    EXPECT_EQ(tree.closedPoints({0, {2, -1, 0}}), (IndexBox{{16, -8, 0}, {25, 1, 9}}));
}

TEST(BrickTree, FindsLeavesByKeyByDescendantAndByPlace) {
    const BrickTree tree = twoLevels();
    for (std::size_t i = 0; i < tree.leafCount(); ++i)
        EXPECT_EQ(tree.findLeaf(tree.leaves()[i]), std::int64_t(i));
    const std::int64_t coarse = tree.findLeaf({1, {0, 0, 0}});
    EXPECT_EQ(tree.findLeaf({0, {1, 1, 1}}), -1);
    EXPECT_EQ(tree.findCovering({0, {1, 1, 1}}), coarse);
    EXPECT_EQ(tree.findCovering({1, {1, 0, 0}}), -1);
    EXPECT_TRUE(tree.isRefined({1, {1, 0, 0}}));
    EXPECT_FALSE(tree.isRefined({1, {0, 0, 0}}));
    EXPECT_FALSE(tree.isRefined({0, {3, 1, 1}}));
    EXPECT_TRUE(tree.isRefined({2, {0, 0, 0}}));
    EXPECT_FALSE(tree.isRefined({2, {1, 0, 0}}));
    EXPECT_EQ(tree.findLeafAt({15.999, 0, 0}), coarse);
    EXPECT_EQ(tree.findLeafAt({16, 0, 0}), tree.findLeaf({0, {2, 0, 0}}));
    EXPECT_EQ(tree.findLeafAt({31, 15, 15}), -1) << "the missing child";
    EXPECT_EQ(tree.findLeafAt({-0.001, 0, 0}), -1);
    EXPECT_EQ(tree.findLeafAt({1e300, 0, 0}), -1);
    EXPECT_EQ(tree.findLeafAt(1, Vec3i(12, 0, 0)), tree.findLeaf({0, {3, 0, 0}}));
}

TEST(BrickTree, NegativeIndicesNestLikePositiveOnes) {
    const BrickTree tree({0, 0, 0}, 1, 8, {{1, {-1, -1, -1}}, {0, {-1, 0, 0}}});
    EXPECT_EQ(tree.findCovering({0, {-1, -1, -2}}), tree.findLeaf({1, {-1, -1, -1}}));
    EXPECT_EQ(tree.findLeafAt({-0.5, 0.5, 0.5}), tree.findLeaf({0, {-1, 0, 0}}));
    EXPECT_EQ(tree.findLeafAt({-16, -16, -16}), tree.findLeaf({1, {-1, -1, -1}}));
    EXPECT_EQ(tree.findLeafAt({-16.01, -16, -16}), -1);
}

TEST(BrickTree, FarScatteredBricksNeedNoDenseGrid) {
    std::vector<BrickKey> leaves;
    for (int i = 0; i < 100; ++i) leaves.push_back({0, {i * 100000, -i * 100000, i * 31}});
    const BrickTree tree({0, 0, 0}, 1, 16, leaves);
    for (const BrickKey& key : leaves) EXPECT_GE(tree.findLeaf(key), 0);
    EXPECT_EQ(tree.findLeaf({0, {1, 0, 0}}), -1);
}

TEST(BrickTree, RejectsOverlappingLeaves) {
    EXPECT_THROW(BrickTree({0, 0, 0}, 1, 8, {{0, {1, 1, 1}}, {1, {0, 0, 0}}}), InternalError);
    EXPECT_THROW(BrickTree({0, 0, 0}, 1, 8, {{0, {1, 1, 1}}, {0, {1, 1, 1}}}), InternalError);
}

TEST(BrickTree, AnEmptyTreeAnswersEverything) {
    const BrickTree tree;
    EXPECT_EQ(tree.levelCount(), 0);
    EXPECT_EQ(tree.findLeaf({0, {0, 0, 0}}), -1);
    EXPECT_EQ(tree.findLeafAt({0, 0, 0}), -1);
    EXPECT_FALSE(tree.isRefined({0, {0, 0, 0}}));
}

}  // namespace
}  // namespace tessera
