#define NANOVDB_USE_BLOSC
#include "vdb/nvdb_write.h"

#include <iostream>  // before GridValidator.h, which lacks it

#include <nanovdb/util/GridValidator.h>
#include <nanovdb/util/IO.h>

#include <atomic>
#include <map>

#include "refine/brick_result.h"
#include "tessera/error.h"
#include "vdb/vdb_write.h"
#include "vdb_case.h"

namespace tessera {
namespace {

class NvdbTest : public VdbFileTest {};

/// Every voxel of the .vdb file's grid in the .nvdb file's, and the other way round.
template <class Value, class Open, class Nano, class Same>
void expectSameGrid(const Open& open, const nanovdb::NanoGrid<Nano>& nano, const Same& same) {
    EXPECT_EQ(nano.gridName(), open.getName());
    EXPECT_EQ(nano.activeVoxelCount(), open.activeVoxelCount());
    EXPECT_GT(open.activeVoxelCount(), 0u);
    std::int64_t wrong = 0, inactive = 0;
    const openvdb::CoordBBox box = open.evalActiveVoxelBoundingBox();
    for (int x = box.min().x() - 2; x <= box.max().x() + 2; ++x)
        for (int y = box.min().y() - 2; y <= box.max().y() + 2; ++y)
            for (int z = box.min().z() - 2; z <= box.max().z() + 2; ++z) {
                const openvdb::Coord c(x, y, z);
                const nanovdb::Coord n(x, y, z);
                Value value{};
                const bool isActive = open.tree().probeValue(c, value);
                inactive += !isActive;
                wrong +=
                    nano.tree().isActive(n) != isActive || !same(value, nano.tree().getValue(n), isActive);
            }
    EXPECT_EQ(wrong, 0);
    EXPECT_GT(inactive, 0);
    for (const openvdb::Vec3d& p : {openvdb::Vec3d(0, 0, 0), openvdb::Vec3d(-17, 3, 5.5)}) {
        const openvdb::Vec3d a = open.indexToWorld(p);
        const nanovdb::Vec3d b = nano.indexToWorld(nanovdb::Vec3d(p.x(), p.y(), p.z()));
        for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(a[axis], b[axis], 1e-12);
    }
    EXPECT_TRUE(nanovdb::isValid(nano));
}

// A scalar, a vector, and two components that become grids of their own.
const std::vector<OutputField> kThree{
    {"T", "Temp", "point", 1, 0}, {"U", "velocity", "point", 3, 1}, {"S", "strain", "cell", 2, 4}};

TEST_F(NvdbTest, HoldsTheGridsOfTheVdbFile) {
    for (const UpAxis upAxis : {UpAxis::keep, UpAxis::y}) {
        VdbWriteOptions options = flatOptions();
        options.background = -3;
        options.upAxis = upAxis;
        options.unitScale = 10;
        BrickResult one = flatResult(6), other = flatResult(6);
        const VdbWriteResult vdb = writeVdb(file("out.vdb"), kThree, one, options, {});
        const VdbWriteResult nvdb = writeNvdb(file("out.nvdb"), kThree, other, options, {});
        EXPECT_EQ(nvdb.activeVoxels, vdb.activeVoxels);
        EXPECT_EQ(nvdb.fileBytes, std::int64_t(fs::file_size(file("out.nvdb"))));

        std::map<std::string, openvdb::GridBase::Ptr> open;
        for (const openvdb::GridBase::Ptr& grid : readGrids(file("out.vdb"))) open[grid->getName()] = grid;
        const auto handles = nanovdb::io::readGrids(file("out.nvdb"));
        ASSERT_EQ(handles.size(), 5u);
        for (const std::size_t g : {0u, 2u, 3u}) {
            const auto* scalar = handles[g].grid<float>();
            ASSERT_TRUE(scalar);
            EXPECT_TRUE(scalar->isFogVolume());
            expectSameGrid<float>(*openvdb::gridPtrCast<openvdb::FloatGrid>(open[scalar->gridName()]),
                                  *scalar, [](float a, float b, bool) { return sameFloat(a, b); });
        }
        EXPECT_STREQ(handles[3].grid<float>()->gridName(), "S_1");
        ASSERT_TRUE(handles[1].grid<nanovdb::Vec3f>());
        expectSameGrid<openvdb::Vec3f>(
            *openvdb::gridPtrCast<openvdb::Vec3SGrid>(open["U"]), *handles[1].grid<nanovdb::Vec3f>(),
            [](const openvdb::Vec3f& a, const nanovdb::Vec3f& b, bool) {
                return sameFloat(a[0], b[0]) && sameFloat(a[1], b[1]) && sameFloat(a[2], b[2]);
            });
        ASSERT_TRUE(handles[4].grid<nanovdb::ValueMask>());
        expectSameGrid<bool>(*openvdb::gridPtrCast<openvdb::BoolGrid>(open["coverage"]),
                             *handles[4].grid<nanovdb::ValueMask>(),
                             [](bool, bool b, bool isActive) { return b == isActive; });
    }
}

TEST_F(NvdbTest, SameBytesForAnyNumberOfThreads) {
    std::string first;
    for (const int threads : {1, 2, 5}) {
        BrickResult result = flatResult(6);
        Execution execution;
        execution.threads = threads;
        writeNvdb(file("out.nvdb"), kThree, result, flatOptions(), execution);
        const std::string bytes = readBytes(file("out.nvdb"));
        if (first.empty()) first = bytes;
        EXPECT_TRUE(bytes == first) << threads;
    }
}

TEST_F(NvdbTest, AFieldWithoutAFiniteValueIsAnEmptyGrid) {
    BrickResult result = flatResult(1, [](int, const Vec3i&, int) { return kNaN; });
    writeNvdb(file("out.nvdb"), kScalar, result, flatOptions(), {});
    const auto handle = nanovdb::io::readGrid(file("out.nvdb"), "f");
    ASSERT_TRUE(handle.grid<float>());
    // The extension's two values are finite.
    EXPECT_EQ(handle.grid<float>()->activeVoxelCount(), 2u);
    EXPECT_GT(
        nanovdb::io::readGrid(file("out.nvdb"), "coverage").grid<nanovdb::ValueMask>()->activeVoxelCount(),
        0u);
}

TEST_F(NvdbTest, AMeshBetweenTheVoxelsGivesEmptyGrids) {
    BrickResult result = flatResult(1, valueAt, [](int, const Vec3i&) { return false; });
    result.store.extension().clear();
    EXPECT_EQ(writeNvdb(file("out.nvdb"), kScalar, result, flatOptions(), {}).activeVoxels, 0);
    EXPECT_EQ(nanovdb::io::readGrid(file("out.nvdb"), "f").grid<float>()->activeVoxelCount(), 0u);
}

TEST_F(NvdbTest, HalfFloatsAreRefused) {
    BrickResult result = flatResult(1);
    VdbWriteOptions options = flatOptions();
    options.halfFloat = true;
    EXPECT_THROW(writeNvdb(file("out.nvdb"), kScalar, result, options, {}), InputError);
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(NvdbTest, FailedAndCancelledWritesLeaveNothing) {
    for (const rlim_t limit : {rlim_t(0), rlim_t(100), rlim_t(20000)}) {
        BrickResult result = flatResult(10);
        const FileSizeLimit full(limit);
        EXPECT_THROW(writeNvdb(file("out.nvdb"), kMixed, result, flatOptions(), {}), IoError) << limit;
        EXPECT_EQ(fileCount(), 0u);
    }
    const std::atomic<bool> cancel{true};
    Execution execution;
    execution.cancel = &cancel;
    BrickResult result = flatResult(1);
    EXPECT_THROW(writeNvdb(file("out.nvdb"), kScalar, result, flatOptions(), execution), Cancelled);
    EXPECT_EQ(fileCount(), 0u);
}

}  // namespace
}  // namespace tessera
