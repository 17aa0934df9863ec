#include "pool/pool_target.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <tuple>

#include "brick_test_meshes.h"
#include "compute/compute_resampler.h"
#include "gl/gl_program.h"
#include "gl_test_tools.h"
#include "hybrid/hybrid_resampler.h"
#include "pool/face_steps.h"
#include "refine/plan_frame.h"
#include "refine/resample_tree.h"
#include "schedule/brick_scheduler.h"
#include "schedule/random_schedule.h"
#include "slicing/slicing_resampler.h"
#include "software/software_resampler.h"
#include "tessera/error.h"

namespace tessera {
namespace {

using Clock = BrickScheduler::Clock;

constexpr int kCells = 8;
constexpr GlPlatform kPlatform = GlPlatform::eglSurfaceless;
constexpr int kLinear = 1;  // the linear field

TetMesh meshWithFields(TetMesh mesh) {
    addPointField(mesh, "wave", [](const Vec3d& p) { return std::sin(5 * p.x) + p.y * p.z; });
    addPointField(mesh, "linear", [](const Vec3d& p) { return 3 + p.x - 2 * p.y + 0.5 * p.z; });
    int n = 0;
    addPointField(mesh, "holed", [&n](const Vec3d& p) { return ++n % 150 == 0 ? NAN : p.x + p.z; });
    return mesh;
}

enum class Algorithm { software, slicing, hybrid, compute };
constexpr std::string_view kNames[] = {"software", "slicing", "hybrid", "compute"};

std::unique_ptr<Resampler> make(Algorithm algorithm) {
    switch (algorithm) {
        case Algorithm::slicing:
            return std::make_unique<SlicingResampler>();
        case Algorithm::hybrid:
            return std::make_unique<HybridResampler>();
        case Algorithm::compute:
            return std::make_unique<ComputeResampler>();
        default:
            return std::make_unique<SoftwareResampler>();
    }
}

struct Setting {
    SampleFormat format = SampleFormat::r32f;
    Algorithm algorithm = Algorithm::software;
    int budgetBricks = 180;
    int poolBricks = 300;
    int atlasTexels = 1024;
    int resolution = 249;
    std::vector<int> fields{0, kLinear, 2};
    int threads = 1;
    bool hasBounds = false;
    bool poolGrows = false;
};

/// A scheduler that fills a pool, on an OpenGL thread of its own.
class Bench {
  public:
    explicit Bench(const Setting& setting, TetMesh made = ballMesh(5, 1))
        : mesh(meshWithFields(std::move(made))), fields(setting.fields) {
        resampler = make(setting.algorithm);
        options.refine.criterion = Criterion::focus;
        options.refine.brickCells = kCells;
        options.refine.resolution = setting.resolution;
        options.refine.focus = {pointFocus({0.3, 0.2, 0.1}, 0.1)};
        if (setting.algorithm != Algorithm::software)
            options.refine.bind = {.target = std::string(nameOf(kPlatform)), .format = setting.format};
        options.budgetBytes =
            std::int64_t(setting.budgetBricks) * 729 * (4 * std::int64_t(fields.size()) + 1);
        if (setting.hasBounds) options.refine.boundsWorld = Box3d{Vec3d(-0.6, -0.7, 0), Vec3d(0.5, 0.8, 0.9)};
        frame = chooseFrame(mesh.boundsWorld(), options.refine);

        TexelCoding coding(codingsOf(mesh, fields, setting.format), setting.format);
        PoolOptions poolOptions;
        poolOptions.budgetBytes = setting.poolBricks * 9 * 9 * 9 * coding.pointBytes();
        poolOptions.limits.texels = setting.atlasTexels;
        poolOptions.firstBytes = setting.poolGrows ? 1 : 0;
        pool = std::make_unique<BrickPool>(thread, kCells, coding, poolOptions);
        target = std::make_unique<PoolTarget>(*pool, mesh, fields, setting.threads);
        scheduler = std::make_unique<BrickScheduler>(mesh, fields, *resampler, options, *target);
    }

    void jump(std::mt19937& random) {
        std::uniform_real_distribution<double> share(0, 1);
        const Box3d bounds = mesh.boundsWorld();
        const Vec3d at = glm::mix(bounds.min, bounds.max, Vec3d(share(random), share(random), share(random)));
        scheduler->setFocus({pointFocus(at, 0.02 + 0.2 * share(random))});
    }
    void update(std::mt19937& random) {
        std::uniform_real_distribution<double> share(0, 1);
        if (share(random) < 0.15) jump(random);
        scheduler->update(Clock::now() + std::chrono::microseconds(int(3000 * share(random))),
                          {.threads = 1});
    }

    std::int64_t liveObjects() {
        return thread.run([](GlContext& context) { return context.liveObjects(); });
    }

    TetMesh mesh;
    std::vector<int> fields;
    ScheduleOptions options;
    PlanFrame frame;
    std::unique_ptr<Resampler> resampler;
    GlThread thread{kPlatform};
    std::unique_ptr<BrickPool> pool;
    std::unique_ptr<PoolTarget> target;
    std::unique_ptr<BrickScheduler> scheduler;
};

template <class Visit>
void forEachLocal(Visit&& visit) {
    for (int n = 0; n < 729; ++n) visit(Vec3i(n % 9, n / 9 % 9, n / 81), std::size_t(n));
}

/// Gives the store the value of the nearest mesh point wherever a leaf's closed box depends on a point
/// outside.
void extendEverywhere(const BrickTree& tree, const Reconstruction& reconstruction, BrickStore& store) {
    const auto channels = std::size_t(store.channels());
    TileMap extension;
    std::vector<double> values(channels);
    const auto put = [&](int level, const Vec3i& p) {
        Tile& tile = extension[{level, floorDiv(p, kTileSize)}];
        if (!tile.values) tile.values = std::make_unique<float[]>(channels * kTilePoints);
        const int offset = offsetInTile(p);
        if (tile.covered(offset)) return;
        tile.cover(offset);
        reconstruction.nearestValues(level, p, 0, values);
        for (std::size_t c = 0; c < channels; ++c)
            tile.values[c * kTilePoints + std::size_t(offset)] = float(values[c]);
    };
    for (const BrickKey& leaf : tree.leaves())
        forEachLocal([&](const Vec3i& local, std::size_t) {
            reconstruction.visitOutside(leaf.level, leaf.index * kCells + local, put);
        });
    store.extension() = std::move(extension);
}

/// What the seam rule gives at every point of every leaf shown, from samples made anew.
class Expected {
  public:
    explicit Expected(Bench& bench)
        : finest_(bench.scheduler->tree().deepest()),
          tree_(bench.scheduler->tree().brickTree(bench.frame.originWorld, bench.frame.rootSpacingWorld,
                                                  kCells, finest_)),
          nearest_(bench.mesh, 1) {
        BindOptions bind = bench.options.refine.bind;
        bind.route = Route::pass;
        bound_ = bench.resampler->bind(bench.mesh, bench.fields, bind);
        ResampleStatistics statistics;
        store_ = resampleTree(tree_, *bound_, int(bench.fields.size()), {.threads = 2}, statistics);
        reconstruction_.emplace(bench.mesh, bench.fields, tree_, store_, nearest_);
        extendEverywhere(tree_, *reconstruction_, store_);
    }
    /// Whether the point is covered by the seam rule.
    bool at(const DepthKey& leaf, const Vec3i& local, std::span<double> values) const {
        const Vec3i p = leaf.index * kCells + local;
        return reconstruction_->resolve(levelOf(leaf.depth, finest_), p, 0, values) == PointSource::covered;
    }
    /// The leaf's own samples at all points of its closed box.
    Block ownSamples(const DepthKey& leaf) const {
        const IndexBox closed{leaf.index * kCells, (leaf.index + 1) * kCells + 1};
        Block block;
        bound_->resample(tree_.lattice(levelOf(leaf.depth, finest_)), {&closed, 1},
                         [&](std::size_t, const Block& made) { block = made; }, {.threads = 1});
        return block;
    }

  private:
    Depth finest_;
    BrickTree tree_;
    std::unique_ptr<BoundResampler> bound_;
    NearestOnDemand nearest_;
    BrickStore store_;
    std::optional<Reconstruction> reconstruction_;
};

std::uint32_t expectedBits(const ValueCoding& coding, double value) {
    const auto code = float(coding.encode(value));
    switch (coding.format()) {
        case SampleFormat::r32f:
            return std::bit_cast<std::uint32_t>(code);
        case SampleFormat::r16f:
            return halfFromFloat(code);
        case SampleFormat::r16:
            return std::uint32_t(std::lround(double(code) * 65535));
        case SampleFormat::r8:
            return std::uint32_t(std::lround(double(code) * 255));
    }
    return 0;
}

struct Seen {
    std::int64_t texels = 0, uncovered = 0, invalid = 0, atSurface = 0;
};

bool isOnBorder(const Vec3i& local) {
    for (int a = 0; a < 3; ++a)
        if (local[a] == 0 || local[a] == kCells) return true;
    return false;
}

/// The pool shows the scheduler's leaves, and every texel of their slots is that of the seam rule.
void expectPool(Bench& bench, Seen& seen) {
    ASSERT_FALSE(bench.target->isBehind());
    const Expected expected(bench);
    const auto state = bench.pool->state();
    ASSERT_TRUE(state);
    const PoolOnDevice device(*bench.pool, *state);
    const std::vector<GrowingLeaf> leaves = bench.scheduler->tree().leaves();
    ASSERT_EQ(leaves.size(), bench.target->bricks().leafCount());
    std::int64_t wrongValues = 0, wrongTexels = 0, wrongCoverage = 0, wrongSurface = 0;
    const NearestPointIndex nearest(bench.mesh);
    std::vector<bool> isTaken(bench.pool->capacity());
    for (const GrowingLeaf& leaf : leaves) {
        const auto found =
            device.walk((Vec3d(leaf.key.index) + 0.5) * std::ldexp(1.0, -leaf.key.depth.halvings()));
        ASSERT_TRUE(found);
        const std::uint32_t slot = found->first;
        ASSERT_EQ(found->second, leaf.key.depth.halvings());
        ASSERT_EQ(bench.target->slotOf(leaf), slot);
        ASSERT_FALSE(isTaken[slot]);
        isTaken[slot] = true;
        const IndexBox closed = bench.target->bricks().closedPoints(leaf.key);
        const PointValues values = bench.target->bricks().valuesAt(leaf, closed);
        const int channels = int(bench.fields.size());
        std::vector<double> want(bench.fields.size());
        const Block own = expected.ownSamples(leaf.key);
        forEachLocal([&](const Vec3i& local, std::size_t n) {
            const bool isCovered = expected.at(leaf.key, local, want) || own.coverage[n] != 0;
            wrongValues += bool(values.covered[n]) != isCovered;
            std::vector<int> coverage(bench.pool->coding().groupCount(), isCovered ? 1 : 0);
            for (int c = 0; c < channels; ++c) {
                const double value = want[std::size_t(c)];
                const double got = values.values[n * want.size() + std::size_t(c)];
                wrongValues += !(std::bit_cast<std::uint64_t>(got) == std::bit_cast<std::uint64_t>(value) ||
                                 (std::isnan(got) && std::isnan(value)));
                const bool isFinite = std::isfinite(value);
                if (isCovered && !isFinite) coverage[std::size_t(c / 4)] += 1 << c % 4, ++seen.invalid;
                const ValueCoding& coding = bench.pool->coding().codings()[std::size_t(c)];
                wrongTexels += device.bits(slot, c, local) != (isFinite ? expectedBits(coding, value) : 0);
            }
            if (const double voxels = std::abs(double(values.surface[n]));
                voxels < kFarFromSurface && !isOnBorder(local)) {
                const Vec3d place = own.lattice.worldFromIndex(Vec3d(closed.min + local));
                const double distance = nearest.find(place, 2 * own.lattice.uWorld.x).distanceWorld;
                wrongSurface += !(std::abs(voxels - distance / own.lattice.uWorld.x) <= 1e-6);
                wrongSurface += (values.surface[n] < 0) != (own.coverage[n] == 0);
                ++seen.atSurface;
            }
            for (std::size_t group = 0; group < coverage.size(); ++group) {
                const int code = device.surface(slot, group, local);
                wrongSurface += !(std::abs(code - double(values.surface[n]) / kFarFromSurface * 127) <= 1) ||
                                (code < 0) != (values.surface[n] < 0);
            }
            for (std::size_t group = 0; group < coverage.size(); ++group)
                wrongCoverage += device.coverage(slot, group, local) != coverage[group];
            ++seen.texels;
            seen.uncovered += !isCovered;
        });
    }
    EXPECT_EQ(wrongValues, 0);
    EXPECT_EQ(wrongTexels, 0);
    EXPECT_EQ(wrongCoverage, 0);
    EXPECT_EQ(wrongSurface, 0);
}

/// From random places the index leads to the scheduler's leaf, or to none.
void expectIndex(Bench& bench, std::mt19937& random, int places) {
    const auto state = bench.pool->state();
    const PoolOnDevice device(*bench.pool, *state);
    const GrowingTree& tree = bench.scheduler->tree();
    const Depth depth = tree.deepest() + 1;
    Vec3i low(1 << 30), high(-(1 << 30));
    for (const GrowingLeaf& leaf : tree.leaves()) {
        const Vec3i root = ancestorKey(leaf.key, Depth(0)).index;
        low = glm::min(low, root), high = glm::max(high, root + 1);
    }
    const double scale = std::ldexp(1.0, depth.halvings());
    std::uniform_real_distribution<double> share(0, 1);
    int hits = 0, misses = 0;
    for (int i = 0; i < places; ++i) {
        const Vec3d t(share(random), share(random), share(random));
        Vec3d place = glm::mix(Vec3d(low) - 0.3, Vec3d(high) + 0.3, t);
        if (i % 2 == 0) place = glm::floor(place * scale) / scale;  // on borders and corners
        const auto want = tree.findCovering({depth, Vec3i(glm::floor(place * scale))});
        const auto got = device.walk(place);
        ASSERT_EQ(bool(got), bool(want));
        ++(want ? hits : misses);
        if (!want) continue;
        ASSERT_EQ(got->second, want->key.depth.halvings());
        ASSERT_EQ(got->first, bench.target->slotOf(*want));
    }
    EXPECT_GT(hits, places / 10);
    EXPECT_GT(misses, places / 100);
}

/// At random points on faces the linear field has one value on both sides.
void expectNoStep(Bench& bench, std::mt19937& random, int perLeaf, std::int64_t& acrossDepths) {
    const int channel =
        int(std::find(bench.fields.begin(), bench.fields.end(), kLinear) - bench.fields.begin());
    const FaceSteps steps =
        stepsOnFaces(*bench.pool, *bench.target, bench.scheduler->tree(), {channel}, random, perLeaf);
    EXPECT_LE(steps.texels, 1.0001);
    EXPECT_LE(steps.values, 4);
    acrossDepths += steps.acrossDepths;
}

class PoolOfFormat : public testing::TestWithParam<std::tuple<SampleFormat, Algorithm>> {};

TEST_P(PoolOfFormat, HoldsTheSeamRulesValuesAfterPublications) {
    TESSERA_NEEDS_GL(kPlatform);
    Setting setting;
    std::tie(setting.format, setting.algorithm) = GetParam();
    const bool isSlow = setting.algorithm != Algorithm::software;
    if (isSlow) setting.resolution = 125, setting.budgetBricks = 150;
    // One of each kind: several threads, a single channel, two groups of channels, several atlases, bounds.
    if (setting.format == SampleFormat::r32f) setting.threads = 3;
    if (setting.format == SampleFormat::r16f) setting.fields = {kLinear};
    if (setting.format == SampleFormat::r16) setting.fields = {0, 2, kLinear, 2, 0, 2};
    if (setting.format == SampleFormat::r8) setting.atlasTexels = 40, setting.hasBounds = true;
    setting.poolGrows = setting.format != SampleFormat::r32f;
    Bench bench(setting);
    const std::int64_t firstBytes = bench.pool->deviceBytes();
    EXPECT_EQ(bench.pool->layout().atlases > 3, setting.format == SampleFormat::r8);
    std::mt19937 random(unsigned(setting.format) + 7);
    // TESSERA_POOL_UPDATES asks for more.
    const int updates = asked("TESSERA_POOL_UPDATES", isSlow ? 4 : 40);
    const int every = isSlow ? std::max(4, updates / 100) : 20;
    Seen seen;
    std::int64_t acrossDepths = 0;
    for (int step = 1; step <= updates && !HasFailure(); ++step) {
        bench.update(random);
        if (step % every != 0 || bench.scheduler->tree().leafCount() == 0) continue;
        expectPool(bench, seen);
        expectIndex(bench, random, 1000);
        expectNoStep(bench, random, 10, acrossDepths);
    }
    // The same bricks at the end, however far the updates came.
    bench.scheduler->setFocus({pointFocus({0, 0.1, 0.3}, 0.12)});
    bench.scheduler->finish({.threads = 1});
    expectPool(bench, seen);
    expectNoStep(bench, random, 20, acrossDepths);
    EXPECT_GT(seen.texels, 50000);
    EXPECT_GT(seen.uncovered, 1000);
    EXPECT_GT(seen.atSurface, 1000);
    EXPECT_EQ(seen.invalid > 10, setting.fields.size() > 1);
    EXPECT_GT(acrossDepths, 50);
    EXPECT_GT(bench.target->counts().changed, 0);
    EXPECT_EQ(bench.target->counts().postponed, 0);
    EXPECT_EQ(bench.pool->deviceBytes() > 2 * firstBytes, setting.poolGrows);
    bench.scheduler.reset();
    bench.target.reset();
    EXPECT_GT(bench.liveObjects(), 0);
    bench.pool.reset();
    EXPECT_EQ(bench.liveObjects(), 0);
}

INSTANTIATE_TEST_SUITE_P(All, PoolOfFormat,
                         testing::Combine(testing::Values(SampleFormat::r32f, SampleFormat::r16f,
                                                          SampleFormat::r16, SampleFormat::r8),
                                          testing::Values(Algorithm::software, Algorithm::slicing,
                                                          Algorithm::hybrid, Algorithm::compute)),
                         [](const testing::TestParamInfo<PoolOfFormat::ParamType>& param) {
                             return std::string(nameOf(std::get<0>(param.param))) + "_" +
                                    std::string(kNames[int(std::get<1>(param.param))]);
                         });

// TESSERA_SCHEDULE_SEEDS and TESSERA_SCHEDULE_STEPS ask for more.
TEST(SlicedSchedule, EveryPublishedStateIsWhole) {
    TESSERA_NEEDS_GL(kPlatform);
    const int seeds = asked("TESSERA_SCHEDULE_SEEDS", 1), steps = asked("TESSERA_SCHEDULE_STEPS", 100);
    int cutShort = 0;
    ScheduleCounts sum;
    for (int seed = 0; seed < seeds && !HasFailure(); ++seed)
        runAtRandom(unsigned(seed), steps, std::make_unique<SlicingResampler>(),
                    {.target = std::string(nameOf(kPlatform))}, cutShort, sum);
    EXPECT_GT(sum.sampled, 0);
}

TEST(Pool, StatesThatAreHeldStay) {
    TESSERA_NEEDS_GL(kPlatform);
    Bench bench({.format = SampleFormat::r16, .budgetBricks = 200, .poolBricks = 250});
    bench.scheduler->finish({.threads = 1});
    std::mt19937 random(5);
    Seen seen;
    for (int round = 0; round < 4; ++round) {
        auto held = bench.pool->state();
        const PoolOnDevice before(*bench.pool, *held);
        std::vector<std::uint32_t> slots;
        for (const GrowingLeaf& leaf : bench.scheduler->tree().leaves())
            slots.push_back(*bench.target->slotOf(leaf));
        bench.jump(random);
        bench.scheduler->finish({.threads = 1});
        const PoolOnDevice after(*bench.pool, *held);
        EXPECT_EQ(before.words(), after.words());
        std::int64_t changed = 0;
        for (const std::uint32_t slot : slots) changed += !before.agreesIn(slot, after);
        EXPECT_EQ(changed, 0);
        if (round % 2 == 0)
            held.reset();
        else
            bench.thread.run([&](GlContext&) { held.reset(); });
        EXPECT_TRUE(bench.target->catchUp());
    }
    expectPool(bench, seen);
    EXPECT_GT(bench.target->counts().postponed, 0);
}

TEST(Pool, ThatIsJustLargeEnoughIsNeverBehind) {
    TESSERA_NEEDS_GL(kPlatform);
    Bench bench({.format = SampleFormat::r8, .budgetBricks = 150, .poolBricks = 150});
    ASSERT_EQ(bench.pool->capacity(), 150u);
    EXPECT_EQ(bench.target->budgetBytes(bench.scheduler->brickBytes()), bench.options.budgetBytes);
    std::mt19937 random(6);
    Seen seen;
    for (int round = 0; round < 4; ++round) {
        bench.jump(random);
        bench.scheduler->finish({.threads = 1});
        if (round % 2 == 1) expectPool(bench, seen);
    }
    EXPECT_EQ(bench.target->counts().postponed, 0);
}

TEST(Pool, MayGoBeforeAStateThatIsHeld) {
    TESSERA_NEEDS_GL(kPlatform);
    Bench bench({});
    bench.scheduler->finish({.threads = 1});
    auto held = bench.pool->state();
    bench.scheduler.reset();
    bench.target.reset();
    bench.pool.reset();
    EXPECT_GT(bench.liveObjects(), 0);
    held.reset();
    EXPECT_EQ(bench.liveObjects(), 0);
}

TEST(Pool, ThatIsTooSmallSaysSoAndRecovers) {
    TESSERA_NEEDS_GL(kPlatform);
    Bench bench({.poolBricks = 85});
    bench.scheduler->finish({.threads = 1});
    EXPECT_TRUE(bench.target->isBehind());
    EXPECT_THROW(bench.target->catchUp(), InputError);
    EXPECT_EQ(bench.target->slotOf(bench.scheduler->tree().leaves().back()), std::nullopt);
    bench.scheduler->setBudget(85 * bench.scheduler->brickBytes());
    bench.scheduler->finish({.threads = 1});
    Seen seen;
    expectPool(bench, seen);
    TexelCoding coding(codingsOf(bench.mesh, bench.fields, SampleFormat::r8), SampleFormat::r8);
    PoolOptions options;
    options.budgetBytes = 1000;
    EXPECT_THROW(BrickPool(bench.thread, kCells, coding, options), InputError);
}

TEST(Pool, TellsItsBytes) {
    TESSERA_NEEDS_GL(kPlatform);
    Bench bench({.format = SampleFormat::r16});
    const std::int64_t textures = std::int64_t(bench.pool->capacity()) * 729 * (4 * 2 + 2);
    EXPECT_EQ(bench.pool->deviceBytes(), textures);
    bench.scheduler->finish({.threads = 1});
    EXPECT_GT(bench.pool->deviceBytes(), textures);
    EXPECT_LT(bench.pool->deviceBytes(), textures + 100000);
}

// What a shader finds at each of some places.
struct FoundByShader {
    std::int32_t isThere;
    std::uint32_t slot;
    std::int32_t depth;
    float inBrick;  // along x
};
std::vector<FoundByShader> findByShader(GlThread& thread, const GlBuffer& index,
                                        std::span<const Vec3d> places) {
    constexpr ShaderText kMain{"find_bricks", R"(
        layout(local_size_x = 64) in;
        layout(std430, binding = 1) readonly buffer Places { ivec4 roots_rests[]; };
        layout(std430, binding = 2) writeonly buffer Found { ivec4 found[]; };
        void main() {
            uint i = gl_GlobalInvocationID.x;
            if (2 * i >= roots_rests.length()) return;
            FoundBrick brick = findBrick(roots_rests[2 * i].xyz, intBitsToFloat(roots_rests[2 * i + 1].xyz));
            found[i] = ivec4(brick.isThere, brick.slot, brick.depth, floatBitsToInt(brick.inBrick.x));
        })"};
    std::vector<std::array<std::int32_t, 8>> asked;
    for (const Vec3d& place : places) {
        const Vec3d root = glm::floor(place);
        const auto rest = [&](int a) { return std::bit_cast<std::int32_t>(float(place[a] - root[a])); };
        asked.push_back({int(root.x), int(root.y), int(root.z), 0, rest(0), rest(1), rest(2), 0});
    }
    std::vector<FoundByShader> found(places.size());
    thread.run([&](GlContext& context) {
        const GlFunctions& gl = context.functions();
        const GlProgram program = makeProgram(context, {{GL_COMPUTE_SHADER, kMain, {brickIndexShader()}}},
                                              {{"BRICK_INDEX_BINDING", "0"}});
        const GlBuffer from(context, std::span(asked));
        const GlBuffer to(context, std::int64_t(found.size() * sizeof found[0]), 0);
        gl.UseProgram(program.id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, index.id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, from.id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 2, to.id());
        gl.DispatchCompute(GLuint(found.size() + 63) / 64, 1, 1);
        gl.MemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
        gl.GetNamedBufferSubData(to.id(), 0, to.bytes(), found.data());
    });
    return found;
}

TEST(Pool, ShadersFindBricks) {
    TESSERA_NEEDS_GL(kPlatform);
    Bench bench({});
    bench.scheduler->finish({.threads = 1});
    const auto state = bench.pool->state();
    const PoolOnDevice device(*bench.pool, *state);
    std::mt19937 random(8);
    std::vector<Vec3d> places;
    // Places that a float holds exactly, down to the finest bricks.
    for (int i = 0; i < 20000; ++i)
        places.push_back(Vec3d(random() % 6144, random() % 6144, random() % 6144) / 1024.0 - 1.0);
    const std::vector<FoundByShader> found = findByShader(bench.thread, *state->index, places);
    int hits = 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
        const auto want = device.walk(places[i]);
        ASSERT_EQ(found[i].isThere, bool(want));
        if (!want) continue;
        ++hits;
        ASSERT_EQ(found[i].slot, want->first);
        ASSERT_EQ(found[i].depth, want->second);
        const double x = places[i].x * std::ldexp(1.0, want->second);
        ASSERT_EQ(double(found[i].inBrick), x - std::floor(x));
    }
    EXPECT_GT(hits, 3000);
}

TEST(Pool, ShadersFindBricksUnderAGridOfLargerCells) {
    TESSERA_NEEDS_GL(kPlatform);
    BrickIndex index;
    std::vector<Vec3i> roots;
    std::mt19937 random(9);
    for (int i = 0; i < 100; ++i) roots.emplace_back(random() % 3000, random() % 3000, random() % 3000);
    index.cover(roots);
    std::vector<Vec3d> places;
    for (std::size_t i = 0; i < roots.size(); ++i) {
        index.put({Depth(1), roots[i] * 2 + 1}, std::uint32_t(i));
        places.emplace_back(Vec3d(roots[i]) + 0.75);
        places.emplace_back(Vec3d(roots[i]) + 0.25);
    }
    GlThread thread(kPlatform);
    std::vector<FoundByShader> found;
    thread.run([&](GlContext& context) {
        const GlBuffer words(context, index.words());
        found = findByShader(thread, words, places);
    });
    for (std::size_t i = 0; i < roots.size(); ++i) {
        ASSERT_TRUE(found[2 * i].isThere && !found[2 * i + 1].isThere);
        ASSERT_EQ(found[2 * i].slot, i);
        ASSERT_EQ(found[2 * i].depth, 1);
        ASSERT_EQ(found[2 * i].inBrick, 0.5f);
    }
}

TEST(PoolLayout, FillsTheBudget) {
    std::mt19937 random(1);
    for (int i = 0; i < 300; ++i) {
        const int edge = i % 2 == 0 ? 17 : 9;
        const std::int64_t texel = 1 + std::int64_t(random() % 20);
        const std::int64_t wanted = 1 + std::int64_t(random() % (i < 100 ? 50 : 200000));
        AtlasLimits limits;
        limits.texels = 64 << random() % 8;
        const std::int64_t budget = wanted * edge * edge * edge * texel;
        const SlotLayout layout = chooseSlotLayout(edge, texel, texel, budget, limits);
        const auto capacity = std::int64_t(layout.capacity());
        EXPECT_LE(capacity, wanted);
        for (int a = 0; a < 3; ++a) EXPECT_LE(layout.texels()[a], limits.texels);
        EXPECT_LE(std::int64_t(layout.slotsAnAtlas()) * edge * edge * edge * texel, limits.bytes);
        EXPECT_LE(layout.atlases, limits.atlases);
        const std::int64_t n = limits.texels / edge;
        const std::int64_t most = std::min(n * n * n, limits.bytes / (edge * edge * edge * texel)) * 16;
        EXPECT_GE(double(capacity), 0.9 * double(std::min(wanted, most)) - 16) << wanted << " " << most;
    }
}

TEST(PoolTexels, HalfFloatsAreTheNearest) {
    for (std::uint32_t half = 0; half < 0x7c00; ++half) {
        const float value = floatFromHalf(std::uint16_t(half));
        ASSERT_EQ(halfFromFloat(value), half);
        ASSERT_EQ(halfFromFloat(-value), half | 0x8000);
        const float next = half == 0x7bff ? 65536.0f : floatFromHalf(std::uint16_t(half + 1));
        const float middle = value + (next - value) / 2;
        ASSERT_EQ(halfFromFloat(middle), half + (half & 1));
        ASSERT_EQ(halfFromFloat(std::nextafter(middle, 0.0f)), half);
        ASSERT_EQ(halfFromFloat(std::nextafter(middle, 1e9f)), half + 1);
    }
}

TEST(PoolIndex, FarRootsTakeAGridOfLargerCells) {
    std::mt19937 random(2);
    BrickIndex index;
    std::vector<DepthKey> keys;
    for (int i = 0; i < 200; ++i) {
        const auto coordinate = [&] { return int(random() % 20000) - 10000; };
        keys.push_back({Depth(int(random() % 4)), {coordinate(), coordinate(), coordinate()}});
        const Vec3i root = ancestorKey(keys.back(), Depth(0)).index;
        index.cover({&root, 1});
        if (index.findCovering(keys.back())) {
            keys.pop_back();
            continue;
        }
        index.put(keys.back(), std::uint32_t(i));
    }
    EXPECT_GT(keys.size(), 150u);
    EXPECT_LT(index.words().size(), 50000u);
    for (const DepthKey& key : keys) {
        const auto found = index.findCovering(childKey(key, 5));
        ASSERT_TRUE(found && found->key == key);
        const auto owner = index.findOwner(key.depth, key.index * 8 + 7, 8);
        ASSERT_TRUE(owner && owner->key == key);
        if (key.depth > Depth(0)) {
            const auto above = index.findOwner(key.depth - 1, key.index * 4, 8);
            ASSERT_TRUE(above && above->key == key);
        }
    }
    for (const DepthKey& key : keys) index.remove(key);
    for (const std::uint32_t word : index.words().subspan(BrickIndex::kHeaderWords)) ASSERT_EQ(word, 0u);
    EXPECT_THROW(index.remove(keys[0]), InternalError);
}

}  // namespace
}  // namespace tessera
