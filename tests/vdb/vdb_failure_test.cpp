#include <pthread.h>

#include <atomic>
#include <ostream>
#include <span>
#include <string_view>

#include "files/atomic_file.h"
#include "refine/brick_result.h"
#include "refine/refine_options.h"
#include "tessera/error.h"
#include "vdb/vdb_file.h"
#include "vdb/vdb_metadata.h"
#include "vdb/vdb_read.h"
#include "vdb/vdb_write.h"
#include "vdb_case.h"

namespace tessera {
namespace {

class VdbFailureTest : public VdbFileTest {};

TEST_F(VdbFailureTest, NamesThatWouldClashAreRefused) {
    EXPECT_THROW(checkOutputFields({{"coverage", "a", "point", 1, 0}}), InputError);
    EXPECT_THROW(checkOutputFields({{"a", "a", "point", 1, 0}, {"a", "b", "point", 3, 1}}), InputError);
    EXPECT_THROW(checkOutputFields({{"S", "a", "point", 2, 0}, {"S_1", "b", "point", 1, 2}}), InputError);
    EXPECT_THROW(checkOutputFields({{"surface", "a", "point", 1, 0}}, true), InputError);
    EXPECT_NO_THROW(checkOutputFields({{"surface", "a", "point", 1, 0}}, false));
    EXPECT_THROW(checkOutputFields({{"", "a", "point", 1, 0}}), InputError);
    EXPECT_NO_THROW(checkOutputFields(kMixed));
}

TEST_F(VdbFailureTest, UnwritablePlacesAreRefusedAtOnce) {
    EXPECT_THROW(checkWritable(file("missing/out.vdb")), IoError);
    EXPECT_THROW(checkWritable(directory_.string()), IoError);
    EXPECT_THROW(checkWritable(directory_.string() + "/"), IoError);
    EXPECT_THROW(checkWritable(""), IoError);
    EXPECT_THROW(checkWritable("/dev/null"), IoError);
    EXPECT_THROW(checkWritable("/proc/out.vdb"), IoError);
    EXPECT_THROW(checkWritable(file(std::string(300, 'x'))), IoError);
    writeBytes(file("plain"), "x");
    EXPECT_THROW(checkWritable(file("plain/out.vdb")), IoError);
    EXPECT_NO_THROW(checkWritable(file("new.vdb")));
    EXPECT_NO_THROW(checkWritable(file("plain")));
    EXPECT_NO_THROW(checkWritable(file(std::string(250, 'x'))));
    EXPECT_EQ(readBytes(file("plain")), "x");
    EXPECT_EQ(fileCount(), 1u) << "a check leaves nothing behind";
}

TEST_F(VdbFailureTest, FailedWriteLeavesTheOldFileAlone) {
    writeBytes(file("out.vdb"), "precious");
    for (rlim_t limit : {rlim_t(0), rlim_t(20), rlim_t(40), rlim_t(5000), rlim_t(200000)}) {
        SCOPED_TRACE(limit);
        for (const char* name : {"out.vdb", "new.vdb"}) {
            BrickResult result = makeResult({0, 0, 0}, 1, 16, nestedLeaves(), 10);
            const FileSizeLimit full(limit);
            EXPECT_THROW(writeVdb(file(name), kMixed, result, {}, {}), IoError);
        }
        EXPECT_EQ(readBytes(file("out.vdb")), "precious");
        EXPECT_EQ(fileCount(), 1u);
    }
}

TEST_F(VdbFailureTest, CancelledWriteLeavesNothing) {
    std::atomic<bool> cancel{true};
    Execution execution;
    execution.cancel = &cancel;
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 1);
    EXPECT_THROW(writeVdb(file("out.vdb"), kScalar, result, {}, execution), Cancelled);
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(VdbFailureTest, StreamsWriteInOrderAndGoBack) {
    constexpr std::size_t kBytes = std::size_t(75) << 20;  // the end goes past the system's cache
    std::string expected;
    expected.reserve(kBytes + 1000);
    for (std::uint32_t i = 0; expected.size() < kBytes; ++i) expected.append(i % 1000, char('a' + i % 26));
    const std::size_t places[] = {3, (std::size_t(70) << 20) + 3};
    for (const int threads : {1, 2}) {
        Execution execution;
        execution.threads = threads;
        AtomicFile out(file("out"));
        std::string seen;
        seen.reserve(expected.size());
        AtomicFileBuffer buffer(out, execution, [&](std::span<const char> bytes) {
            if (seen.size() < expected.size()) seen.append(bytes.begin(), bytes.end());
        });
        std::ostream stream(&buffer);
        for (std::size_t i = 0, at = 0; at < expected.size(); at += i++ * 1000)
            stream << std::string_view(expected).substr(at, i * 1000);
        stream.flush();
        EXPECT_TRUE(seen == expected);
        std::string changed = expected + "!";
        for (const std::size_t place : places) {
            stream.seekp(std::streamoff(place)).write("back", 4);
            changed.replace(place, 4, "back");
        }
        stream.seekp(0, std::ios_base::end).put('!');
        stream.flush();
        ASSERT_TRUE(stream.good());
        out.commit();
        EXPECT_TRUE(readBytes(file("out")) == changed);
    }
}

TEST_F(VdbFailureTest, StreamsNeedNoThreadOfTheirOwn) {
    pthread_attr_t before, huge;
    ASSERT_EQ(pthread_getattr_default_np(&before), 0);
    ASSERT_EQ(pthread_getattr_default_np(&huge), 0);
    ASSERT_EQ(pthread_attr_setstacksize(&huge, std::size_t(1) << 50), 0);
    Execution execution;
    execution.threads = 2;
    const std::string expected(std::size_t(5) << 20, 'x');
    AtomicFile out(file("out"));
    AtomicFileBuffer buffer(out, execution);
    std::ostream stream(&buffer);
    ASSERT_EQ(pthread_setattr_default_np(&huge), 0);  // no stack, no thread
    stream << expected << std::flush;
    ASSERT_EQ(pthread_setattr_default_np(&before), 0);
    ASSERT_TRUE(stream.good());
    out.commit();
    EXPECT_TRUE(readBytes(file("out")) == expected);
}

TEST_F(VdbFailureTest, SymbolicLinkKeepsPointingAtTheFile) {
    writeBytes(file("real.vdb"), "old");
    fs::create_symlink(file("real.vdb"), file("link.vdb"));
    writeFileAtomically(file("link.vdb"), "new");
    EXPECT_TRUE(fs::is_symlink(file("link.vdb")));
    EXPECT_EQ(readBytes(file("real.vdb")), "new");
}

TEST_F(VdbFailureTest, TemporaryFilesCanBeRemovedBySignalHandlers) {
    AtomicFile open(file("out.vdb"));
    open.writeAt(0, "abc", 3);
    EXPECT_EQ(fileCount(), 1u);
    removeTemporaryFiles();
    EXPECT_EQ(fileCount(), 0u);
}

TEST_F(VdbFailureTest, DamagedFilesAreRefused) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 1);
    writeVdb(file("out.vdb"), kScalar, result, {}, {});
    const std::string good = readBytes(file("out.vdb"));
    for (std::size_t length : {std::size_t(0), std::size_t(5), std::size_t(21), std::size_t(56),
                               std::size_t(57), std::size_t(1000), good.size() - 1}) {
        writeBytes(file("cut.vdb"), good.substr(0, length));
        EXPECT_THROW(readVdb(file("cut.vdb")), InputError) << length;
        EXPECT_THROW(readVdbLattice(file("cut.vdb")), InputError) << length;
    }
    for (std::uint32_t i = 0; i < 300; ++i) {
        std::string bad = good;
        // Past the UUID, whose own damage can make the file look like another program's.
        const std::size_t at = 57 + scramble(i) % (bad.size() - 57);
        bad[at] = char(bad[at] ^ (1 << (i % 8)));
        writeBytes(file("bad.vdb"), bad);
        EXPECT_THROW(readVdb(file("bad.vdb")), InputError) << at;
    }
    writeBytes(file("noise.vdb"), std::string(1000, 'x'));
    EXPECT_THROW(readVdb(file("noise.vdb")), InputError);
    EXPECT_THROW(readVdb(file("missing.vdb")), InputError);
    EXPECT_THROW(readVdb(directory_.string()), InputError);
}

TEST_F(VdbFailureTest, FilesOfOtherProgramsGiveTheirLattice) {
    openvdb::initialize();
    const openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0.0f);
    for (int i = 0; i < 100; ++i) grid->tree().setValueOn(openvdb::Coord(i, 3 * i, -i), float(i));
    grid->setName("density");
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.25));
    grid->transform().postTranslate(openvdb::Vec3d(1, -2, 3));
    openvdb::io::File(file("other.vdb")).write(openvdb::GridPtrVec{grid});
    const FixedFrame frame = readVdbLattice(file("other.vdb"));
    EXPECT_EQ(frame.originWorld, Vec3d(1, -2, 3));
    EXPECT_EQ(frame.spacingWorld, 0.25);
    EXPECT_THROW(readVdb(file("other.vdb")), InputError);

    grid->transform().preRotate(0.5, openvdb::math::X_AXIS);
    openvdb::io::File(file("turned.vdb")).write(openvdb::GridPtrVec{grid});
    EXPECT_THROW(readVdbLattice(file("turned.vdb")), InputError);
    openvdb::io::File(file("empty.vdb")).write(openvdb::GridPtrVec{});
    EXPECT_THROW(readVdbLattice(file("empty.vdb")), InputError);
}

TEST_F(VdbFailureTest, FileSavedAgainByAnotherProgramStillReads) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10, valueAt, everywhere);
    writeVdb(file("out.vdb"), kMixed, result, {}, {});
    openvdb::io::File source(file("out.vdb"));
    source.open(false);
    const openvdb::MetaMap::Ptr metadata = source.getMetadata();
    const openvdb::GridPtrVecPtr grids = source.getGrids();
    // Full leaf nodes of the mask become tiles, as many tools do.
    for (const openvdb::GridBase::Ptr& grid : *grids) grid->pruneGrid();
    openvdb::io::File(file("again.vdb")).write(*grids, *metadata);
    expectStored(readVdb(file("again.vdb")), 10, valueAt, everywhere);
}

TEST_F(VdbFailureTest, EmptyTreeGivesAFileWithoutVoxels) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {}, 1);
    writeVdb(file("out.vdb"), kScalar, result, {}, {});
    EXPECT_EQ(readVdb(file("out.vdb")).tree.leafCount(), 0u);
}

TEST_F(VdbFailureTest, VdbPrintListsTheGrids) {
    if (std::system("command -v vdb_print > /dev/null 2>&1") != 0)
        GTEST_SKIP() << "vdb_print isn't installed";
    BrickResult result = makeResult({0, 0, 0}, 1, 8, nestedLeaves(), 10);
    writeVdb(file("out.vdb"), kMixed, result, {}, {});
    ASSERT_EQ(std::system(("vdb_print -l " + file("out.vdb") + " > " + file("list.txt")).c_str()), 0);
    const std::string list = readBytes(file("list.txt"));
    for (const char* name : {"T_level_0", "U_level_3", "S_5_level_2", "coverage_level_1", "tessera_bricks"})
        EXPECT_NE(list.find(name), std::string::npos) << name;
}

}  // namespace
}  // namespace tessera
