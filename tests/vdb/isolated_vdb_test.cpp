#include "reader/isolated_vdb.h"

#include <openvdb/io/File.h>
#include <sys/stat.h>

#include <cstring>

#include "base/text.h"
#include "files/file_digest.h"
#include "tessera/error.h"
#include "vdb/vdb_read.h"
#include "vdb/vdb_write.h"
#include "vdb_case.h"

namespace tessera {
namespace {

const IsolatedReader kReader{TESSERA_MISBEHAVING_READER, {"read"}};

constexpr std::int64_t kMostBytes = 1 << 30;

std::vector<std::byte> packed(VdbFile file, VdbContents contents = VdbContents::all) {
    std::vector<std::byte> bytes;
    packVdb(std::move(file), contents, kMostBytes).writeTo([&](const void* data, std::size_t count) {
        const auto* first = static_cast<const std::byte*>(data);
        bytes.insert(bytes.end(), first, first + count);
    });
    return bytes;
}

/// The digest of these bytes in place of the one in them.
std::string mended(std::string bytes) {
    bytes.replace(kUuidOffset, kUuidBytes, kUuidBytes, '0');
    FileDigest digest;
    digest.update(bytes.data(), bytes.size());
    return bytes.replace(kUuidOffset, kUuidBytes, digest.uuid());
}

class IsolatedVdbTest : public VdbFileTest {
  protected:
    /// A file of bricks of four levels, or a flat one with an extension.
    std::string writeFile(VdbLayout layout) {
        const bool isFlat = layout == VdbLayout::flat;
        BrickResult result = isFlat ? flatResult(10) : makeResult({1, 2, 3}, 0.5, 8, nestedLeaves(), 10);
        writeVdb(file("out.vdb"), kMixed, result, isFlat ? flatOptions() : VdbWriteOptions{}, {});
        return file("out.vdb");
    }
    std::string refusal(const std::string& path) {
        try {
            readVdbIsolated(kReader, path, VdbContents::all, {}, {});
        } catch (const InputError& error) {
            return error.what();
        }
        return "(it was read)";
    }
};

TEST_F(IsolatedVdbTest, FileIsThatInProcessBitForBit) {
    for (const VdbLayout layout : {VdbLayout::levels, VdbLayout::flat}) {
        const std::string path = writeFile(layout);
        EXPECT_EQ(packed(readVdbIsolated(kReader, path, VdbContents::all, {}, {})), packed(readVdb(path)));
        const VdbFile bare = readVdbIsolated(kReader, path, VdbContents::withoutValues, {}, {});
        EXPECT_EQ(bare.store.channels(), 0);
        EXPECT_EQ(bare.store.coveredPoints(), readVdb(path).store.coveredPoints());
        const FixedFrame frame = readVdbLatticeIsolated(kReader, path, {}, {});
        EXPECT_EQ(frame.originWorld, readVdbLattice(path).originWorld);
        EXPECT_EQ(frame.spacingWorld, readVdbLattice(path).spacingWorld);
    }
}

TEST_F(IsolatedVdbTest, GridsAreReadAsInProcess) {
    const std::string path = writeFile(VdbLayout::levels);
    const std::vector<std::vector<GridPlace>> places{{{{1, 2, 3}, {0, 0, 0}}, {{1.1, 2.2, 3.3}, {1, 2, 3}}}};
    const std::vector<GridQuestion> questions{{"T_level_0", 1, 0}, {"U_level_3", 3, 0}, {"none", 1, 0}};
    const auto here = sampleGrids(path, places, questions);
    const auto there = isolatedGridSampler(kReader, {}, {})(path, places, questions);
    ASSERT_EQ(there.size(), 3u);
    for (std::size_t q = 0; q < 3; ++q) {
        ASSERT_EQ(there[q].size(), q < 2 ? 2u : 0u);
        ASSERT_EQ(here[q].size(), there[q].size());
        for (std::size_t i = 0; i < here[q].size(); ++i)
            EXPECT_EQ(std::memcmp(&here[q][i], &there[q][i], sizeof(GridReading)), 0);
    }
}

TEST_F(IsolatedVdbTest, DamagedPacketsAreRefusedOrHarmless) {
    BrickResult result = makeResult({0, 0, 0}, 1, 8, {{0, {0, 0, 0}}, {0, {2, 0, 0}}}, 1);
    writeVdb(file("out.vdb"), kScalar, result, {}, {});
    const std::vector<std::byte> good = packed(readVdb(file("out.vdb")));
    EXPECT_EQ(packed(unpackVdb(good, kMostBytes, {})), good);
    for (std::size_t size = 0; size < good.size(); size += 97)
        EXPECT_THROW(unpackVdb(std::span(good).first(size), kMostBytes, {}), DamagedPacket);
    int refused = 0;
    for (std::uint32_t i = 0; i < 3000; ++i) {
        std::vector<std::byte> bad = good;
        // Most bytes are values, of which any are sound.
        bad[scramble(i) % (i % 2 ? good.size() : good.size() - 4096)] ^= std::byte(1 << (i % 8));
        try {
            packed(unpackVdb(bad, kMostBytes, {}));
        } catch (const DamagedPacket&) {
            ++refused;
        }
    }
    EXPECT_GT(refused, 300);
}

TEST_F(IsolatedVdbTest, DamageUnderAMendedDigestIsRefusedOrRead) {
    const std::string good = readBytes(writeFile(VdbLayout::levels));
    EXPECT_EQ(mended(good), good);
    for (std::uint32_t i = 0; i < 12; ++i) {
        std::string bad = good;
        for (std::uint32_t k = 0; k < 4; ++k) {
            const std::size_t at = 57 + scramble(i * 4 + k) % (bad.size() - 57);
            bad[at] = char(scramble(i + k) & 255);
        }
        writeBytes(file("bad.vdb"), mended(bad));
        EXPECT_NE(refusal(file("bad.vdb")), "");
    }
}

TEST_F(IsolatedVdbTest, DamagedFilesOfOtherProgramsGiveAFrameOrAnError) {
    openvdb::initialize();
    const openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0.0f);
    for (int i = 0; i < 100; ++i) grid->tree().setValueOn(openvdb::Coord(i, 3 * i, -i), float(i));
    grid->setName("density");
    openvdb::io::File(file("other.vdb")).write(openvdb::GridPtrVec{grid});
    const std::string good = readBytes(file("other.vdb"));
    for (std::uint32_t i = 0; i < 12; ++i) {
        std::string bad = good;
        for (std::uint32_t k = 0; k < 3; ++k)
            bad[57 + scramble(i * 3 + k) % 400] = char(scramble(i + k) & 255);
        writeBytes(file("bad.vdb"), bad);
        try {
            readVdbLatticeIsolated(kReader, file("bad.vdb"), {}, {});
        } catch (const InputError& error) {
            EXPECT_LE(std::string(error.what()).size(), kLongestMessageBytes);
        }
    }
}

TEST_F(IsolatedVdbTest, WhatIsNoRegularFileIsRefusedAtOnce) {
    ASSERT_EQ(::mkfifo(file("pipe.vdb").c_str(), 0600), 0);
    EXPECT_EQ(refusal(file("pipe.vdb")), file("pipe.vdb") + ": isn't a regular file");
    EXPECT_EQ(refusal("/dev/zero"), "/dev/zero: isn't a regular file");
    EXPECT_EQ(refusal(directory_.string()), directory_.string() + ": is a directory, expected a file");
}

TEST_F(IsolatedVdbTest, AnEndlessNameIsCutOff) {
    openvdb::initialize();
    const openvdb::FloatGrid::Ptr grid = openvdb::FloatGrid::create(0.0f);
    grid->setName(std::string(5000, 'x') + "\n\x1b[2J");
    grid->setTransform(openvdb::math::Transform::createLinearTransform(0.25));
    grid->transform().preRotate(0.5, openvdb::math::X_AXIS);
    openvdb::io::File(file("long.vdb")).write(openvdb::GridPtrVec{grid});
    try {
        readVdbLatticeIsolated(kReader, file("long.vdb"), {}, {});
        FAIL() << "it was read";
    } catch (const InputError& error) {
        const std::string message = error.what();
        EXPECT_EQ(message.size(), kLongestMessageBytes);
        EXPECT_EQ(message.find_first_of("\n\x1b"), std::string::npos);
        EXPECT_TRUE(message.starts_with(file("long.vdb"))) << message;
    }
}

}  // namespace
}  // namespace tessera
