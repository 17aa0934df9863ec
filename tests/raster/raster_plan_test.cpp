// How the wanted boxes are cut into regions, and how values stand in a target.

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <thread>

#include "base/floor_div.h"
#include "raster/channel_coding.h"
#include "raster/prepared_region.h"
#include "raster/raster_budget.h"
#include "raster/regions.h"
#include "reference/random.h"
#include "tessera/lattice.h"

namespace tessera {
namespace {

/// What every plan holds to. Returns the points of all regions.
std::int64_t checkPlan(const std::vector<IndexBox>& boxes, std::int64_t maxPoints) {
    const std::vector<RasterRegion> regions = planRasterRegions(boxes, maxPoints);
    std::vector<std::vector<IndexBox>> ofBox(boxes.size());
    std::int64_t rendered = 0;
    for (const RasterRegion& region : regions) {
        EXPECT_FALSE(region.points.empty());
        EXPECT_FALSE(region.parts.empty());
        EXPECT_LE(region.points.count(), std::max<std::int64_t>(1, maxPoints));
        for (int a = 0; a < 3; ++a) {
            EXPECT_EQ(floorDiv(region.points.min[a], kCellEdge),
                      floorDiv(region.points.max[a] - 1, kCellEdge));
            EXPECT_EQ(cellOrigin(region.points)[a], floorDiv(region.points.min[a], kCellEdge) * kCellEdge);
        }
        rendered += region.points.count();
        for (const RasterRegion::Part& part : region.parts) {
            EXPECT_FALSE(part.points.empty());
            EXPECT_EQ(intersect(part.points, region.points), part.points);
            EXPECT_EQ(intersect(part.points, boxes.at(part.box)), part.points);
            ofBox.at(part.box).push_back(part.points);
        }
    }
    // Disjoint parts within a box that add up to its count hold each of its points once.
    for (std::size_t b = 0; b < boxes.size(); ++b) {
        std::int64_t count = 0;
        for (std::size_t i = 0; i < ofBox[b].size(); ++i) {
            count += ofBox[b][i].count();
            for (std::size_t j = 0; j < i; ++j) EXPECT_TRUE(intersect(ofBox[b][i], ofBox[b][j]).empty());
        }
        EXPECT_EQ(count, boxes[b].count()) << "box " << b;
    }
    return rendered;
}

TEST(RasterRegions, OneBoxInACellIsOneRegion) {
    const std::vector<IndexBox> boxes{{{3, 4, 5}, {200, 250, 256}}};
    const auto regions = planRasterRegions(boxes, 1 << 24);
    ASSERT_EQ(regions.size(), 1u);
    EXPECT_EQ(regions[0].points, boxes[0]);
    EXPECT_EQ(checkPlan(boxes, 1 << 24), boxes[0].count());
}

TEST(RasterRegions, EmptyBoxesWantNothing) {
    EXPECT_TRUE(planRasterRegions({}, 1 << 24).empty());
    const std::vector<IndexBox> empty{
        {{0, 0, 0}, {0, 5, 5}}, {{3, 3, 3}, {2, 9, 9}}, {{-7, -7, -7}, {-7, -7, -7}}};
    EXPECT_TRUE(planRasterRegions(empty, 1 << 24).empty());
    std::vector<IndexBox> mixed = empty;
    mixed.push_back({{1, 1, 1}, {2, 2, 2}});
    EXPECT_EQ(checkPlan(mixed, 1 << 24), 1);
}

TEST(RasterRegions, NoneCrossesACellAtNegativeAndHugeIndices) {
    const int far = 1'000'000'000;
    for (const int at : {-256, -255, -257, -1, 0, 255, 256, far, -far, (1 << 30) - 300, -(1 << 30)}) {
        const std::vector<IndexBox> boxes{{Vec3i(at), Vec3i(at + 1)},
                                          {{at, at - 40, at + 5}, {at + 300, at + 20, at + 280}},
                                          {{at - 1, at - 1, at - 1}, {at + 1, at + 1, at + 1}}};
        checkPlan(boxes, 1 << 24);
        checkPlan(boxes, 5000);
    }
}

TEST(RasterRegions, KeepTheirSizeDownToOnePoint) {
    const std::vector<IndexBox> boxes{{{-5, 0, 3}, {9, 8, 12}}, {{0, 0, 0}, {6, 6, 6}}};
    for (const std::int64_t most : {1, 2, 7, 64, 1000}) checkPlan(boxes, most);
    EXPECT_GE(checkPlan({{{0, 0, 0}, {300, 300, 300}}}, 1 << 20), 300 * 300 * 300);
}

TEST(RasterRegions, SparseBoxesWasteLittle) {
    // Two small boxes in opposite corners of a cell, a diagonal of bricks, a plane of bricks.
    std::vector<IndexBox> corners{{{0, 0, 0}, {9, 9, 9}}, {{247, 247, 247}, {256, 256, 256}}};
    EXPECT_EQ(checkPlan(corners, 1 << 24), 2 * 729);
    std::vector<IndexBox> diagonal, plane;
    for (int i = 0; i < 512; i += 16) {
        diagonal.push_back({Vec3i(i), Vec3i(i + 17)});
        for (int j = 0; j < 512; j += 16) plane.push_back({{i, j, 100}, {i + 17, j + 17, 117}});
    }
    for (const auto& boxes : {diagonal, plane}) {
        std::int64_t wanted = 0;
        for (const IndexBox& box : boxes) wanted += box.count();
        EXPECT_LE(checkPlan(boxes, 1 << 24), 4 * wanted);
    }
}

TEST(RasterRegions, ManyBricksShareRegions) {
    std::vector<IndexBox> bricks;
    for (int z = -128; z < 128; z += 16)
        for (int y = -128; y < 128; y += 16)
            for (int x = -128; x < 128; x += 16) bricks.push_back({{x, y, z}, {x + 17, y + 17, z + 17}});
    ASSERT_EQ(bricks.size(), 4096u);
    EXPECT_LE(planRasterRegions(bricks, 1 << 24).size(), 27u);
    EXPECT_EQ(checkPlan(bricks, 1 << 24), 257 * 257 * 257);
}

TEST(RasterRegions, RandomBoxesAreCutExactly) {
    Random random(5);
    for (int round = 0; round < 40; ++round) {
        std::vector<IndexBox> boxes;
        const int count = 1 + random.below(60), spread = 1 << (3 + random.below(8));
        for (int b = 0; b < count; ++b) {
            IndexBox box;
            for (int a = 0; a < 3; ++a) {
                box.min[a] = random.below(2 * spread) - spread;
                box.max[a] = box.min[a] + random.below(1 << random.below(9)) - 1;
            }
            boxes.push_back(box);
        }
        checkPlan(boxes, std::int64_t(1) << (6 + random.below(18)));
    }
}

Field fieldOf(std::vector<double> values) {
    return {"f", FieldLocation::point, 1, std::move(values)};
}

std::uint32_t bitsOf(float value) {
    return std::bit_cast<std::uint32_t>(value);
}

TEST(ChannelCoding, R32fGivesFloatsBackBitForBit) {
    constexpr double kMost = std::numeric_limits<float>::max();
    const std::vector<std::vector<double>> fields{{1, -2.5, 0.1f, 3e7, 0},
                                                  {kMost, -kMost, 1e38f, -1.0, 1e-3f},
                                                  {0x1p-149, 0x1.8p-148, -0x1p-126, 0},  // denormal
                                                  {1e30f, 1.0000001e30f},
                                                  {-5, -3, -4.0000005f},
                                                  {0x1p-126, 0x1.fffffep-127, 1e-30f},
                                                  {0, 0}};
    for (const auto& values : fields) {
        const Field field = fieldOf(values);
        const ChannelCoding coding(field, 0, SampleFormat::r32f);
        for (const double value : values) {
            const auto code = float(coding.encode(value));
            EXPECT_TRUE(code == 0 || std::isnormal(code)) << value;
            EXPECT_LT(std::fabs(code), 0x1p62f) << "room for sums";
            EXPECT_EQ(bitsOf(coding.decode(code)), bitsOf(float(value))) << value;
        }
    }
}

TEST(ChannelCoding, FieldsFarBelowFloatsHaveFiniteCodes) {
    for (const double size : {1e-46, 1e-60, 1e-300, 5e-324}) {
        const Field field = fieldOf({size, -size, 0});
        const ChannelCoding coding(field, 0, SampleFormat::r32f);
        for (const double value : field.values) {
            EXPECT_TRUE(std::isfinite(coding.encode(value))) << size;
            EXPECT_EQ(coding.decode(float(coding.encode(value))), 0.0f) << size;
        }
        EXPECT_TRUE(std::isfinite(coding.scale()) && std::isfinite(coding.offset()));
    }
}

TEST(ChannelCoding, R32fGivesRandomFloatsOfSixtyBinadesBackBitForBit) {
    Random random(9);
    std::vector<double> values;
    for (int i = 0; i < 2000; ++i)
        values.push_back(double(float(std::ldexp(random.centred(), random.below(60) - 30))));
    const Field field = fieldOf(values);
    const ChannelCoding coding(field, 0, SampleFormat::r32f);
    for (const double value : values)
        EXPECT_EQ(bitsOf(coding.decode(float(coding.encode(value)))), bitsOf(float(value)));
}

TEST(RasterRegions, ACutKeepsEachWantedPointOnce) {
    const std::vector<IndexBox> boxes{{{0, 0, 0}, {65, 64, 64}}, {{60, 0, 0}, {130, 20, 64}}};
    for (const std::int64_t pieces : {1, 2, 3, 8, 100, 1 << 20}) {
        std::vector<RasterRegion> regions;
        for (RasterRegion& region : planRasterRegions(boxes, 1 << 24))
            cutRegion(std::move(region), pieces, regions);
        std::vector<std::int64_t> points(boxes.size());
        for (std::size_t r = 0; r < regions.size(); ++r) {
            for (std::size_t other = 0; other < r; ++other)
                EXPECT_TRUE(intersect(regions[r].points, regions[other].points).empty());
            for (const RasterRegion::Part& part : regions[r].parts) {
                EXPECT_EQ(intersect(part.points, regions[r].points), part.points);
                points[part.box] += part.points.count();
            }
            const Vec3i size = regions[r].points.size();
            EXPECT_GE(std::min({size.x, size.y, size.z}), kShortestEdge);
            if (pieces == 1 << 20) {
                EXPECT_LT(std::max({size.x, size.y, size.z}), 2 * kShortestEdge);
            }
        }
        for (std::size_t b = 0; b < boxes.size(); ++b) EXPECT_EQ(points[b], boxes[b].count());
    }
}

TEST(RasterBudget, WhatIsSharedOutStaysWithinTheBound) {
    for (const int channels : {0, 1, 3, 4, 5, 9, 40})
        for (const std::int64_t more : {0, 100, 3000}) {
            const WorkMemory memory = rasterWorkMemory(channels);
            const std::int64_t bytes = memory.least + (more << 20);
            const RasterBudget budget = shareOut(bytes, channels);
            const std::int64_t passes = std::max(1, (channels + 3) / 4), code = channels > 1 ? 16 : 4;
            const std::int64_t records =
                std::int64_t(sizeof(SliceElement) + sizeof(EasyGeometry)) + 32 * std::max(1, channels);
            // A target with its depths, images of two regions; records of two regions.
            EXPECT_LE(budget.regionPoints * (code + 4 + 2 * passes * code) +
                          budget.regionElements * 2 * records + budget.queueBytes,
                      bytes);
            EXPECT_GE(budget.regionPoints, kShortestEdge * kShortestEdge * kShortestEdge);
            EXPECT_GT(budget.regionElements, 1000);
        }
    EXPECT_EQ(shareOut(1, 3).regionPoints, shareOut(rasterWorkMemory(3).least, 3).regionPoints);
    EXPECT_EQ(shareOut(0, 3).regionPoints, shareOut(rasterWorkMemory(3).most, 3).regionPoints);
}

TEST(QueueRoom, WaitsUntilThereIsRoom) {
    QueueRoom room(100);
    // What is larger than all the room gets in alone.
    std::shared_ptr<const void> large = room.take(1000);
    std::atomic<bool> isIn = false;
    std::thread waiting([&] {
        const auto small = room.take(60), other = room.take(40);
        isIn = true;
    });
    EXPECT_FALSE(isIn);
    std::shared_ptr<const void> copy = large;
    large.reset();
    EXPECT_FALSE(isIn);
    copy.reset();
    waiting.join();
    EXPECT_TRUE(isIn);
}

TEST(ChannelCoding, NormalisedFormatsAreWithinHalfAStepAndTheFieldsRange) {
    struct Steps {
        SampleFormat format;
        double levels;
    };
    for (const auto& [format, levels] : {Steps{SampleFormat::r8, 255}, Steps{SampleFormat::r16, 65535}})
        for (const auto& [low, high] :
             {std::pair(0.0, 1.0), std::pair(-1e30, 1e30), std::pair(1e5, 1e5 + 1), std::pair(-7.0, -6.5),
              std::pair(-3.4e38, 3.4e38), std::pair(1e-40, 2e-38)}) {
            const double lowest = double(float(low)), highest = double(float(high));
            const Field field = fieldOf({highest, lowest, std::nan(""), INFINITY, -1e300});
            const ChannelCoding coding(field, 0, format);
            const double step = (highest - lowest) / levels;
            for (int i = 0; i <= 1000; ++i) {
                const double value = lowest + (highest - lowest) * (i / 1000.0);
                const double code = coding.encode(value);
                EXPECT_GE(code, 0);
                EXPECT_LE(code, 1);
                const float back = coding.decode(float(std::round(code * levels) / levels));
                // Half a step, and the rounding of code and result to float.
                const double rounding = (highest - lowest) * 0x1p-24 +
                                        std::max(std::fabs(lowest), std::fabs(highest)) * 0x1p-24 + 0x1p-149;
                EXPECT_NEAR(double(back), value, 0.5 * step + rounding);
                EXPECT_GE(double(back), lowest);
                EXPECT_LE(double(back), highest);
            }
            EXPECT_EQ(coding.decode(0), float(lowest));
            EXPECT_EQ(coding.decode(1), float(highest));
        }
}

TEST(ChannelCoding, AFieldOfOneValueOrOfNoneHasNoRange) {
    for (const SampleFormat format :
         {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8}) {
        const Field constant = fieldOf({0.1, 0.1, std::nan("")});
        const ChannelCoding coding(constant, 0, format);
        EXPECT_EQ(coding.decode(float(coding.encode(double(0.1f)))), 0.1f);
        const Field nothing = fieldOf({std::nan(""), INFINITY, 1e39});
        EXPECT_TRUE(std::isfinite(ChannelCoding(nothing, 0, format).decode(0.5f)));
        const Field empty = fieldOf({});
        EXPECT_TRUE(std::isfinite(ChannelCoding(empty, 0, format).decode(0.5f)));
    }
}

TEST(ChannelCoding, MarksAreNoCodes) {
    for (const SampleFormat format : {SampleFormat::r32f, SampleFormat::r16f}) {
        const SampleMarks marks = sampleMarks(format);
        EXPECT_NE(marks.uncovered, marks.invalid);
        EXPECT_LE(marks.invalidFrom, marks.invalid);
        const Field field = fieldOf({-3.4e38, 3.4e38, 1e-30});
        const ChannelCoding coding(field, 0, format);
        for (const double value : field.values) {
            EXPECT_GT(coding.encode(value), double(marks.uncovered));
            EXPECT_LT(coding.encode(value), double(marks.invalidFrom));
        }
    }
}

}  // namespace
}  // namespace tessera
