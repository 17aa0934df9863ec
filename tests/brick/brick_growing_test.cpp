#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>
#include <stdexcept>
#include <tuple>
#include <type_traits>
#include <vector>

#include "brick/growing_tree.h"
#include "tessera/error.h"

namespace tessera {
namespace {

static_assert(!std::is_convertible_v<int, Depth> && !std::is_convertible_v<Depth, int>);
static_assert(!std::is_constructible_v<BrickKey, DepthKey>);

constexpr int kFinest = 6;  // no test goes deeper

struct StorageOrder {
    bool operator()(const DepthKey& a, const DepthKey& b) const {
        return std::tuple(a.depth, a.index.z, a.index.y, a.index.x) <
               std::tuple(b.depth, b.index.z, b.index.y, b.index.x);
    }
};
using Keys = std::set<DepthKey, StorageOrder>;

DepthKey at(int depth, int x, int y, int z) {
    return {Depth(depth), {x, y, z}};
}

// What the tree must do, by brute force: every brick's box is compared with every other's.
struct Model {
    Keys leaves, split;

    // Box in units of the finest depth.
    static std::array<int, 6> box(const DepthKey& key) {
        const int size = 1 << (kFinest - key.depth.halvings());
        const Vec3i& i = key.index;
        return {i.x * size, i.y * size, i.z * size, (i.x + 1) * size, (i.y + 1) * size, (i.z + 1) * size};
    }
    static bool touch(const DepthKey& a, const DepthKey& b) {
        const auto p = box(a), q = box(b);
        return p[0] <= q[3] && q[0] <= p[3] && p[1] <= q[4] && q[1] <= p[4] && p[2] <= q[5] && q[2] <= p[5];
    }
    static bool contains(const DepthKey& outer, const DepthKey& inner) {
        const auto p = box(outer), q = box(inner);
        return p[0] <= q[0] && p[1] <= q[1] && p[2] <= q[2] && p[3] >= q[3] && p[4] >= q[4] && p[5] >= q[5];
    }
    static bool balanced(const DepthKey& a, const DepthKey& b) {
        return std::abs(a.depth - b.depth) <= 1 || !touch(a, b);
    }

    bool balanced() const {
        for (auto a = leaves.begin(); a != leaves.end(); ++a)
            for (auto b = std::next(a); b != leaves.end(); ++b)
                if (!balanced(*a, *b)) return false;
        return true;
    }

    // Splits until nothing is unbalanced; returns the bricks that were split.
    template <class Choose>
    Keys splitAndBalance(const Keys& keys, const Choose& choose) {
        Keys done, pending = keys;
        while (!pending.empty()) {
            const DepthKey key = *pending.begin();
            pending.erase(pending.begin());
            leaves.erase(key);
            split.insert(key);
            done.insert(key);
            for (int c = 0; c < 8; ++c) {
                if (!((choose(key) >> c) & 1)) continue;
                const Vec3i& i = key.index;
                const DepthKey child{key.depth + 1, {2 * i.x + c % 2, 2 * i.y + c / 2 % 2, 2 * i.z + c / 4}};
                leaves.insert(child);
                for (const DepthKey& other : leaves)
                    if (other.depth < child.depth && !balanced(child, other)) pending.insert(other);
            }
        }
        return done;
    }

    Keys inside(const DepthKey& key) const {
        Keys result;
        for (const DepthKey& leaf : leaves)
            if (contains(key, leaf)) result.insert(leaf);
        return result;
    }
    bool canMerge(const DepthKey& parent) const {
        if (!split.contains(parent)) return false;
        for (const DepthKey& leaf : leaves)
            if (contains(parent, leaf) ? leaf.depth != parent.depth + 1 : !balanced(parent, leaf))
                return false;
        return true;
    }
    void merge(const DepthKey& parent) {
        std::erase_if(leaves, [&](const DepthKey& key) { return contains(parent, key); });
        std::erase_if(split, [&](const DepthKey& key) { return contains(parent, key); });
        leaves.insert(parent);
    }
};

// Most bricks have all children, some lack a few, and a few have none.
ChildBits someChildren(const DepthKey& key) {
    const unsigned draw = unsigned(IndexHash()(key.index + 1000 * key.depth.halvings()));
    if (draw % 64 == 0) return 0;
    return draw % 4 == 0 ? ChildBits(draw >> 8) : kAllChildren;
}

template <class Choose>
GrowingTree::ChooseChildren forEach(const Choose& choose) {
    return [choose](std::span<const GrowingLeaf> bricks, std::span<ChildBits> children) {
        for (std::size_t i = 0; i < bricks.size(); ++i) children[i] = choose(bricks[i].key);
    };
}
ChildBits allChildren(const DepthKey&) {
    return kAllChildren;
}

Keys keysOf(const std::vector<GrowingLeaf>& leaves) {
    Keys keys;
    for (const GrowingLeaf& leaf : leaves) EXPECT_TRUE(keys.insert(leaf.key).second);
    return keys;
}

std::vector<Vec3i> rootBox(const Vec3i& min, const Vec3i& size) {
    std::vector<Vec3i> roots;
    for (int z = 0; z < size.z; ++z)
        for (int y = 0; y < size.y; ++y)
            for (int x = 0; x < size.x; ++x) roots.push_back(min + Vec3i(x, y, z));
    return roots;
}

// A tree, the model, and keys kept beside the tree by slot.
class Pair {
  public:
    explicit Pair(const std::vector<Vec3i>& roots) : tree_(roots) {
        for (const GrowingLeaf& leaf : tree_.leaves()) {
            model_.leaves.insert(leaf.key);
            if (leaf.slot >= beside_.size()) beside_.resize(leaf.slot + 1);
            beside_[leaf.slot] = leaf.key;
        }
        mostLeaves_ = tree_.leafCount();
    }

    void split(const DepthKey& key) {
        const Keys split = model_.splitAndBalance({key}, someChildren);
        tree_.split(key, forEach(someChildren));
        EXPECT_EQ(keysOf(tree_.change().removed), split);
        followChange();
    }

    bool merge(const DepthKey& parent) {
        const bool can = model_.canMerge(parent);
        EXPECT_EQ(tree_.canMerge(parent), can);
        const Keys children = model_.inside(parent);
        EXPECT_EQ(tree_.merge(parent), can);
        if (can) {
            model_.merge(parent);
            EXPECT_EQ(keysOf(tree_.change().removed), children);
            EXPECT_EQ(keysOf(tree_.change().added), Keys{parent});
        } else {
            EXPECT_TRUE(tree_.change().removed.empty() && tree_.change().added.empty());
        }
        followChange();
        return can;
    }

    // Everything at once, and lookups against a BrickTree built from the model's leaves.
    void compareAll(std::mt19937& random) const {
        ASSERT_TRUE(model_.balanced());
        const std::vector<GrowingLeaf> leaves = tree_.leaves();
        ASSERT_EQ(leaves.size(), tree_.leafCount());
        ASSERT_TRUE(std::equal(
            leaves.begin(), leaves.end(), model_.leaves.begin(), model_.leaves.end(),
            [](const GrowingLeaf& leaf, const DepthKey& expected) { return leaf.key == expected; }));
        std::set<std::uint32_t> slots;
        for (const GrowingLeaf& leaf : leaves) {
            ASSERT_TRUE(slots.insert(leaf.slot).second);
            ASSERT_EQ(beside_[leaf.slot], leaf.key) << "the slot is the leaf's as long as it stands";
        }
        EXPECT_LT(*slots.rbegin(), tree_.slotCount());
        EXPECT_LE(tree_.slotCount(), mostLeaves_ + largestChange_) << "slots are used again";

        const Depth finest(kFinest);
        EXPECT_EQ(tree_.deepest(), model_.leaves.rbegin()->depth);
        std::vector<BrickKey> keys;
        for (const DepthKey& key : model_.leaves) keys.push_back({kFinest - key.depth.halvings(), key.index});
        const BrickTree anew({1, 2, 3}, 0.5, 8, keys);
        const BrickTree made = tree_.brickTree({1, 2, 3}, 32, 8, finest);
        EXPECT_EQ(made.spacingWorld(), 0.5);
        EXPECT_TRUE(std::equal(made.leaves().begin(), made.leaves().end(), anew.leaves().begin(),
                               anew.leaves().end()));
        for (int i = 0; i < 300; ++i) compareAt(randomKey(random), anew);
    }

    DepthKey randomLeaf(std::mt19937& random) const {
        auto leaf = model_.leaves.begin();
        std::advance(leaf, random() % model_.leaves.size());
        return *leaf;
    }
    DepthKey randomSplit(std::mt19937& random) const {
        auto key = model_.split.begin();
        std::advance(key, random() % model_.split.size());
        return *key;
    }
    bool anySplit() const { return !model_.split.empty(); }
    std::size_t leafCount() const { return tree_.leafCount(); }

  private:
    DepthKey randomKey(std::mt19937& random) const {
        const int depth = int(random() % (kFinest + 1));
        const auto draw = [&] { return int(random() % (6u << depth)) - (2 << depth); };
        const int x = draw(), y = draw(), z = draw();
        return at(depth, x, y, z);
    }

    void compareAt(const DepthKey& key, const BrickTree& anew) const {
        const BrickKey same{kFinest - key.depth.halvings(), key.index};
        const auto leaf = tree_.findLeaf(key), covering = tree_.findCovering(key);
        ASSERT_EQ(leaf.has_value(), anew.findLeaf(same) >= 0);
        if (leaf) {
            ASSERT_EQ(leaf->key, key);
        }
        const std::int64_t expected = anew.findCovering(same);
        ASSERT_EQ(covering.has_value(), expected >= 0);
        if (covering) {
            const BrickKey& found = anew.leaves()[std::size_t(expected)];
            ASSERT_EQ(kFinest - covering->key.depth.halvings(), found.level);
            ASSERT_EQ(covering->key.index, found.index);
            ASSERT_EQ(beside_[covering->slot], covering->key);
        }
        ASSERT_EQ(tree_.isSplit(key), model_.split.contains(key));
        std::vector<GrowingLeaf> neighbours;
        tree_.findNeighbours(key, neighbours);
        Keys touching;
        for (const DepthKey& other : model_.leaves)
            if (Model::touch(key, other) && !Model::contains(key, other) && !Model::contains(other, key))
                touching.insert(other);
        ASSERT_EQ(keysOf(neighbours), touching);
    }

    void followChange() {
        const TreeChange& change = tree_.change();
        beside_.resize(tree_.slotCount());
        for (const GrowingLeaf& leaf : change.removed) EXPECT_EQ(beside_[leaf.slot], leaf.key);
        for (const GrowingLeaf& leaf : change.added) {
            beside_[leaf.slot] = leaf.key;
            EXPECT_EQ(tree_.findLeaf(leaf.key), leaf);
        }
        for (const GrowingLeaf& leaf : change.removed) EXPECT_EQ(beside_[leaf.slot], leaf.key);
        EXPECT_EQ(tree_.leafCount(), model_.leaves.size());
        mostLeaves_ = std::max(mostLeaves_, tree_.leafCount());
        largestChange_ = std::max(largestChange_, change.added.size());
    }

    GrowingTree tree_;
    Model model_;
    std::vector<DepthKey> beside_;
    std::size_t mostLeaves_ = 0, largestChange_ = 0;
};

TEST(GrowingTree, RandomSplitsAndMergesGiveTheTreeThatBruteForceGives) {
    std::mt19937 random(1);
    Pair pair(rootBox({-1, 0, -1}, {3, 2, 2}));
    int splits = 0, merges = 0, refused = 0;
    bool growing = true;
    while (splits + merges < 10000) {
        if (pair.leafCount() < 100) growing = true;
        if (pair.leafCount() > 600) growing = false;
        const DepthKey leaf = pair.randomLeaf(random);
        const bool all = (splits + merges + refused) % 200 == 0;
        if (growing && random() % 2 == 0) {
            if (leaf.depth == Depth(kFinest)) continue;
            pair.split(leaf);
            ++splits;
        } else if (pair.anySplit()) {
            const bool ofLeaf = leaf.depth > Depth(0) && random() % 4 > 0;
            const Vec3i& i = leaf.index;
            const DepthKey parent{leaf.depth - 1, {i.x >> 1, i.y >> 1, i.z >> 1}};
            ++(pair.merge(ofLeaf ? parent : pair.randomSplit(random)) ? merges : refused);
        }
        if (all) pair.compareAll(random);
        if (HasFailure()) FAIL() << "after " << splits + merges << " changes";
    }
    EXPECT_GT(splits, 1000);
    EXPECT_GT(refused, 1000);
}

TEST(GrowingTree, SplittingReachesOverEdgesAndCorners) {
    GrowingTree tree(rootBox({0, 0, 0}, {2, 2, 2}));
    tree.split(at(0, 0, 0, 0), forEach(allChildren));
    EXPECT_EQ(tree.change().removed.size(), 1u);
    tree.split(at(1, 1, 1, 1), forEach(allChildren));  // in the middle of the eight roots
    EXPECT_EQ(tree.change().removed.size(), 8u) << "all other roots: three by a face, three by an edge, one "
                                                   "by a corner";
    EXPECT_EQ(tree.leafCount(), 7u + 8u + 7u * 8u);
    EXPECT_FALSE(tree.canMerge(at(0, 1, 1, 1))) << "it would touch leaves of depth 2 at its corner";
    EXPECT_TRUE(tree.merge(at(1, 1, 1, 1)));
    EXPECT_TRUE(tree.merge(at(0, 1, 1, 1)));
}

TEST(GrowingTree, MissingChildrenAskForNoBalance) {
    GrowingTree tree(rootBox({0, 0, 0}, {2, 1, 1}));
    // Only children away from the other root.
    const auto lower = [](const DepthKey&) { return ChildBits(0x55); };
    tree.split(at(0, 0, 0, 0), forEach(lower));
    tree.split(at(1, 0, 0, 0), forEach(lower));
    tree.split(at(2, 0, 0, 0), forEach(lower));
    EXPECT_FALSE(tree.isSplit(at(0, 1, 0, 0)));
    EXPECT_EQ(tree.findCovering(at(3, 7, 0, 0)), std::nullopt);
    // A merged brick is where its missing children were: it touches the other root.
    tree.merge(at(2, 0, 0, 0));
    EXPECT_FALSE(tree.canMerge(at(0, 0, 0, 0)));
    EXPECT_TRUE(tree.merge(at(1, 0, 0, 0)));
    tree.split(at(0, 1, 0, 0), forEach(allChildren));
    tree.split(at(1, 2, 0, 0), forEach(allChildren));
    EXPECT_FALSE(tree.canMerge(at(0, 0, 0, 0))) << "leaves of depth 2 lie beside it";
    EXPECT_TRUE(tree.merge(at(1, 2, 0, 0)));
    EXPECT_TRUE(tree.merge(at(0, 0, 0, 0)));
}

TEST(GrowingTree, ABrickWithoutChildrenVanishesAndCanComeBack) {
    GrowingTree tree(rootBox({0, 0, 0}, {1, 1, 1}));
    tree.split(at(0, 0, 0, 0), forEach(allChildren));
    tree.split(at(1, 0, 0, 0), [](std::span<const GrowingLeaf>, std::span<ChildBits>) {});
    EXPECT_EQ(tree.leafCount(), 7u);
    EXPECT_EQ(tree.findCovering(at(1, 0, 0, 0)), std::nullopt);
    EXPECT_TRUE(tree.merge(at(1, 0, 0, 0)));
    EXPECT_EQ(tree.leafCount(), 8u);
    tree.split(at(1, 0, 0, 0), [](std::span<const GrowingLeaf>, std::span<ChildBits>) {});
    EXPECT_TRUE(tree.merge(at(0, 0, 0, 0))) << "nothing deeper stands in it";
    EXPECT_EQ(tree.leafCount(), 1u);
}

TEST(GrowingTree, ALimitThatWouldBePassedLeavesEverythingAsItWas) {
    GrowingTree tree(rootBox({0, 0, 0}, {3, 3, 3}));
    tree.split(at(0, 1, 1, 1), forEach(allChildren));
    const std::vector<DepthKey> keys{at(1, 2, 2, 2), at(1, 3, 3, 3), at(0, 2, 0, 0)};
    const std::vector<GrowingLeaf> before = tree.leaves();
    Model model{keysOf(before), {at(0, 1, 1, 1)}};
    const Keys split = model.splitAndBalance({keys.begin(), keys.end()}, allChildren);
    for (std::size_t limit = tree.leafCount(); limit < model.leaves.size(); ++limit) {
        ASSERT_FALSE(tree.split(keys, limit, forEach(allChildren)));
        ASSERT_EQ(tree.leaves(), before);
        ASSERT_TRUE(tree.change().removed.empty() && tree.change().added.empty());
        ASSERT_EQ(tree.deepest(), Depth(1));
        for (const DepthKey& key : keys) ASSERT_FALSE(tree.isSplit(key));
    }
    // So does one who can't say which children there are, at whichever turn.
    int turns = 0;
    const auto fails = [&](std::span<const GrowingLeaf>, std::span<ChildBits> children) {
        if (turns++ == 1) throw std::runtime_error("no answer");
        std::fill(children.begin(), children.end(), kAllChildren);
    };
    EXPECT_THROW(tree.split(keys, GrowingTree::kNoLimit, fails), std::runtime_error);
    EXPECT_EQ(turns, 2);
    EXPECT_EQ(tree.leaves(), before);
    EXPECT_LE(tree.slotCount(), model.leaves.size() + split.size());
    EXPECT_TRUE(tree.split(keys, model.leaves.size(), forEach(allChildren)));
    EXPECT_EQ(keysOf(tree.leaves()), model.leaves);
}

TEST(GrowingTree, OnlyLeavesAreSplitAndNoneTwice) {
    GrowingTree tree(rootBox({0, 0, 0}, {2, 1, 1}));
    const std::vector<GrowingLeaf> before = tree.leaves();
    const std::vector<DepthKey> twice{at(0, 0, 0, 0), at(0, 0, 0, 0)};
    EXPECT_THROW(tree.split(twice, GrowingTree::kNoLimit, forEach(allChildren)), InternalError);
    EXPECT_THROW(tree.split(at(1, 0, 0, 0), forEach(allChildren)), InternalError);
    EXPECT_THROW(tree.split(at(0, 2, 0, 0), forEach(allChildren)), InternalError);
    EXPECT_EQ(tree.leaves(), before);
    EXPECT_FALSE(tree.merge(at(0, 0, 0, 0)));
    EXPECT_FALSE(tree.merge(at(0, 5, 0, 0)));
    EXPECT_THROW(GrowingTree(std::vector<Vec3i>{{1, 2, 3}, {1, 2, 3}}), InternalError);
}

TEST(GrowingTree, FarScatteredRootsNeedNoDenseGrid) {
    std::vector<Vec3i> roots;
    for (int i = 0; i < 100; ++i) roots.emplace_back(i * 100000, -i * 100000, i * 31);
    GrowingTree tree(roots);
    for (const Vec3i& root : roots) {
        tree.split({Depth(0), root}, forEach(allChildren));
        EXPECT_TRUE(tree.findLeaf({Depth(1), root * 2 + 1}));
    }
    EXPECT_EQ(tree.leafCount(), 800u);
    for (const Vec3i& root : roots) EXPECT_TRUE(tree.merge({Depth(0), root}));
}

TEST(GrowingTree, AnEmptyTreeAnswersEverything) {
    const GrowingTree tree;
    EXPECT_EQ(tree.deepest(), Depth(0));
    EXPECT_TRUE(tree.leaves().empty());
    EXPECT_EQ(tree.findCovering(at(3, 1, 2, 3)), std::nullopt);
    EXPECT_FALSE(tree.canMerge(at(0, 0, 0, 0)));
    EXPECT_EQ(tree.brickTree(Vec3d(0), 1, 8, Depth(0)).leafCount(), 0u);
}

}  // namespace
}  // namespace tessera
