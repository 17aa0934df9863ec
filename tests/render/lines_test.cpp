#include "render/picture_lines.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "brick_test_meshes.h"
#include "pictured.h"
#include "render/effects/axes.h"
#include "render/effects/outline.h"
#include "render/effects/scale_bar.h"

namespace tessera {
namespace {

/// An effect that draws these.
Effect linesEffect(std::vector<LineSegment> segments) {
    Effect effect;
    effect.name = "lines";
    effect.lines = [segments](const LineView&) { return PictureLines{segments, {}}; };
    return effect;
}

/// How much of a pixel's ray a line of a width covers, and how far along the ray it is.
std::pair<double, double> coverOf(const LineSegment& line, const Camera& camera, int x, int y) {
    const CameraView view = viewOf(camera);
    const auto inView = [&](const Vec3d& p) {
        const Vec3d d = p - camera.eyeWorld;
        return Vec3d(glm::dot(d, view.right), glm::dot(d, view.up), glm::dot(d, view.forward));
    };
    Vec3d from = inView(line.fromWorld), to = inView(line.toWorld);
    if (to.z < from.z) std::swap(from, to);
    if (to.z <= 0) return {0, 0};
    if (from.z < 1e-4) from = glm::mix(from, to, (1e-4 - from.z) / (to.z - from.z));
    const auto pixels = [&](const Vec3d& p) {
        const double away = view.isParallel ? 1 : p.z;
        return Vec3d((p.x / away / view.wide + 1) / 2 * camera.widthPixels,
                     (1 - p.y / away / view.high) / 2 * camera.heightPixels, 0);
    };
    const Vec3d a = pixels(from), b = pixels(to), p(x + 0.5, y + 0.5, 0);
    const double share = std::clamp(glm::dot(p - a, b - a) / glm::dot(b - a, b - a), 0.0, 1.0);
    const double apart = glm::length(p - glm::mix(a, b, share));
    const double covered = std::clamp(line.widthPixels / 2 + 0.5 - apart, 0.0, 1.0);
    const double deep =
        view.isParallel ? glm::mix(from.z, to.z, share) : 1 / glm::mix(1 / from.z, 1 / to.z, share);
    return {covered, deep / glm::dot(view.rayOf(camera, x, y).direction, view.forward)};
}

/// A cube over several depths, an even medium.
class Lines : public testing::Test {
  protected:
    void SetUp() override {
        TESSERA_NEEDS_GL(kPlatform);
        const auto one = [](const Vec3d&) { return 1.0; };
        pictured.emplace(gridMesh({3, 3, 3}, Vec3d(0), Vec3d(1)), one, pointFocus({0.3, 0.4, 0.6}, 0.05));
        ASSERT_GE(pictured->depths(), 3);
        options.camera = lookAt({3, -2, 2.5}, Vec3d(0.5), 96);
        options.channel = 1;
        options.function = even(0.3);
        options.layerWorld = 0.3;
        for (int a = 0; a < 3; ++a) {
            Vec3d axis(0);
            axis[a] = 1;
            options.within.push_back({axis, 0});
            options.within.push_back({-axis, -1});
        }
    }

    std::optional<Pictured> pictured;
    RenderOptions options;
};

TEST_F(Lines, StandInTheVolumeWhereTheyAre) {
    const LineSegment line{{-0.3, 0.2, 0.1}, {1.4, 0.9, 0.8}, {0.2, 0.4, 1}, 3};
    options.effects = {linesEffect({line})};
    const int n = 96;
    Camera parallel = lookAt({3, -2, 2.5}, Vec3d(0.5), n);
    parallel.heightWorld = 2.2;
    Camera parallelInside = lookAt({0.3, 0.35, 0.3}, {1, 0.2, 0.9}, n);
    parallelInside.heightWorld = 1.2;
    const Camera far = lookAt({-60, 90, 50}, Vec3d(0.5), n, 1);
    int before = 0;
    for (const Camera& camera : {lookAt({3, -2, 2.5}, Vec3d(0.5), n, 40), parallel,
                                 lookAt({0.3, 0.35, 0.3}, {1, 0.6, 0.7}, n, 80), parallelInside, far}) {
        options.camera = camera;
        const RgbaImage image = pictured->draw(options);
        const CameraView view = viewOf(camera);
        double worst = 0;
        int inside = 0, partly = 0;
        for (int y = 0; y < n; ++y)
            for (int x = 0; x < n; ++x) {
                const ViewRay ray = view.rayOf(camera, x, y);
                double begin = 0, end = 1e9;
                for (int a = 0; a < 3; ++a) {
                    const double low = -ray.originWorld[a] / ray.direction[a],
                                 high = (1 - ray.originWorld[a]) / ray.direction[a];
                    begin = std::max(begin, std::min(low, high));
                    end = std::min(end, std::max(low, high));
                }
                end = std::max(begin, end);
                const auto [covered, away] = coverOf(line, camera, x, y);
                const double at = std::clamp(away, begin, end);
                const auto passed = [&](double length) { return std::pow(0.7, length / options.layerWorld); };
                const double toLine = passed(at - begin), behind = passed(end - at);
                // Green: half of what the volume stops, and of the line.
                const double green = 0.5 * (1 - toLine) + toLine * covered * line.color[1] +
                                     toLine * (1 - covered) * 0.5 * (1 - behind);
                const double clear = toLine * (1 - covered) * behind;
                worst = std::max({worst, std::abs(double(image.at(x, y)[1]) - green),
                                  std::abs(double(image.at(x, y)[3]) - (1 - clear))});
                inside += covered == 1 && at > begin && at < end;
                before += covered == 1 && !(at > begin && at < end);
                partly += covered > 0 && covered < 1;
            }
        EXPECT_LT(worst, 1.0 / 255);
        EXPECT_GT(inside, 40);
        EXPECT_GT(partly, 40);
    }
    EXPECT_GT(before, 40);
}

TEST_F(Lines, ThatCrossShowTheNearerOne) {
    options.function = even(0);
    const Vec3d middle(0.5), away = viewOf(options.camera).forward, right = viewOf(options.camera).right,
                             up = viewOf(options.camera).up;
    const LineSegment near{
        middle - 0.3 * right - 0.1 * away, middle + 0.3 * right - 0.1 * away, {1, 0, 0}, 4};
    const LineSegment far{middle - 0.3 * up, middle + 0.3 * up, {0, 1, 0}, 4};
    options.effects = {linesEffect({near, far})};
    const RgbaImage image = pictured->draw(options);
    const int m = options.camera.widthPixels / 2;
    EXPECT_EQ(image.at(m, m), (Rgba{1, 0, 0, 1}));
    EXPECT_EQ(image.at(m, m - 5), (Rgba{0, 1, 0, 1}));
    options.effects = {linesEffect({far}), linesEffect({near})};
    EXPECT_EQ(pictured->draw(options).pixels, image.pixels);
    // A bend has no notch.
    const LineSegment on{near.toWorld, near.toWorld + 0.3 * up, near.color, 4};
    options.effects = {linesEffect({near, on})};
    const RgbaImage bent = pictured->draw(options);
    for (int y = m; y < options.camera.heightPixels; ++y)
        for (int x = 0; x < options.camera.widthPixels; ++x)
            EXPECT_GE(bent.at(x, y)[3], image.at(x, y)[3] - image.at(x, y)[1]);
    // What is clipped ends at the clip.
    LineSegment clipped = near;
    clipped.isClipped = true;
    options.within = {{right, glm::dot(right, middle)}};
    options.effects = {linesEffect({clipped})};
    const RgbaImage cut = pictured->draw(options);
    EXPECT_EQ(cut.at(m + 6, m)[3], 1);
    EXPECT_EQ(cut.at(m - 6, m)[3], 0);
}

TEST_F(Lines, MayCountAsNearer) {
    options.function = even(1);
    options.camera = {{0.5, -2, 0.5}, {0, 1, 0}, {0, 0, 1}, 35, 33, 33};
    LineSegment line{{-0.5, 0.1, 0.5}, {1.5, 0.1, 0.5}, {0, 0, 1}, 5};
    const auto blueInTheMiddle = [&] {
        options.effects = {linesEffect({line})};
        return pictured->draw(options).at(16, 16)[2];
    };
    // The volume's blue is a quarter.
    EXPECT_NEAR(blueInTheMiddle(), 0.25, 1e-6);
    line.nearerWorld = 0.11;
    EXPECT_NEAR(blueInTheMiddle(), 1, 1e-6);
    options.camera.heightWorld = 1.5;
    EXPECT_NEAR(blueInTheMiddle(), 1, 1e-6);
    line.nearerWorld = 0.09;
    EXPECT_NEAR(blueInTheMiddle(), 0.25, 1e-6);
}

TEST_F(Lines, OfAnOutlineStandWhereTheMeshBends) {
    options.function = even(0);
    options.camera.widthPixels = options.camera.heightPixels = 192;
    options.effects = {outlineEffect(pictured->mesh, {.widthPixels = 3, .color = {1, 0, 0}})};
    const RgbaImage image = pictured->draw(options);
    const CameraView view = viewOf(options.camera);
    const auto redAt = [&](const Vec3d& p) {
        const Vec3d d = p - options.camera.eyeWorld;
        const double away = glm::dot(d, view.forward);
        return image.at(int(96 * (1 + glm::dot(d, view.right) / away / view.wide)),
                        int(96 * (1 - glm::dot(d, view.up) / away / view.high)))[0];
    };
    for (double t = 0.05; t < 1; t += 0.05)
        for (int n = 0; n < 12; ++n) {
            Vec3d p(t, n % 2, n / 2 % 2);
            for (int turn = n / 4; turn > 0; --turn) p = Vec3d(p.z, p.x, p.y);
            EXPECT_GT(redAt(p), 0.99f) << p.x << " " << p.y << " " << p.z;
        }
    const auto redPixels = [](const RgbaImage& of) {
        return std::ranges::count_if(of.pixels, [](const Rgba& pixel) { return pixel[0] > 0; });
    };
    options.effects = {
        outlineEffect(pictured->mesh, {.widthPixels = 3, .color = {1, 0, 0}, .leastDegrees = 0})};
    EXPECT_LT(2 * redPixels(image), redPixels(pictured->draw(options))) << "sides have edges too";
}

TEST_F(Lines, OfAPictureInPartsAreThoseOfItsRays) {
    options.effects = {linesEffect({{Vec3d(0.1), Vec3d(0.9), {0, 0, 1}, 2.5}})};
    options.camera.widthPixels = 600, options.camera.heightPixels = 40;
    options.camera.heightWorld = 0.15;
    options.samplesAPixel = 4;
    const RgbaImage image = pictured->draw(options);
    options.samplesAPixel = 1;
    options.camera.widthPixels *= 2, options.camera.heightPixels *= 2;
    options.effects = {linesEffect({{Vec3d(0.1), Vec3d(0.9), {0, 0, 1}, 5}})};
    const RgbaImage rays = pictured->draw(options);
    double worst = 0, most = 0;
    for (int y = 0; y < 40; ++y)
        for (int x = 0; x < 600; ++x)
            for (std::size_t c = 0; c < 4; ++c) {
                const double mean =
                    0.25 * (double(rays.at(2 * x, 2 * y)[c]) + double(rays.at(2 * x + 1, 2 * y)[c]) +
                            double(rays.at(2 * x, 2 * y + 1)[c]) + double(rays.at(2 * x + 1, 2 * y + 1)[c]));
                worst = std::max(worst, std::abs(mean - double(image.at(x, y)[c])));
                most = std::max(most, mean);
            }
    EXPECT_LT(worst, 1e-5);
    EXPECT_GT(most, 0.9);
}

TEST_F(Lines, AxesHaveRoundNumbersAtTheOutline) {
    // From the front: x to the right, z up.
    options.camera = {{0.5, -4, 0.5}, {0, 1, 0}, {0, 0, 1}, 35, 400, 400, 2};
    options.boundsWorld = {{0.03, 0, -0.4}, {0.93, 1, 0.4}};
    const PictureLines lines =
        linesOf(std::vector{axesEffect({.unit = "m"})}, {options.camera, options.boundsWorld});
    std::vector<std::string> texts;
    for (const PictureWords& words : lines.marks.words) texts.push_back(words.text);
    EXPECT_EQ(texts, (std::vector<std::string>{"0.2", "0.4", "0.6", "0.8", "x [m]", "-0.4", "-0.2", "0",
                                               "0.2", "0.4", "z [m]"}));
    EXPECT_EQ(lines.segments.size(), 12u + 4 + 5);
    // A tick's number stands below the x axis, at its value.
    const PictureWords& number = lines.marks.words[1];
    EXPECT_NEAR(number.placePixels[0], 180, 1e-6);
    EXPECT_GT(number.placePixels[1], 380);
    EXPECT_NEAR(number.direction[1], 1, 1e-6);
    const PictureWords& high = lines.marks.words[9];
    EXPECT_NEAR(high.placePixels[1], 220, 1e-6);
    EXPECT_LT(high.placePixels[0], 106);
    // Askew all three have some, and none within the outline of the box.
    options.camera = lookAt({3, -2, 2.5}, {0.5, 0.5, 0}, 400);
    const PictureLines askew = linesOf(std::vector{axesEffect({})}, {options.camera, options.boundsWorld});
    for (const char* name : {"x", "y", "z"})
        EXPECT_EQ(std::ranges::count(askew.marks.words, name, &PictureWords::text), 1);
    // Of axes that are level in the picture the lower edge has them, though some edge may look upright.
    int level = 0;
    for (int n = 0; n < 72; ++n) {
        const double angle = n * std::numbers::pi / 36;
        const Vec3d middle(0.48, 0.5, 0);
        options.camera = lookAt(middle + 3.0 * Vec3d(std::cos(angle), std::sin(angle), 0.3), middle, 400);
        const CameraView view = viewOf(options.camera);
        const PictureLines turned =
            linesOf(std::vector{axesEffect({})}, {options.camera, options.boundsWorld});
        for (const PictureWords& words : turned.marks.words)
            for (int axis = 0; axis < 2; ++axis) {
                if (words.text != (axis == 0 ? "x" : "y")) continue;
                if (std::abs(view.right[axis]) < 1.5 * std::abs(view.up[axis])) continue;
                EXPECT_GT(words.placePixels[1], 200) << n;
                ++level;
            }
    }
    EXPECT_GT(level, 72);
    // From inside there is the box alone.
    options.camera = lookAt({0.5, 0.5, 0}, {1, 1, 0.3}, 400, 80);
    const PictureLines inside = linesOf(std::vector{axesEffect({})}, {options.camera, options.boundsWorld});
    EXPECT_EQ(inside.segments.size(), 12u);
    EXPECT_TRUE(inside.marks.words.empty());
}

TEST_F(Lines, AScaleBarIsAsLongAsItSays) {
    const Box3d box{Vec3d(0), Vec3d(1)};
    options.camera = {{0.5, -4, 0.5}, {0, 1, 0}, {0, 0, 1}, 35, 400, 300, 2};
    const auto barOf = [&] {
        return linesOf(std::vector{scaleBarEffect({.unit = "mm"})}, {options.camera, box}).marks;
    };
    // 150 pixels to a unit, and a quarter of the picture at most: 100 pixels.
    ASSERT_EQ(barOf().boxes.size(), 3u);
    EXPECT_NEAR(barOf().boxes[0].widthPixels, 75, 1e-9);
    EXPECT_EQ(barOf().words[0].text, "0.5 mm");
    options.camera.heightWorld = 0;
    const double pixel = 2 * 4.5 * std::tan(17.5 * std::numbers::pi / 180) / 300;
    EXPECT_NEAR(barOf().boxes[0].widthPixels, 0.5 / pixel, 1e-9);
    options.camera.eyeWorld.y = 3;
    EXPECT_TRUE(barOf().boxes.empty()) << "the data is behind the eye";
}

}  // namespace
}  // namespace tessera
