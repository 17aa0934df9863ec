#include "cache/brick_log.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "brick_test_meshes.h"
#include "files/file_digest.h"
#include "schedule/brick_scheduler.h"
#include "software/software_resampler.h"
#include "tessera/error.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

class CacheTest : public testing::Test {
  protected:
    CacheTest() : path_(fs::temp_directory_path() / ("tessera_log_" + std::to_string(::getpid()))) {
        fs::remove(path_);
    }
    ~CacheTest() override { fs::remove(path_); }

    static Block block(const DepthKey& key, unsigned seed) {
        std::mt19937 random(seed);
        Block made;
        made.box = {key.index * 8, key.index * 8 + 9};
        made.channels = 2;
        for (std::size_t i = 0; i < 2 * made.count(); ++i)
            made.values.push_back(std::uniform_real_distribution<float>(-5, 5)(random));
        made.values[3] = std::numeric_limits<float>::quiet_NaN();
        for (std::size_t i = 0; i < made.count(); ++i) made.coverage.push_back(random() % 2);
        return made;
    }
    static DepthKey key(int n) { return {Depth(n % 3), {n, -n, 7 * n}}; }
    static void expectBlock(const BrickLog& log, int n) {
        ASSERT_TRUE(log.contains(key(n)));
        const Block expected = block(key(n), unsigned(n));
        const auto read = log.read(key(n), expected.lattice, expected.box);
        EXPECT_EQ(read->channels, 2);
        EXPECT_EQ(read->coverage, expected.coverage);
        ASSERT_EQ(read->values.size(), expected.values.size());
        EXPECT_EQ(std::memcmp(read->values.data(), expected.values.data(), 4 * expected.values.size()), 0);
    }

    fs::path path_;
};

TEST_F(CacheTest, ALogGivesBackTheSameBits) {
    {
        BrickLog log(path_, "a", 8, 2);
        for (int n = 0; n < 20; ++n) log.append(key(n), block(key(n), unsigned(n)));
        for (int n = 0; n < 20; ++n) expectBlock(log, n);
        EXPECT_FALSE(log.contains(key(20)));
        // Nobody else writes meanwhile.
        EXPECT_THROW(BrickLog(path_, "a", 8, 2), IoError);
    }
    const BrickLog again(path_, "a", 8, 2);
    EXPECT_EQ(again.brickCount(), 20u);
    for (int n = 0; n < 20; ++n) expectBlock(again, n);
}

// Cut off anywhere, or with a byte changed: all bricks before that place are there, and the log goes on.
TEST_F(CacheTest, WhatADamagedLogStillHoldsIsThere) {
    {
        BrickLog log(path_, "a", 8, 2);
        for (int n = 0; n < 6; ++n) log.append(key(n), block(key(n), unsigned(n)));
    }
    std::ifstream file(path_, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(file)), {});
    std::mt19937 random(2);
    std::size_t least = 6, most = 0;
    for (int trial = 0; trial < 60; ++trial) {
        const std::size_t at = 30 + random() % (whole.size() - 30);
        std::string damaged = whole;
        if (trial % 2)
            damaged.resize(at);
        else
            damaged[at] = char(damaged[at] ^ 0x10);
        std::ofstream(path_, std::ios::binary) << damaged;
        BrickLog log(path_, "a", 8, 2);
        const std::size_t there = log.brickCount();
        for (std::size_t n = 0; n < there; ++n) expectBlock(log, int(n));
        for (int n = 0; n < 6; ++n) log.append(key(n), block(key(n), unsigned(n)));
        for (int n = 0; n < 6; ++n) expectBlock(log, n);
        least = std::min(least, there);
        most = std::max(most, there);
    }
    EXPECT_EQ(least, 0u);
    EXPECT_GE(most, 4u);
}

// A digest tells damage, not what is safe: with one that fits, a brick is refused or as large as any other.
TEST_F(CacheTest, WhatADigestVouchesForIsNotBelieved) {
    constexpr std::size_t kHeadBytes = 24, kDigestBytes = 36;
    { BrickLog(path_, "a", 8, 2).append(key(1), block(key(1), 1)); }
    std::ifstream file(path_, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(file)), {});
    const std::size_t record = whole.find('\n', whole.find('\n') + 1) + 1;
    const std::size_t packed = record + kHeadBytes, end = whole.size() - kDigestBytes;
    std::mt19937 random(5);
    int refused = 0;
    for (int trial = 0; trial < 500; ++trial) {
        std::string damaged = whole;
        for (unsigned n = 1 + random() % 4; n > 0; --n)
            damaged[packed + random() % (end - packed)] = char(random());
        FileDigest digest;
        digest.update(damaged.data() + record, end - record);
        damaged.replace(end, kDigestBytes, digest.uuid());
        std::ofstream(path_, std::ios::binary) << damaged;
        const BrickLog log(path_, "a", 8, 2);
        ASSERT_TRUE(log.contains(key(1)));
        try {
            const Block expected = block(key(1), 1);
            const auto read = log.read(key(1), expected.lattice, expected.box);
            EXPECT_EQ(read->values.size(), expected.values.size());
            EXPECT_LE(*std::max_element(read->coverage.begin(), read->coverage.end()), 1);
        } catch (const InputError&) {
            ++refused;
        }
    }
    EXPECT_GT(refused, 20);
}

TEST_F(CacheTest, ALogOfSomethingElseIsRefusedAndLeftAlone) {
    { BrickLog(path_, "a", 8, 2).append(key(1), block(key(1), 1)); }
    const auto size = fs::file_size(path_);
    EXPECT_THROW(BrickLog(path_, "b", 8, 2), InputError);
    EXPECT_THROW(BrickLog(path_, "aa", 8, 2), InputError);
    EXPECT_EQ(fs::file_size(path_), size);
    std::ofstream(path_) << "some text of somebody's, longer than a line";
    EXPECT_THROW(BrickLog(path_, "a", 8, 2), InputError);
    EXPECT_THROW(BrickLog("/no/such/folder/log", "a", 8, 2), IoError);
    EXPECT_THROW(BrickLog("/tmp", "a", 8, 2), IoError);
}

class Unseen : public BrickTarget {
  public:
    void publish(const Publication& publication) override {
        for (const ShownBrick& brick : publication.added) shown[brick.leaf.slot] = brick;
    }
    std::map<std::uint32_t, ShownBrick> shown;
};

TEST_F(CacheTest, ASchedulerReadsWhatItWouldSample) {
    TetMesh mesh = ballMesh(6, 1);
    addPointField(mesh, "wave", [](const Vec3d& p) { return std::sin(5 * p.x) + p.y * p.z; });
    const std::vector<int> fields{0};
    const SoftwareResampler resampler;
    ScheduleOptions options;
    options.refine.criterion = Criterion::focus | Criterion::error;
    options.refine.brickCells = 8;
    options.refine.resolution = 150;
    options.refine.maxError = 0.02;
    options.refine.focus = {pointFocus({0.3, 0.2, 0.1}, 0.1)};
    Unseen first, second;
    std::int64_t sampled = 0;
    for (Unseen* target : {&first, &second}) {
        options.archive = std::make_shared<BrickLog>(path_, "a", 8, 1);
        BrickScheduler scheduler(mesh, fields, resampler, options, *target);
        scheduler.finish({.threads = 2});
        if (target == &first) {
            sampled = scheduler.counts().sampled;
            // Without its memory it comes back by the log.
            scheduler.setFocus({pointFocus({-0.3, 0.2, 0.1}, 0.1)});
            scheduler.finish();
            scheduler.forget();
            const std::int64_t before = scheduler.counts().sampled;
            scheduler.setFocus(options.refine.focus);
            scheduler.finish();
            EXPECT_EQ(scheduler.counts().sampled, before);
            EXPECT_GT(scheduler.counts().read, 0);
        } else {
            EXPECT_EQ(scheduler.counts().sampled, 0);
            EXPECT_EQ(scheduler.counts().read, sampled);
        }
        options.archive = nullptr;
    }
    EXPECT_GT(sampled, 100);
}

}  // namespace
}  // namespace tessera
