#include "brick/brick_store.h"

#include <gtest/gtest.h>

#include <limits>

namespace tessera {
namespace {

bool isCovered(const Vec3i& p) {
    return (p.x * 7 + p.y * 5 + p.z * 3) % 4 != 0;
}
float valueAt(const Vec3i& p, int channel) {
    return float(p.x + 100 * p.y + 10000 * p.z) + 0.25f * float(channel);
}

// A block larger than the brick and not aligned with it. Values where nothing is covered are garbage, as they
// may be.
Block sampleBlock(const IndexBox& box, int channels, bool (*covered)(const Vec3i&)) {
    Block block;
    block.box = box;
    block.channels = channels;
    block.values.assign(block.count() * std::size_t(channels), std::numeric_limits<float>::quiet_NaN());
    block.coverage.assign(block.count(), 0);
    for (int k = box.min.z; k < box.max.z; ++k)
        for (int j = box.min.y; j < box.max.y; ++j)
            for (int i = box.min.x; i < box.max.x; ++i) {
                const Vec3i p(i, j, k);
                if (!covered(p)) continue;
                block.coverage[block.offset(p)] = 1;
                for (int c = 0; c < channels; ++c)
                    block.values[std::size_t(c) * block.count() + block.offset(p)] = valueAt(p, c);
            }
    return block;
}

TEST(BrickStore, ReturnsWhatWasPut) {
    for (const int b : {8, 16, 32}) {
        BrickStore store(b, 3, 2);
        const BrickKey key{1, {-1, 2, 0}};
        const IndexBox box{key.index * b - Vec3i(3, 1, 2), key.index * b + b + Vec3i(2, 5, 1)};
        store.put(1, key, sampleBlock(box, 2, isCovered));
        std::int64_t count = 0;
        for (int z = 0; z < b; ++z)
            for (int y = 0; y < b; ++y)
                for (int x = 0; x < b; ++x) {
                    const Vec3i local(x, y, z), p = key.index * b + local;
                    for (int c = 0; c < 2; ++c) {
                        bool covered = false;
                        const float value = store.value(1, local, c, covered);
                        ASSERT_EQ(covered, isCovered(p));
                        ASSERT_EQ(value, covered ? valueAt(p, c) : 0.0f);
                    }
                    count += isCovered(p);
                }
        EXPECT_EQ(store.coveredPoints(), count);
    }
}

TEST(BrickStore, TilesHaveTheOrderOfVdbLeafNodes) {
    BrickStore store(16, 1, 1);
    store.put(0, {0, {0, 0, 0}},
              sampleBlock({{0, 0, 0}, {16, 16, 16}}, 1, [](const Vec3i&) { return true; }));
    const Tile* tile = store.tile(0, (1 * 2 + 0) * 2 + 1);  // x in [8, 16), y in [0, 8), z in [8, 16)
    ASSERT_NE(tile, nullptr);
    for (int x = 0; x < 8; ++x)
        for (int y = 0; y < 8; ++y)
            for (int z = 0; z < 8; ++z)
                ASSERT_EQ(tile->channel(0)[(x * 8 + y) * 8 + z], valueAt({8 + x, y, 8 + z}, 0));
}

TEST(BrickStore, UncoveredValuesAreZeroAndEmptyTilesAbsent) {
    BrickStore store(16, 1, 1);
    store.put(0, {0, {0, 0, 0}},
              sampleBlock({{0, 0, 0}, {16, 16, 16}}, 1, [](const Vec3i& p) { return p.x == 3 && p.y == 9; }));
    int present = 0;
    for (int t = 0; t < store.tileCount(); ++t) {
        const Tile* tile = store.tile(0, t);
        if (!tile) continue;
        ++present;
        for (int i = 0; i < kTilePoints; ++i)
            if (!tile->covered(i)) {
                ASSERT_EQ(tile->channel(0)[i], 0.0f);
            }
    }
    EXPECT_EQ(present, 2) << "x in [0, 8), y in [8, 16), both halves of z";
    EXPECT_LT(store.memoryBytes(), 2 * 512 * 4 + 1000);
}

TEST(BrickStore, MovesLeavesAndFreesTiles) {
    BrickStore from(8, 2, 1), to(8, 5, 1);
    from.put(1, {0, {0, 0, 0}}, sampleBlock({{0, 0, 0}, {8, 8, 8}}, 1, isCovered));
    const std::int64_t count = from.coveredPoints();
    to.moveLeaf(4, from, 1);
    EXPECT_EQ(from.coveredPoints(), 0);
    EXPECT_EQ(to.coveredPoints(), count);
    to.release(4, 0);
    EXPECT_EQ(to.tile(4, 0), nullptr);
    to.ensureTile(4, 0).values[7] = 2;
    EXPECT_EQ(to.coveredPoints(), 0);
}

}  // namespace
}  // namespace tessera
