#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <bit>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>

#include "base/floor_div.h"
#include "refine/brick_result.h"
#include "tessera/lattice.h"
#include "vdb/openvdb_grids.h"
#include "vdb/vdb_file.h"

namespace tessera {

namespace fs = std::filesystem;

inline constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

// A directory of its own for each test, removed afterwards.
class VdbFileTest : public testing::Test {
  protected:
    void SetUp() override {
        std::string pattern = (fs::temp_directory_path() / "tessera_vdb_XXXXXX").string();
        ASSERT_NE(mkdtemp(pattern.data()), nullptr);
        directory_ = pattern;
    }
    void TearDown() override { fs::remove_all(directory_); }
    std::string file(const std::string& name) const { return (directory_ / name).string(); }
    std::size_t fileCount() const {
        return std::size_t(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()));
    }
    fs::path directory_;
};

// Lets no file grow beyond some bytes while it lives; a write past that fails as on a full disk.
class FileSizeLimit {
  public:
    explicit FileSizeLimit(rlim_t bytes) {
        previousHandler_ = std::signal(SIGXFSZ, SIG_IGN);
        getrlimit(RLIMIT_FSIZE, &previous_);
        const rlimit limit{bytes, previous_.rlim_max};
        setrlimit(RLIMIT_FSIZE, &limit);
    }
    ~FileSizeLimit() {
        setrlimit(RLIMIT_FSIZE, &previous_);
        std::signal(SIGXFSZ, previousHandler_);
    }

  private:
    rlimit previous_{};
    void (*previousHandler_)(int) = nullptr;
};

inline std::string readBytes(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

inline void writeBytes(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
}

// One brick of level 3 at negative indices, its neighbour refined step by step to level 0.
inline std::vector<BrickKey> nestedLeaves() {
    std::vector<BrickKey> leaves{{3, {-1, -1, -1}}};
    BrickKey refined{3, {0, -1, -1}};
    while (refined.level > 0) {
        for (int child = 0; child < 8; ++child) {
            const BrickKey key{refined.level - 1,
                               refined.index * 2 + Vec3i(child & 1, child >> 1 & 1, child >> 2)};
            if (child == 0 && key.level > 0) continue;
            leaves.push_back(key);
        }
        refined = {refined.level - 1, refined.index * 2};
    }
    return leaves;
}

inline std::uint32_t scramble(std::uint32_t x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

inline std::uint32_t pointKey(int level, const Vec3i& p, int channel) {
    return scramble(
        scramble(scramble(scramble(std::uint32_t(p.x)) + std::uint32_t(p.y)) + std::uint32_t(p.z)) +
        std::uint32_t(level * 16 + channel));
}

// Three of four points are covered; values of all magnitudes and signs.
inline bool coveredAt(int level, const Vec3i& p) {
    return pointKey(level, p, 15) % 4 != 0;
}
inline bool everywhere(int, const Vec3i&) {
    return true;
}
inline float valueAt(int level, const Vec3i& p, int channel) {
    const std::uint32_t key = pointKey(level, p, channel);
    return (key & 1 ? -1.0f : 1.0f) * std::ldexp(1.0f + float(key >> 9) * 0x1p-23f, int(key >> 1 & 31) - 16);
}

using ValueFunction = float (*)(int level, const Vec3i& p, int channel);
using CoverFunction = bool (*)(int level, const Vec3i& p);

inline BrickStore fillStore(const BrickTree& tree, int channels, ValueFunction value, CoverFunction covered) {
    BrickStore store(tree.brickCells(), tree.leafCount(), channels);
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        const BrickKey& key = tree.leaves()[leaf];
        Block block;
        block.lattice = tree.lattice(key.level);
        block.box = tree.ownedPoints(key);
        block.channels = channels;
        block.values.resize(std::size_t(channels) * block.count());
        block.coverage.resize(block.count());
        for (int z = block.box.min.z; z < block.box.max.z; ++z)
            for (int y = block.box.min.y; y < block.box.max.y; ++y)
                for (int x = block.box.min.x; x < block.box.max.x; ++x) {
                    const Vec3i p(x, y, z);
                    if (!covered(key.level, p)) continue;
                    block.coverage[block.offset(p)] = 1;
                    for (int c = 0; c < channels; ++c)
                        block.values[std::size_t(c) * block.count() + block.offset(p)] =
                            value(key.level, p, c);
                }
        store.put(leaf, key, block);
    }
    return store;
}

inline BrickResult makeResult(const Vec3d& origin, double spacing, int brickCells,
                              std::vector<BrickKey> leaves, int channels, ValueFunction value = valueAt,
                              CoverFunction covered = coveredAt) {
    BrickResult result;
    result.tree = BrickTree(origin, spacing, brickCells, std::move(leaves));
    result.store = fillStore(result.tree, channels, value, covered);
    return result;
}

/// Values first, first + 1, ... of the channels at a point outside the mesh.
inline void addExtension(BrickStore& store, int level, const Vec3i& p, float first) {
    Tile& tile = store.extension()[{level, floorDiv(p, kTileSize)}];
    if (!tile.values) tile.values = std::make_unique<float[]>(std::size_t(store.channels()) * kTilePoints);
    tile.cover(offsetInTile(p));
    for (int c = 0; c < store.channels(); ++c)
        tile.values[std::size_t(c * kTilePoints + offsetInTile(p))] = first + float(c);
}

/// Bricks of one level about the origin, as flattening leaves them, with two points of an extension.
inline constexpr double kFlatSpacing = 0.125;
inline BrickResult flatResult(int channels, ValueFunction value = valueAt,
                              CoverFunction covered = coveredAt) {
    std::vector<BrickKey> leaves;
    for (int i = 0; i < 8; ++i) leaves.push_back({0, Vec3i(i & 1, i >> 1 & 1, i >> 2) - 1});
    leaves.pop_back();
    BrickResult result = makeResult({0, 0, 0}, kFlatSpacing, 16, leaves, channels, value, covered);
    result.bricks = result.tree;
    addExtension(result.store, 0, {3, 5, 17}, 100);
    addExtension(result.store, 0, {8, 9, 10}, 200);
    return result;
}
inline VdbWriteOptions flatOptions(int layers = 1) {
    VdbWriteOptions options;
    options.layout = VdbLayout::flat;
    options.layers = layers;
    return options;
}

inline const std::vector<OutputField> kScalar{{"f", "f", "point", 1, 0}};
// A scalar, a vector and a tensor: ten channels.
inline const std::vector<OutputField> kMixed{
    {"T", "Temp", "point", 1, 0}, {"U", "velocity", "point", 3, 1}, {"S", "stress", "cell", 6, 4}};

// Bitwise, but any NaN equals any other.
inline bool sameFloat(float a, float b) {
    return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b) ||
           (std::isnan(a) && std::isnan(b));
}

inline void expectSameTree(const BrickTree& a, const BrickTree& b) {
    EXPECT_EQ(a.originWorld(), b.originWorld());
    EXPECT_EQ(a.spacingWorld(0), b.spacingWorld(0));
    EXPECT_EQ(a.brickCells(), b.brickCells());
    ASSERT_EQ(a.leafCount(), b.leafCount());
    for (std::size_t i = 0; i < a.leafCount(); ++i) EXPECT_EQ(a.leaves()[i], b.leaves()[i]) << i;
}

/// Compares every stored point with what `value` and `covered` say of it.
inline void expectStored(const VdbFile& read, int channels, ValueFunction value, CoverFunction covered) {
    ASSERT_EQ(read.store.channels(), channels);
    std::int64_t wrong = 0, points = 0;
    for (std::size_t leaf = 0; leaf < read.tree.leafCount(); ++leaf) {
        const BrickKey& key = read.tree.leaves()[leaf];
        const IndexBox box = read.tree.ownedPoints(key);
        for (int x = box.min.x; x < box.max.x; ++x)
            for (int y = box.min.y; y < box.max.y; ++y)
                for (int z = box.min.z; z < box.max.z; ++z)
                    for (int c = 0; c < channels; ++c) {
                        const Vec3i p(x, y, z);
                        bool isCovered = false;
                        const float stored = read.store.value(leaf, p - box.min, c, isCovered);
                        const bool expected = covered(key.level, p);
                        ++points;
                        wrong +=
                            isCovered != expected || (expected && !sameFloat(stored, value(key.level, p, c)));
                    }
    }
    EXPECT_GT(points, 0);
    EXPECT_EQ(wrong, 0) << "of " << points;
}

inline openvdb::GridPtrVec readGrids(const std::string& path) {
    openvdb::initialize();
    openvdb::io::File source(path);
    source.open(false);
    return *source.getGrids();
}

template <class Grid>
typename Grid::Ptr findGrid(const std::string& path, const std::string& name) {
    for (const openvdb::GridBase::Ptr& grid : readGrids(path)) {
        if (grid->getName() == name) return openvdb::gridPtrCast<Grid>(grid);
    }
    return nullptr;
}

}  // namespace tessera
