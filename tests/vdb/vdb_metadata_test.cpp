#include "vdb/vdb_metadata.h"

#include <gtest/gtest.h>

#include <cmath>

#include "files/base64.h"
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

TEST(VdbMetadata, Base64IsThatOfItsStandard) {
    // RFC 4648, section 10.
    const std::pair<const char*, const char*> known[] = {
        {"", ""},        {"f", "Zg=="},        {"fo", "Zm8="},
        {"foo", "Zm9v"}, {"foob", "Zm9vYg=="}, {"foobar", "Zm9vYmFy"}};
    for (const auto& [bytes, text] : known) {
        EXPECT_EQ(encodeBase64(bytes), text);
        EXPECT_EQ(decodeBase64(text), bytes);
    }
    std::string all;
    for (int i = 0; i < 256; ++i) all += char(i);
    EXPECT_EQ(decodeBase64(encodeBase64(all)), all);
    for (const char* text :
         {"Zg=", "Zg", "Zh==", "Zm9=", "=Zg=", "Z===", "====", "Zg==Zg==", "Zm9v\n", "Zm-v"})
        EXPECT_EQ(decodeBase64(text), std::nullopt) << text;
}

/// Of the three bricks and four channels of someMetadata(); the second brick has no sample.
BrickStatistics someStatistics() {
    BrickStatistics statistics;
    statistics.channels = 4;
    statistics.errors = {0.25f, NAN, 0};
    statistics.ranges.resize(12);
    statistics.firstBins = {0};
    for (std::size_t i = 0; i < 12; ++i) {
        if (i / 4 != 1) {
            statistics.ranges[i] = {-1.5f, float(i)};
            statistics.bins.push_back({std::uint8_t(i), 4000});
            statistics.bins.push_back({255, 96});
        }
        statistics.firstBins.push_back(statistics.bins.size());
    }
    return statistics;
}

TEST(VdbMetadata, BrickStatisticsComeBack) {
    EXPECT_FALSE(encodeMetadata(someMetadata()).contains("tessera_brick_statistics"));
    EXPECT_FALSE(decodeMetadata(encodeMetadata(someMetadata())).statistics);
    VdbMetadata metadata = someMetadata();
    metadata.statistics = someStatistics();
    const auto entries = encodeMetadata(metadata);
    const VdbMetadata read = decodeMetadata(entries);
    ASSERT_TRUE(read.statistics);
    EXPECT_EQ(encodeMetadata(read), entries);
    EXPECT_EQ(countSameSamples(*read.statistics, *metadata.statistics), 3);
    EXPECT_EQ(read.statistics->errors[0], 0.25f);
    EXPECT_TRUE(std::isnan(read.statistics->errors[1]));
    EXPECT_TRUE(read.statistics->histogram(1, 2).empty());
    EXPECT_EQ(read.statistics->range(2, 3).max, 11);
    EXPECT_EQ(read.statistics->channelRange(3).max, 11);
    EXPECT_EQ(read.statistics->histogram(2, 3)[1], (BinCount{255, 96}));
}

TEST(VdbMetadata, BrickStatisticsThatDoNotFitAreRefused) {
    VdbMetadata metadata = someMetadata();
    metadata.statistics = someStatistics();
    const std::string good = *decodeBase64(encodeMetadata(metadata).at("tessera_brick_statistics"));
    const auto refusal = [&](const std::string& text) -> std::string {
        auto entries = encodeMetadata(metadata);
        entries["tessera_brick_statistics"] = text;
        try {
            decodeMetadata(entries);
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    };
    const auto changed = [&](std::size_t at, const std::string& bytes) {
        return refusal(encodeBase64(std::string(good).replace(at, bytes.size(), bytes)));
    };
    EXPECT_EQ(refusal(encodeBase64(good)), "");
    EXPECT_NE(refusal("no text of bytes").find("base64"), std::string::npos);
    EXPECT_NE(changed(0, "\2").find("version 2"), std::string::npos);
    EXPECT_NE(changed(4, "\4").find("4 bricks and 4 channels, the file has 3 and 4"), std::string::npos);
    EXPECT_NE(changed(8, "\377\377\377\377").find("channels"), std::string::npos);
    EXPECT_NE(changed(12, std::string("\0\0\200\277", 4)).find("negative error"), std::string::npos);
    // The first channel: a count of bins, a range, then a gap and a count for each bin.
    EXPECT_NE(changed(16, "\201\2").find("257 bins"), std::string::npos);
    EXPECT_NE(changed(16, "\377\377\377\377\177").find("32 bits"), std::string::npos);
    EXPECT_NE(changed(17, std::string("\0\0\200\177", 4)).find("range"), std::string::npos);
    EXPECT_NE(changed(17, std::string("\0\0\200\77", 4)).find("range"), std::string::npos) << "1 above 0";
    EXPECT_NE(changed(25, "\1").find("histogram"), std::string::npos) << "the next bin is 256";
    EXPECT_NE(changed(26, "\241\37").find("histogram"), std::string::npos) << "4001 + 96 are above 16^3";
    EXPECT_NE(refusal(encodeBase64(good + '\0')).find("behind the last"), std::string::npos);
    for (std::size_t size = 0; size < good.size(); ++size)
        EXPECT_NE(refusal(encodeBase64(good.substr(0, size))).find("ends early"), std::string::npos) << size;
    metadata.layout = VdbLayout::flat;
    EXPECT_NE(refusal(encodeBase64(good)).find("flat"), std::string::npos);
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
