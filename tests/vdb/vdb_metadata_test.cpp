#include "vdb/vdb_metadata.h"

#include <gtest/gtest.h>

#include "tessera/error.h"
#include "vdb/report_json.h"

namespace tessera {
namespace {

VdbMetadata someMetadata() {
    VdbMetadata metadata;
    metadata.version = "1";
    metadata.fields = {{"p", "pressure", "point", 1, 0}, {"U", "velocity", "cell", 3, 1}};
    metadata.tree = BrickTree({0.1, -2, 3e5}, 0.25, 16, {{0, {2, 0, -1}}, {1, {0, 0, -1}}, {3, {-7, 5, 0}}});
    metadata.boundsWorld = Box3d{{0, 0, 0}, {1, 2, 3}};
    metadata.voxelShift = -0.5;
    metadata.report.nodes = 80;
    metadata.time = 0.1;
    return metadata;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
}

/// Metadata with a part of one entry changed must be refused, and the message names it.
void expectRefused(const std::string& key, const std::string& from, const std::string& to,
                   const std::string& word) {
    auto entries = encodeMetadata(someMetadata());
    entries[key] = replaced(entries[key], from, to);
    try {
        decodeMetadata(entries);
        ADD_FAILURE() << key << " was read with " << to;
    } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << error.what();
    }
}

TEST(VdbMetadata, ComesBack) {
    const auto entries = encodeMetadata(someMetadata());
    const VdbMetadata read = decodeMetadata(entries);
    EXPECT_EQ(encodeMetadata(read), entries);
    EXPECT_EQ(read.tree.originWorld(), Vec3d(0.1, -2, 3e5));
    ASSERT_EQ(read.tree.leafCount(), 3u);
    EXPECT_EQ(read.tree.leaves()[2], (BrickKey{3, {-7, 5, 0}}));
    EXPECT_EQ(read.fields[1].firstChannel, 1);
    EXPECT_EQ(read.voxelShift, -0.5);
    EXPECT_EQ(read.report.nodes, 80);
    EXPECT_EQ(entries.at("tessera_time"), "0.1");
    EXPECT_EQ(read.time, 0.1);
    VdbMetadata timeless = someMetadata();
    timeless.time.reset();
    EXPECT_FALSE(encodeMetadata(timeless).contains("tessera_time"));
    EXPECT_FALSE(decodeMetadata(encodeMetadata(timeless)).time);
}

TEST(VdbMetadata, NumbersThatDoNotFitAreRefused) {
    const char* bricks = "tessera_bricks";
    for (const char* number : {"1e300", "2.5", "-1e30", "\"2\"", "true", "null", "[2]"})
        expectRefused(bricks, "[[2,", std::string("[[") + number + ",", "a brick index");
    expectRefused(bricks, "[[2,", "[[67108864,", "67108864");
    expectRefused(bricks, "[[2,", "[[18446744073709551615,", "a brick index");
    expectRefused(bricks, "\"spacing\":0.25", "\"spacing\":1e308", "coarsest level");
    expectRefused(bricks, "\"brick_cells\":16", "\"brick_cells\":4294967312", "brick_cells");
    for (const char* shift : {"nan", "inf", "2", "half"})
        expectRefused("tessera_voxel_shift", "-0.5", shift, "tessera_voxel_shift");
    // 2^32 + 3 would wrap to 3.
    expectRefused("tessera_fields", "\"components\":3", "\"components\":4294967299", "components");
    expectRefused("tessera_fields", "\"first_channel\":1", "\"first_channel\":4294967297", "first_channel");
    expectRefused("tessera_report", "\"nodes\":80", "\"nodes\":1e300", "nodes");
    expectRefused("tessera_report", "\"nodes\":80", "\"nodes\":9223372036854775808", "nodes");
    expectRefused("tessera_report", "\"nodes\":80", "\"nodes\":80.5", "nodes");
    for (const char* number : {"soon", "inf", "", "0.1 s"})
        expectRefused("tessera_time", "0.1", number, "tessera_time");
}

TEST(VdbMetadata, DeepNestingIsRefused) {
    const std::string deep(200000, '['), end(200000, ']');
    EXPECT_THROW(reportFromJson(deep), InputError);
    EXPECT_THROW(reportFromJson(deep + end), InputError);
    expectRefused("tessera_report", "\"nodes\":80", "\"nodes\":" + deep + end, "nested");
    expectRefused("tessera_bricks", "[[2,", "[[" + deep + end + ",", "nested");
}

}  // namespace
}  // namespace tessera
