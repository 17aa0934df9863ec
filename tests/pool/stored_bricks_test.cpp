#include "pool/stored_bricks.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <memory>

#include "brick_test_meshes.h"
#include "gl_test_tools.h"
#include "pool/pool_on_device.h"
#include "schedule/brick_scheduler.h"
#include "schedule/schedule_bricks.h"
#include "software/software_resampler.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_read.h"
#include "vdb/vdb_write.h"

namespace tessera {
namespace {

constexpr int kCells = 8;
constexpr int kBrickTexels = 9 * 9 * 9;
constexpr GlPlatform kPlatform = GlPlatform::eglSurfaceless;
const std::vector<int> kFields{0, 1};

Vec3i texelAt(int n) {
    return {n % 9, n / 9 % 9, n / 81};
}

bool isOnFace(const Vec3i& texel) {
    for (int a = 0; a < 3; ++a)
        if (texel[a] == 0 || texel[a] == kCells) return true;
    return false;
}

TetMesh ballWithFields() {
    TetMesh mesh = ballMesh(5, 1);
    addPointField(mesh, "wave", [](const Vec3d& p) { return std::sin(5 * p.x) + p.y * p.z; });
    int n = 0;
    addPointField(mesh, "holed", [&n](const Vec3d& p) { return ++n % 150 == 0 ? NAN : p.x + p.z; });
    return mesh;
}

/// A file written and read again.
VdbFile throughFile(const TetMesh& mesh, BricksShown bricks, int layers, bool hasStatistics) {
    BrickResult result;
    result.tree = std::move(bricks.tree);
    result.store = std::move(bricks.store);
    const std::vector<OutputField> outputs{{"wave", "wave", "point", 1, 0},
                                           {"holed", "holed", "point", 1, 1}};
    OutputShape shape;
    shape.layers = layers;
    shape.leafErrors = hasStatistics;
    VdbWriteOptions options;
    options.layers = layers;
    options.brickStatistics = hasStatistics;
    shapeForFile(mesh, kFields, outputs, SoftwareResampler(), {}, shape, result, {.threads = 1});
    const auto path =
        std::filesystem::path(testing::TempDir()) / ("stored_bricks_" + std::to_string(::getpid()) + ".vdb");
    writeVdb(path.string(), outputs, result, options, {.threads = 1});
    VdbFile file = readVdb(path.string());
    std::filesystem::remove(path);
    return file;
}

/// A pool that a scheduler has filled, and one filled from a file of the same bricks.
class StoredBricksTest : public testing::Test {
  protected:
    void schedule() {
        ScheduleOptions options;
        options.refine.criterion = Criterion::focus;
        options.refine.brickCells = kCells;
        options.refine.resolution = 125;
        options.refine.focus = {pointFocus({0.3, 0.2, 0.1}, 0.1)};
        options.budgetBytes = 150 * bytesOfBrick(int(kFields.size()), kCells);
        thread_.emplace(kPlatform);
        pool_ = makePool();
        target_ = std::make_unique<PoolTarget>(*pool_, mesh_, kFields, 1);
        scheduler_ = std::make_unique<BrickScheduler>(mesh_, kFields, resampler_, options, *target_);
        scheduler_->finish({.threads = 1});
    }
    std::unique_ptr<BrickPool> makePool() {
        TexelCoding coding(codingsOf(mesh_, kFields, SampleFormat::r32f), SampleFormat::r32f);
        PoolOptions options;
        options.budgetBytes = 200 * kBrickTexels * coding.pointBytes();
        return std::make_unique<BrickPool>(*thread_, kCells, coding, options);
    }

    /// Fills the other pool and compares all texels.
    void load(int layers, bool hasStatistics) {
        const Depth finest = scheduler_->tree().deepest();
        file_ = throughFile(mesh_, bricksOf(*scheduler_, finest), layers, hasStatistics);
        ASSERT_EQ(file_.statistics.has_value(), hasStatistics);
        stored_ = showStored(file_.tree, file_.store, {file_.layers, file_.halfFloat, hasStatistics},
                             {.threads = 2});
        const auto pool = makePool();
        PoolTarget target(*pool, 2);
        target.publish({.removed = {}, .added = stored_.bricks});
        ASSERT_FALSE(target.isBehind());

        const PoolOnDevice expected(*pool_, *pool_->state()), found(*pool, *pool->state());
        const std::vector<GrowingLeaf> leaves = scheduler_->tree().leaves();
        ASSERT_EQ(leaves.size(), stored_.bricks.size());
        EXPECT_GE(file_.tree.levelCount(), 3);
        isSame_.assign(leaves.size(), std::vector<bool>(kBrickTexels));
        for (const GrowingLeaf& leaf : leaves) {
            const std::int64_t at = file_.tree.findLeaf({levelOf(leaf.key.depth, finest), leaf.key.index});
            ASSERT_GE(at, 0);
            const GrowingLeaf& other = stored_.bricks[std::size_t(at)].leaf;
            const Vec3d middle = Vec3d(other.key.index) + 0.5;
            ASSERT_EQ(found.walk(middle * std::ldexp(1.0, -other.key.depth.halvings()))->first,
                      target.slotOf(other));
            const std::uint32_t a = *target_->slotOf(leaf), b = *target.slotOf(other);
            const std::vector<std::uint8_t> isAtSurface = cornersAtSurface(expected, a);
            for (int n = 0; n < kBrickTexels; ++n) {
                const Vec3i texel = texelAt(n);
                // A step apart they may be: the file has floats of another unit.
                const int fromSurface = expected.surface(a, 0, texel), inFile = found.surface(b, 0, texel);
                if (layers > 0 && isAtSurface[std::size_t(n)]) {
                    ++atSurface_;
                    EXPECT_NEAR(inFile, fromSurface, 1) << texel.x << " " << texel.y << " " << texel.z
                                                        << " depth " << leaf.key.depth.halvings();
                    EXPECT_EQ(inFile < 0, fromSurface < 0);
                }
                const bool isCovered = expected.coverage(a, 0, texel) != 0;
                const bool isSame = expected.bits(a, 0, texel) == found.bits(b, 0, texel) &&
                                    expected.bits(a, 1, texel) == found.bits(b, 1, texel);
                // Without an extension corners outside have other values, which faces to coarser bricks take.
                const bool mayDiffer = layers == 0 && isOnFace(texel);
                ASSERT_TRUE(isSame || !isCovered || mayDiffer) << "samples are the same, bit for bit";
                // A file has no samples of points on + faces, so of those that a coarser brick owns it can't
                // tell that they are inside where the corners around them aren't.
                const bool isFound = found.coverage(b, 0, texel) != 0;
                const bool isOwn = glm::all(glm::lessThan(texel, Vec3i(kCells)));
                ASSERT_TRUE(isFound == isCovered || (isCovered && !isOwn));
                ASSERT_TRUE(!isFound || mayDiffer ||
                            expected.coverage(a, 0, texel) == found.coverage(b, 0, texel));
                isSame_[std::size_t(at)][std::size_t(n)] = isSame;
                different_ += !isSame;
                uncovered_ += !isCovered;
            }
        }
    }
    /// Whether a texel is a corner of a cell that has corners in the mesh and others.
    static std::vector<std::uint8_t> cornersAtSurface(const PoolOnDevice& device, std::uint32_t slot) {
        std::vector<std::uint8_t> isCorner(kBrickTexels);
        for (int n = 0; n < kCells * kCells * kCells; ++n) {
            const Vec3i cell(n % kCells, n / kCells % kCells, n / (kCells * kCells));
            int inside = 0;
            for (int c = 0; c < 8; ++c) inside += device.surface(slot, 0, cell + cornerOffset(c)) >= 0;
            if (inside == 0 || inside == 8) continue;
            for (int c = 0; c < 8; ++c) {
                const Vec3i p = cell + cornerOffset(c);
                isCorner[std::size_t((p.z * 9 + p.y) * 9 + p.x)] = 1;
            }
        }
        return isCorner;
    }
    /// Of the cells that hold some places of every element: corners that differ.
    int differentAtTheMesh() const {
        std::vector<Vec3d> places = mesh_.points;
        for (const auto& tet : mesh_.tets) {
            Vec3d sum(0);
            for (const std::int32_t node : tet) sum += mesh_.points[std::size_t(node)];
            places.push_back(sum / 4.0);
            for (const std::int32_t node : tet)
                places.push_back(glm::mix(sum / 4.0, mesh_.points[std::size_t(node)], 0.95));
        }
        int different = 0;
        for (const Vec3d& place : places) {
            const Vec3d index0 = (place - file_.tree.originWorld()) / file_.tree.spacingWorld();
            const std::int64_t leaf = file_.tree.findLeafAt(index0);
            EXPECT_GE(leaf, 0);
            const BrickKey& key = file_.tree.leaves()[std::size_t(leaf)];
            const CellPlace at =
                locateInBrick(index0 * std::ldexp(1.0, -key.level) - Vec3d(key.index * kCells), kCells);
            for (int c = 0; c < 8; ++c) {
                const Vec3i p = at.cell + cornerOffset(c);
                different += cornerWeight(at.fraction, c) > 0 &&
                             !isSame_[std::size_t(leaf)][std::size_t((p.z * 9 + p.y) * 9 + p.x)];
            }
        }
        return different;
    }

    TetMesh mesh_ = ballWithFields();
    SoftwareResampler resampler_;
    std::optional<GlThread> thread_;
    std::unique_ptr<BrickPool> pool_;
    std::unique_ptr<PoolTarget> target_;
    std::unique_ptr<BrickScheduler> scheduler_;
    VdbFile file_;
    StoredBricks stored_;
    std::vector<std::vector<bool>> isSame_;  // by leaf of the file, texel by texel
    std::int64_t different_ = 0, uncovered_ = 0, atSurface_ = 0;
};

TEST_F(StoredBricksTest, WithAsManyLayersAsCellsAreThoseOfTheMesh) {
    TESSERA_NEEDS_GL(kPlatform);
    schedule();
    load(kCells, true);
    EXPECT_EQ(different_, 0);
    EXPECT_GT(uncovered_, 1000);
    EXPECT_GT(atSurface_, 1000);
    EXPECT_EQ(stored_.missingPoints, 0);
    EXPECT_EQ(stored_.estimatedPoints, 0);
    EXPECT_TRUE(stored_.notes.empty());
}

TEST_F(StoredBricksTest, WithOneLayerAreTheSameWhereverTheMeshIsRead) {
    TESSERA_NEEDS_GL(kPlatform);
    schedule();
    load(1, false);
    EXPECT_EQ(differentAtTheMesh(), 0);
    EXPECT_GT(different_, 0);
    EXPECT_LT(different_, uncovered_);
    EXPECT_EQ(stored_.estimatedPoints, 0);
    EXPECT_GT(stored_.missingPoints, 0);
    ASSERT_EQ(stored_.notes.size(), 2u);
    EXPECT_NE(stored_.notes[0].find("beyond the file's layers"), std::string::npos);
    EXPECT_NE(stored_.notes[1].find("--brick-statistics"), std::string::npos);
}

TEST_F(StoredBricksTest, WithoutAnExtensionDifferOutsideTheMeshAndSaySo) {
    TESSERA_NEEDS_GL(kPlatform);
    schedule();
    load(0, true);
    EXPECT_GT(differentAtTheMesh(), 0);
    EXPECT_LE(different_, uncovered_);
    EXPECT_GT(stored_.estimatedPoints, 0);
    ASSERT_EQ(stored_.notes.size(), 1u);
    EXPECT_NE(stored_.notes[0].find("--extend 1"), std::string::npos);
}

}  // namespace
}  // namespace tessera
