#include "pictures/image.h"

#include <gtest/gtest.h>
#include <png.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "base/text.h"
#include "pictures/bitmap_font.h"
#include "pictures/sample_slice.h"
#include "tessera/error.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

// CIE L* of an sRGB colour.
double lightness(const Rgb& colour) {
    const auto linear = [](std::uint8_t v) {
        const double s = v / 255.0;
        return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    };
    const double y = 0.2126 * linear(colour.r) + 0.7152 * linear(colour.g) + 0.0722 * linear(colour.b);
    return y > 0.008856 ? 116 * std::cbrt(y) - 16 : 903.3 * y;
}

Rgb pixelAt(const RgbImage& image, int x, int y) {
    const std::uint8_t* p =
        image.rgb.data() + (std::size_t(y) * std::size_t(image.width) + std::size_t(x)) * 3;
    return {p[0], p[1], p[2]};
}

std::int64_t countColour(const RgbImage& image, const Rgb& colour) {
    std::int64_t count = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) count += pixelAt(image, x, y) == colour;
    return count;
}

TEST(ColourMap, LightnessRisesEvenly) {
    for (int i = 0; i <= 100; ++i)
        EXPECT_NEAR(lightness(mapColour(i / 100.0)), 15 + 75 * i / 100.0, 0.8) << i;
}

TEST(ColourMap, ValuesOutsideTakeTheEnds) {
    EXPECT_EQ(mapColour(-3), mapColour(0));
    EXPECT_EQ(mapColour(7), mapColour(1));
    EXPECT_EQ(mapColour(std::numeric_limits<double>::quiet_NaN()), mapColour(0));
    EXPECT_FALSE(mapColour(0) == mapColour(1));
}

TEST(BitmapFont, PrintableCharactersOfNumbersAndNamesDiffer) {
    const std::string text =
        "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz.,-+:/()[]=%_*<>|'\"#";
    const auto unknown = glyphRows(U'\u03c1');
    for (std::size_t i = 0; i < text.size(); ++i) {
        EXPECT_NE(glyphRows(char32_t(text[i])), unknown) << text[i];
        for (std::size_t j = 0; j < i; ++j)
            EXPECT_NE(glyphRows(char32_t(text[i])), glyphRows(char32_t(text[j]))) << text[i] << text[j];
    }
}

TEST(BitmapFont, Utf8CountsCharacters) {
    EXPECT_EQ(decodeUtf8("a\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80"),
              (std::vector<char32_t>{'a', 0xe4, 0x20ac, 0x1f600}));
    EXPECT_EQ(decodeUtf8("\xff\x80z\xc3").size(), 4u);
}

// 20 x 10 pixels: value x, the first column without value, the second not finite.
ScalarImage ramp() {
    ScalarImage image{20, 10, {}, {}, {}};
    for (int y = 0; y < 10; ++y)
        for (int x = 0; x < 20; ++x) {
            image.values.push_back(x == 1 ? std::numeric_limits<float>::quiet_NaN() : float(x));
            image.coverage.push_back(x != 0);
        }
    return image;
}

TEST(Picture, PixelsCarryTheColoursOfTheirValues) {
    PictureOptions options;
    options.title = "ramp";
    options.magnify = 7;
    const RgbImage picture = drawPicture(ramp(), options);
    // The picture's left edge: where the first pixel of the largest value's column is, 19 columns before.
    int left = -1, top = -1;
    for (int y = 0; y < picture.height && left < 0; ++y)
        for (int x = 0; x < picture.width && left < 0; ++x) {
            if (pixelAt(picture, x, y) == mapColour(1) && x >= 19 * 7 &&
                pixelAt(picture, x + 6, y) == mapColour(1))
                left = x - 19 * 7, top = y;
        }
    ASSERT_GE(left, 0);
    for (int x = 2; x < 20; ++x)
        for (int y = 0; y < 10; ++y) {
            EXPECT_EQ(pixelAt(picture, left + x * 7 + 3, top + y * 7 + 3), mapColour((x - 2) / 17.0))
                << x << ' ' << y;
        }
    for (int x = 0; x < 2; ++x) {
        const Rgb empty = pixelAt(picture, left + x * 7 + 3, top + 3);
        EXPECT_TRUE(empty.r == empty.g && empty.g == empty.b) << "no value shows as grey";
    }
}

TEST(Picture, RangeOfTheCallerHolds) {
    ScalarImage image{4, 4, std::vector<float>(16, 5.0f), std::vector<std::uint8_t>(16, 1), {}};
    PictureOptions options;
    options.min = 0;
    options.max = 10;
    // 127 or 128 of 255: the middle of the map.
    EXPECT_GE(countColour(drawPicture(image, options), mapColour(0.5)), 16);
}

TEST(Picture, ConstantEmptyAndOddPicturesCanBeDrawn) {
    ScalarImage constant{3, 2, std::vector<float>(6, -1.5f), std::vector<std::uint8_t>(6, 1), {}};
    EXPECT_GT(drawPicture(constant, {}).width, 3);
    ScalarImage empty{3, 2, std::vector<float>(6, 0.0f), std::vector<std::uint8_t>(6, 0), {}};
    EXPECT_GT(drawPicture(empty, {}).width, 3);
    ScalarImage huge{1, 1, {std::numeric_limits<float>::max()}, {1}, {1}};
    PictureOptions options;
    options.title = "a title much longer than the picture is wide";
    EXPECT_GT(drawPicture(huge, options).width, 44 * 12);
}

TEST(Picture, MarksStandWhereTheyAreAndNotUponEachOther) {
    RgbImage picture = overGround({40, 30, std::vector<Rgba>(40 * 30)}, {0, 0, 0});
    PictureMarks marks;
    marks.boxes.push_back({2, 25, 10, 3, {1, 0, 0}});
    const auto words = [](double x, const std::array<double, 2>& direction, const MarkColor& color) {
        return PictureWords{"I", {x, 10}, direction, color};
    };
    marks.words = {words(20, {1, 0}, {0, 1, 0}), words(22, {1, 0}, {0, 0, 1}), words(14, {-1, 0}, {1, 1, 0})};
    putMarks(picture, marks, {0, 0, 0});
    const auto at = [&](int x, int y) {
        const std::uint8_t* p = picture.rgb.data() + 3 * (y * 40 + x);
        return Rgb{p[0], p[1], p[2]};
    };
    int red = 0, green = 0, blue = 0, yellow = 0;
    for (int y = 0; y < 30; ++y)
        for (int x = 0; x < 40; ++x) {
            red += at(x, y) == Rgb{255, 0, 0};
            const bool isGreen = at(x, y) == Rgb{0, 255, 0}, isYellow = at(x, y) == Rgb{255, 255, 0};
            green += isGreen, yellow += isYellow;
            blue += at(x, y) == Rgb{0, 0, 255};
            // To the right of its place, and to the left of it.
            if (isGreen) {
                EXPECT_GE(x, 20);
            }
            if (isYellow) {
                EXPECT_LT(x, 14);
            }
        }
    EXPECT_EQ(red, 30);
    EXPECT_EQ(at(2, 25), (Rgb{255, 0, 0}));
    EXPECT_EQ(at(11, 27), (Rgb{255, 0, 0}));
    EXPECT_EQ(green, 3 + 5 + 3);
    EXPECT_EQ(yellow, green);
    EXPECT_EQ(blue, 0) << "it would lie on the first";
}

TEST(Picture, PngReadsBackAndFailsCleanly) {
    std::string pattern = (fs::temp_directory_path() / "tessera_png_XXXXXX").string();
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    const std::string path = pattern + "/out.png";
    const RgbImage picture = drawPicture(ramp(), {});
    writePng(path, picture);
    png_image read;
    std::memset(&read, 0, sizeof read);
    read.version = PNG_IMAGE_VERSION;
    ASSERT_TRUE(png_image_begin_read_from_file(&read, path.c_str()));
    read.format = PNG_FORMAT_RGB;
    ASSERT_EQ(int(read.width), picture.width);
    ASSERT_EQ(int(read.height), picture.height);
    std::vector<std::uint8_t> bytes(PNG_IMAGE_SIZE(read));
    ASSERT_TRUE(png_image_finish_read(&read, nullptr, bytes.data(), 0, nullptr));
    EXPECT_TRUE(bytes == picture.rgb);
    EXPECT_THROW(writePng(pattern + "/missing/out.png", picture), IoError);
    fs::remove_all(pattern);
}

// Two bricks of different levels in a box mesh with a linear field.
struct SliceCase {
    TetMesh mesh;
    BrickTree tree{{-1, 0, 0},
                   0.125,
                   8,
                   {{1, {0, 0, 0}}, {0, {2, 0, 0}}, {0, {2, 1, 0}}, {0, {2, 0, 1}}, {0, {2, 1, 1}}}};
    BrickStore store{8, tree.leafCount(), 1};
    std::vector<int> fields{0};
    static double f(const Vec3d& p) { return 3 * p.x - 2 * p.y + p.z; }
    SliceCase() {
        for (int i = 0; i < 8; ++i)
            mesh.points.push_back(
                glm::mix(Vec3d(-0.9, 0.1, 0.1), Vec3d(1.9, 1.8, 1.8), Vec3d(i & 1, i >> 1 & 1, i >> 2)));
        for (const auto& [a, b] : {std::pair{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}})
            mesh.tets.push_back({0, a, b, 7});
        Field field{"f", FieldLocation::point, 1, {}};
        for (const Vec3d& p : mesh.points) field.values.push_back(f(p));
        mesh.fields.push_back(field);
        for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) fill(leaf);
    }
    void fill(std::size_t leaf) {
        const BrickKey& key = tree.leaves()[leaf];
        Tile& tile = store.ensureTile(leaf, 0);
        for (int i = 0; i < kTilePoints; ++i) {
            const Vec3d p = tree.lattice(key.level).worldFromIndex(
                Vec3d(tree.ownedPoints(key).min + Vec3i(i >> 6, i >> 3 & 7, i & 7)));
            const bool in = p.x >= -0.9 && p.x <= 1.9 && p.y >= 0.1 && p.y <= 1.8 && p.z >= 0.1 && p.z <= 1.8;
            if (!in) continue;
            tile.coverage[std::size_t(i >> 6)] |= std::uint64_t(1) << (i & 63);
            tile.values[std::size_t(i)] = float(f(p));
        }
    }
};

TEST(Slice, ShowsTheFieldWithItsFirstAxisToTheRightAndTheSecondUp) {
    SliceCase scene;
    const NearestOnDemand nearest(scene.mesh, 1);
    const Reconstruction reconstruction(scene.mesh, scene.fields, scene.tree, scene.store, nearest);
    for (int axis = 0; axis < 3; ++axis) {
        SliceOptions options;
        options.axis = axis;
        options.positionWorld = 0.7;
        options.pixels = 120;
        options.boundsWorld = {{-1, 0, 0}, {2, 2, 2}};
        const ScalarImage image = sampleSlice(scene.tree, reconstruction, 0, options, {});
        const int right = axis == 0 ? 1 : 0, up = axis == 2 ? 1 : 2;
        const double pixel = (axis == 0 ? 2.0 : 3.0) / 120;
        EXPECT_EQ(image.width, 120);
        EXPECT_EQ(image.height, axis == 0 ? 120 : 80);
        int covered = 0;
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x) {
                Vec3d p(0.7);
                p[right] = options.boundsWorld.min[right] + (x + 0.5) * pixel;
                p[up] = (image.height - 1 - y + 0.5) * pixel;
                if (p.x > 1) continue;  // no bricks there
                const bool deep = p.x > -0.6 && p.x < 0.9 && p.y > 0.4 && p.y < 1.5 && p.z > 0.4 && p.z < 1.5;
                if (!deep) continue;
                ASSERT_TRUE(image.coverage[image.offset(x, y)]) << x << ' ' << y;
                ASSERT_NEAR(double(image.values[image.offset(x, y)]), SliceCase::f(p), 1e-5) << x << ' ' << y;
                ++covered;
            }
        EXPECT_GT(covered, 1000);
        EXPECT_FALSE(image.coverage[image.offset(0, 0)]) << "the corner is outside the mesh";
    }
}

TEST(Slice, OutlinesFollowTheBricks) {
    SliceCase scene;
    const NearestOnDemand nearest(scene.mesh, 1);
    const Reconstruction reconstruction(scene.mesh, scene.fields, scene.tree, scene.store, nearest);
    SliceOptions options;
    options.positionWorld = 0.7;
    options.pixels = 96;
    options.outlines = true;
    const ScalarImage image = sampleSlice(scene.tree, reconstruction, 0, options, {});
    // Bricks begin at x = 1 of the range [-1, 2], and at y = 1 of [0, 2].
    ASSERT_EQ(image.width, 96);
    ASSERT_EQ(image.height, 64);
    EXPECT_TRUE(image.outlines[image.offset(64, 10)]);
    EXPECT_FALSE(image.outlines[image.offset(63, 10)]);
    EXPECT_TRUE(image.outlines[image.offset(80, 32)]);
    EXPECT_FALSE(image.outlines[image.offset(20, 32)]) << "the coarse brick is whole";
}

TEST(Slice, OptionsOutOfRangeAreRefused) {
    SliceCase scene;
    const NearestOnDemand nearest(scene.mesh, 1);
    const Reconstruction reconstruction(scene.mesh, scene.fields, scene.tree, scene.store, nearest);
    SliceOptions options;
    options.axis = 3;
    EXPECT_THROW(sampleSlice(scene.tree, reconstruction, 0, options, {}), InputError);
    options.axis = 0;
    options.pixels = 0;
    EXPECT_THROW(sampleSlice(scene.tree, reconstruction, 0, options, {}), InputError);
}

}  // namespace
}  // namespace tessera
