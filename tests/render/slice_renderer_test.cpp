#include "render/slice_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <random>

#include "pictured.h"
#include "refine/camera_view.h"
#include "render/visibility_order.h"
#include "schedule/random_schedule.h"
#include "tessera/error.h"

namespace tessera {
namespace {

/// Everything a little, with colours all along.
TransferFunction thin() {
    return stops({{-1, {0.1, 0.1, 0.8}, 0.02}, {0, {0.2, 0.9, 0.3}, 0.1}, {1, {1, 0.3, 0.1}, 0.3}});
}
/// A shell that hides what is behind it.
TransferFunction opaque() {
    return stops(
        {{0.30, {0, 0, 1}, 0}, {0.36, {1, 0.8, 0.2}, 1}, {0.42, {1, 0, 0}, 0.9}, {0.48, {1, 1, 1}, 0}});
}

int pixelsAsked() {
    return asked("TESSERA_PICTURE_PIXELS", 96);
}

struct PictureCase {
    const char* name;
    Camera camera;
    TransferFunction function;
    bool isShell = false;  ///< the field of radii
    std::vector<HalfSpace> within{};
    SampleFormat format = SampleFormat::r32f;
    double slicesAVoxel = 4;
};
void PrintTo(const PictureCase& scene, std::ostream* to) {
    *to << scene.name;
}

std::vector<PictureCase> cases() {
    const int n = pixelsAsked();
    const Vec3d middle(0), far(5, -7, 4), near(1.1, -1.2, 0.7), inside(0.25, -0.2, 0.15);
    Camera parallel = lookAt({3, 2, 4}, middle, n);
    parallel.heightWorld = 2.4;
    Camera parallelInside = lookAt({0.1, 0.1, 0.2}, {-1, -0.4, 0.1}, n);
    parallelInside.heightWorld = 1.5;
    const std::vector<HalfSpace> half{{{1, -0.5, 0.3}, 0.05}};
    const std::vector<HalfSpace> box{{{1, 0, 0}, -0.4},  {{-1, 0, 0}, -0.5}, {{0, 1, 0}, -0.6},
                                     {{0, -1, 0}, -0.3}, {{0, 0, 1}, -0.5},  {{0, 0, -1}, -0.4}};
    return {
        {"far_thin", lookAt(far, middle, n, 18), thin()},
        {"far_opaque", lookAt(far, middle, n, 18), opaque(), true, {}, SampleFormat::r32f, 8},
        {"near_thin", lookAt(near, middle, n, 60), thin()},
        {"near_opaque", lookAt(near, middle, n, 60), opaque(), true, {}, SampleFormat::r32f, 8},
        {"inside_thin", lookAt(inside, {-1, 0.3, 0}, n, 80), thin()},
        {"inside_opaque", lookAt(inside, {-1, 0.3, 0}, n, 80), opaque(), true, {}, SampleFormat::r32f, 8},
        {"on_an_axis", {{0, -4, 0}, {0, 1, 0}, {0, 0, 1}, 35, n, n}, thin()},
        {"parallel_thin", parallel, thin()},
        {"parallel_opaque", parallel, opaque(), true, {}, SampleFormat::r32f, 8},
        {"parallel_inside", parallelInside, thin()},
        {"half", lookAt(far, middle, n, 18), thin(), false, half},
        {"half_opaque", lookAt(far, middle, n, 18), opaque(), true, half, SampleFormat::r32f, 8},
        {"box", lookAt(near, middle, n, 60), thin(), false, box},
        {"r16f", lookAt(near, middle, n, 60), thin(), false, {}, SampleFormat::r16f},
        {"r8", lookAt(near, middle, n, 60), thin(), false, {}, SampleFormat::r8},
        {"r8_opaque", lookAt(far, middle, n, 18), opaque(), true, half, SampleFormat::r8, 8},
    };
}

/// Largest difference of pixels further than one pixel from where the reference's opacity or colour steps, as
/// at silhouettes: from one pixel to the next by more than a tenth.
double largestAwayFromEdges(const RgbaImage& image, const RgbaImage& reference) {
    const auto differs = [&](int x, int y, int i, int j) {
        for (std::size_t c = 0; c < 4; ++c)
            if (std::abs(reference.at(x, y)[c] - reference.at(i, j)[c]) > 0.1f) return true;
        return false;
    };
    double largest = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            bool isEdge = false;
            for (int j = std::max(0, y - 1); j <= std::min(image.height - 1, y + 1); ++j)
                for (int i = std::max(0, x - 1); i <= std::min(image.width - 1, x + 1); ++i)
                    isEdge = isEdge || differs(x, y, i, j);
            if (isEdge) continue;
            for (std::size_t c = 0; c < 3; ++c)
                largest = std::max(largest, double(std::abs(image.at(x, y)[c] - reference.at(x, y)[c])));
        }
    return largest;
}

class SliceRendererCase : public testing::TestWithParam<PictureCase> {};

// TESSERA_PICTURE_PIXELS asks for larger pictures.
TEST_P(SliceRendererCase, IsThePictureOfRaysThroughTheSameSlabs) {
    TESSERA_NEEDS_GL(kPlatform);
    const PictureCase& scene = GetParam();
    Pictured pictured(ballMesh(5, 1), scene.isShell ? radiusOf : wave, pointFocus({0.4, -0.3, 0.2}, 0.12),
                      scene.format);
    EXPECT_GE(pictured.depths(), 3);
    RenderOptions options;
    options.camera = scene.camera;
    options.function = scene.function;
    options.channel = 1;
    options.layerWorld = 0.1;
    options.slicesAVoxel = scene.slicesAVoxel;
    options.within = scene.within;
    RenderCounts counts;
    const RgbaImage image = pictured.draw(options, &counts);
    const RayCaster caster = pictured.caster();
    const Execution execution{.threads = 2};
    RayCastOptions rays{.layerWorld = options.layerWorld, .slicesAVoxel = options.slicesAVoxel};
    const RgbaImage same = caster.draw(scene.camera, scene.within, scene.function, rays, execution);
    rays.slicesAVoxel = 0;
    rays.stepVoxels = 1.0 / 32;
    const RgbaImage converged = caster.draw(scene.camera, scene.within, scene.function, rays, execution);
    keep(scene.name, "slices", image);
    keep(scene.name, "rays", same);

    const auto pixels = std::int64_t(image.pixels.size());
    const double rms = 255 * differenceOf(image, same).rms(pixels);
    const double largest = 255 * largestAwayFromEdges(image, same);
    const double toConverged = 255 * differenceOf(image, converged).rms(pixels);
    std::printf(
        "%-16s same slabs: RMS %.3f, largest %.2f of 255; converged: RMS %.3f; %lld bricks, %.0f ms\n",
        scene.name, rms, largest, toConverged, static_cast<long long>(counts.bricks), counts.drawMs);
    EXPECT_LT(rms, 1);
    EXPECT_LT(largest, 12);
    EXPECT_LT(toConverged, 2);
    double opacity = 0;
    for (const Rgba& pixel : image.pixels) opacity += double(pixel[3]);
    EXPECT_GT(opacity / double(pixels), 0.05) << "there is something to see";
}

INSTANTIATE_TEST_SUITE_P(All, SliceRendererCase, testing::ValuesIn(cases()),
                         [](const testing::TestParamInfo<PictureCase>& param) { return param.param.name; });

/// What a picture of the cube [0, 1]^3 differs by from even(0.4)'s closed form. `seen` counts its pixels.
double fromClosedForm(const RgbaImage& image, const RenderOptions& options, int& seen) {
    const CameraView view = viewOf(options.camera);
    double worst = 0;
    for (int row = 0; row < image.height; ++row)
        for (int column = 0; column < image.width; ++column) {
            const ViewRay ray = view.rayOf(options.camera, column, row);
            double begin = 0, end = 1e9;
            bool isBeside = false;  // by rounding, perhaps
            for (int a = 0; a < 3; ++a) {
                if (std::abs(ray.direction[a]) < 1e-12) {
                    if (!(ray.originWorld[a] >= 0 && ray.originWorld[a] <= 1)) end = 0;
                    isBeside = isBeside || std::abs(std::abs(ray.originWorld[a] - 0.5) - 0.5) < 1e-6;
                    continue;
                }
                const double low = -ray.originWorld[a] / ray.direction[a],
                             high = (1 - ray.originWorld[a]) / ray.direction[a];
                begin = std::max(begin, std::min(low, high));
                end = std::min(end, std::max(low, high));
            }
            if (isBeside) continue;
            const double path = std::max(0.0, end - begin);
            const double alpha = 1 - std::pow(0.6, path / options.layerWorld);
            worst = std::max(worst, std::abs(alpha - double(image.at(column, row)[3])));
            worst = std::max(worst, std::abs(alpha / 2 - double(image.at(column, row)[1])));
            seen += path > 0;
        }
    return worst;
}

RenderOptions evenCube(const Camera& camera) {
    RenderOptions options;
    options.camera = camera;
    options.function = even(0.4);
    options.channel = 1;
    options.layerWorld = 0.3;
    options.slicesAVoxel = 1;
    for (int a = 0; a < 3; ++a) {
        Vec3d axis(0);
        axis[a] = 1;
        options.within.push_back({axis, 0});
        options.within.push_back({-axis, -1});
    }
    return options;
}

double one(const Vec3d&) {
    return 1;
}

TEST(SliceRenderer, AnEvenMediumHasTheOpacityOfTheRaysLengthInAnyLayout) {
    TESSERA_NEEDS_GL(kPlatform);
    // A box whose faces lie on the points of all lattices, so that the path is known.
    const TetMesh mesh = gridMesh({3, 3, 3}, Vec3d(0), Vec3d(1));
    std::mt19937 random(3);
    std::uniform_real_distribution<double> share(0, 1);
    double worst = 0;
    int seen = 0, depths = 0;
    for (int layout = 0; layout < 20; ++layout) {
        const double x = share(random), y = share(random), z = share(random);
        Pictured pictured(mesh, one, pointFocus({x, y, z}, 0.02 + 0.1 * share(random)), SampleFormat::r32f,
                          layout % 2 == 0 ? 65 : 257);
        depths = std::max(depths, pictured.depths());
        RenderOptions options = evenCube(lookAt({2.3, -1.7, 1.9}, Vec3d(0.5), 48, 40));
        if (layout % 5 == 4) options.camera.heightWorld = 2;
        worst = std::max(worst, fromClosedForm(pictured.draw(options), options, seen));
    }
    std::printf("an even medium in 20 layouts: at most %.4f of 255 from the closed form\n", 255 * worst);
    EXPECT_LT(worst, 1.0 / 255);
    EXPECT_GT(seen, 5000);
    EXPECT_GE(depths, 3);
}

// Around a value at which alone a function is opaque exp(-1 / 2 layers) of the light comes through.
TEST(SliceRenderer, WhatIsOpaqueAtOneValueAloneLetsLightThrough) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(
        gridMesh({2, 2, 2}, Vec3d(0), Vec3d(1)), [](const Vec3d& p) { return p.x; }, pointFocus(Vec3d(0), 1),
        SampleFormat::r32f, 65);
    RenderOptions options = evenCube({{-2, 0.5, 0.5}, {1, 0, 0}, {0, 0, 1}, 35, 16, 16, 0.6});
    // The value is one at a lattice point, not on a face of bricks.
    const double spacing = 1.0 / 64, peak = 0.5 + 6 * spacing;
    options.function =
        stops({{peak - 0.25, {1, 1, 1}, 0}, {peak, {1, 1, 1}, 1}, {peak + 0.25, {1, 1, 1}, 0}});
    options.layerWorld = 0.5;
    // Slabs are counted from the eye: at one of these places the middle of one is where the value is met.
    for (int shift = 0; shift < 4; ++shift) {
        options.camera.eyeWorld.x = -2 + spacing * shift / 4;
        for (const Rgba& pixel : pictured.draw(options).pixels)
            ASSERT_NEAR(double(pixel[3]), 1 - std::exp(-1.0), 0.01) << shift;
    }
}

TEST(SliceRenderer, RaysAlongFacesOfBricksAreDrawnOnce) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(gridMesh({3, 3, 3}, Vec3d(0), Vec3d(1)), one, pointFocus({0.3, 0.4, 0.6}, 0.1));
    const Box3d brick = pictured.frame.boxWorld(pictured.bricks[pictured.bricks.size() / 2].key);
    double worst = 0;
    int seen = 0;
    for (int axis = 0; axis < 3; ++axis)
        for (const double sign : {-1.0, 1.0})
            for (int n = 0; n < 14; ++n) {
                // From a corner of a brick in the direction of an axis: a column and a row of pixels of odd
                // pictures run along its faces; of others some do by rounding.
                Camera camera;
                camera.eyeWorld = brick.min;
                camera.eyeWorld[axis] = 0.5 - 3 * sign;
                camera.forwardWorld = Vec3d(0);
                camera.forwardWorld[axis] = sign;
                camera.upWorld = Vec3d(0);
                camera.upWorld[(axis + 1) % 3] = 1;
                camera.openingDegrees = 30;
                camera.heightWorld = n % 2 == 0 ? 1.5 : 0;
                camera.widthPixels = n < 7 ? 61 : 40 + 3 * n;
                camera.heightPixels = n < 7 ? 45 : 30 + 5 * n;
                const RenderOptions options = evenCube(camera);
                worst = std::max(worst, fromClosedForm(pictured.draw(options), options, seen));
            }
    EXPECT_LT(worst, 1.0 / 255);
    EXPECT_GT(seen, 50000);
}

TEST(SliceRenderer, ParallelRaysMayBeginFarAway) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(ballMesh(5, 1), wave, pointFocus({0.4, -0.3, 0.2}, 0.12));
    RenderOptions options;
    options.camera = lookAt({3, -2, 2}, Vec3d(0), 64);
    options.camera.heightWorld = 2.2;
    options.function = thin();
    options.channel = 1;
    options.layerWorld = 0.1;
    const RgbaImage near = pictured.draw(options);
    // By a whole number of the coarsest slabs, so that they are the same.
    const double slab = pictured.frame.rootSpacingWorld / options.slicesAVoxel;
    options.camera.eyeWorld -= slab * 0x1p28 * viewOf(options.camera).forward;
    EXPECT_LT(255 * differenceOf(pictured.draw(options), near).rms(64 * 64), 0.05);
    options.camera.heightWorld = 0;
    EXPECT_THROW(pictured.draw(options), InputError) << "too far for rays from an eye";
}

TEST(SliceRenderer, StopsMayLieFarFromAllValues) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(ballMesh(5, 1), wave, pointFocus({0.4, -0.3, 0.2}, 0.12));
    RenderOptions options;
    options.camera = lookAt({3, -2, 2}, Vec3d(0), 32);
    options.channel = 1;
    options.layerWorld = 0.1;
    const auto draw = [&](const TransferFunction& function) {
        options.function = function;
        return pictured.draw(options);
    };
    const auto isLike = [&](const TransferFunction& a, const TransferFunction& b) {
        return 255 * differenceOf(draw(a), draw(b)).rms(32 * 32) < 0.01;
    };
    constexpr double kMost = 1.7e308;
    EXPECT_TRUE(
        isLike(stops({{-kMost, {1, 0, 0}, 0.5}, {kMost, {1, 0, 0}, 0.5}}), stops({{0, {1, 0, 0}, 0.5}})));
    EXPECT_TRUE(isLike(
        stops({{-1e30, {1, 0, 0}, 0.2}, {0, {1, 0, 0}, 0.2}, {0, {0, 1, 0}, 0.7}, {1e30, {0, 1, 0}, 0.7}}),
        stops({{0, {1, 0, 0}, 0.2}, {0, {0, 1, 0}, 0.7}})));
    EXPECT_TRUE(
        isLike(stops({{-1e6, {0, 0, 0}, 0}, {1e6, {1, 1, 1}, 1}}), stops({{-1, {0.5, 0.5, 0.5}, 0.5}})));
    EXPECT_TRUE(isLike(stops({{1e25, {1, 0, 0}, 0.5}}), stops({{0, {1, 0, 0}, 0.5}})));
    EXPECT_TRUE(
        isLike(stops({{-1e26, {0, 0, 1}, 0.1}, {-1e25, {1, 0, 0}, 0.5}}), stops({{0, {1, 0, 0}, 0.5}})));
}

TEST(SliceRenderer, PicturesDependOnBricksAndOptionsAlone) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(ballMesh(5, 1), wave, pointFocus({0.4, -0.3, 0.2}, 0.12));
    RenderOptions options;
    options.camera = lookAt({1.5, -2.5, 1.2}, Vec3d(0), 64);
    options.function = thin();
    options.channel = 1;
    options.layerWorld = 0.1;
    const RgbaImage image = pictured.draw(options);
    std::mt19937 random(4);
    std::shuffle(pictured.bricks.begin(), pictured.bricks.end(), random);
    EXPECT_EQ(pictured.draw(options).pixels, image.pixels);
    // A picture of many parts, each pixel the mean of its rays.
    options.samplesAPixel = 16;
    options.camera.widthPixels = 280, options.camera.heightPixels = 40;
    const RgbaImage large = pictured.draw(options);
    Camera fine = options.camera;
    fine.widthPixels = 1120, fine.heightPixels = 160;
    RenderOptions single = options;
    single.samplesAPixel = 1;
    single.camera = fine;
    const RgbaImage rays = pictured.draw(single);
    double worst = 0;
    for (int y = 0; y < 40; ++y)
        for (int x = 0; x < 280; ++x) {
            double sum = 0;
            for (int j = 0; j < 4; ++j)
                for (int i = 0; i < 4; ++i) sum += double(rays.at(4 * x + i, 4 * y + j)[0]);
            worst = std::max(worst, std::abs(sum / 16 - double(large.at(x, y)[0])));
        }
    EXPECT_LT(worst, 1e-5);
}

TEST(SliceRenderer, LeavesOutBricksOfWhichNothingIsShown) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(ballMesh(5, 1), radiusOf, pointFocus({0.4, -0.3, 0.2}, 0.12));
    RenderOptions options;
    options.camera = lookAt({1.5, -2.5, 1.2}, Vec3d(0), 32);
    options.channel = 1;
    options.function = even(0.5);
    RenderCounts all, few, none;
    pictured.draw(options, &all);
    EXPECT_EQ(std::size_t(all.bricks + all.unseenBricks), pictured.bricks.size());
    options.function = stops({{0.3, {1, 1, 1}, 0.5}, {0.3, {1, 1, 1}, 0}});
    pictured.draw(options, &few);
    EXPECT_GT(few.bricks, 0);
    EXPECT_LT(few.bricks, all.bricks / 4);
    options.camera.forwardWorld = -options.camera.forwardWorld;
    for (const Rgba& pixel : pictured.draw(options, &none).pixels) EXPECT_EQ(pixel, Rgba{});
    EXPECT_EQ(none.bricks, 0);
}

TEST(SliceRenderer, ValuesThatAreNotFiniteAreNotShown) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(
        ballMesh(3, 1), [](const Vec3d& p) { return p.x > 0 ? NAN : 1.0; },
        pointFocus({0.4, -0.3, 0.2}, 0.12));
    RenderOptions options;
    options.camera = {{0, -4, 0}, {0, 1, 0}, {0, 0, 1}, 30, 33, 33};
    options.channel = 1;
    options.function = even(0.5);
    options.layerWorld = 0.2;
    const RgbaImage image = pictured.draw(options);
    EXPECT_GT(image.at(10, 16)[3], 0.9f);
    EXPECT_EQ(image.at(22, 16)[3], 0);
}

TEST(SliceRenderer, RefusesOptionsOutOfRange) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(gridMesh({1, 1, 1}, Vec3d(0), Vec3d(1)), wave, pointFocus(Vec3d(0), 1),
                      SampleFormat::r32f, 17);
    RenderOptions good;
    good.camera = lookAt({2, 3, 4}, Vec3d(0.5), 8);
    good.function = even(0.5);
    const auto refuses = [&](const auto& change) {
        RenderOptions bad = good;
        change(bad);
        EXPECT_THROW(pictured.draw(bad), InputError);
    };
    EXPECT_NO_THROW(pictured.draw(good));
    refuses([](RenderOptions& o) { o.channel = 2; });
    refuses([](RenderOptions& o) { o.layerWorld = 0; });
    refuses([](RenderOptions& o) { o.slicesAVoxel = NAN; });
    refuses([](RenderOptions& o) { o.samplesAPixel = 2; });
    refuses([](RenderOptions& o) { o.within.resize(33); });
    refuses([](RenderOptions& o) { o.within = {{Vec3d(0), 1}}; });
    refuses([](RenderOptions& o) { o.function.stops.clear(); });
    refuses([](RenderOptions& o) { o.camera.upWorld = o.camera.forwardWorld; });
}

TEST(VisibilityOrder, NoBrickHidesOneBeforeIt) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> share(0, 1);
    std::int64_t hidden = 0;
    for (int round = 0; round < 40; ++round) {
        std::vector<DepthKey> leaves;
        const std::function<void(const DepthKey&)> grow = [&](const DepthKey& key) {
            if (key.depth < Depth(3) && share(random) < 0.5) {
                for (unsigned c = 0; c < 8; ++c) grow(childKey(key, c));
            } else if (share(random) < 0.8) {
                leaves.push_back(key);
            }
        };
        for (int n = 0; n < 18; ++n) grow({Depth(0), {n % 3 - 1, n / 3 % 3 - 2, n / 9}});
        std::shuffle(leaves.begin(), leaves.end(), random);
        Viewpoint from;
        for (int a = 0; a < 3; ++a) from.place[a] = 6 * share(random) - 3;
        if (round % 4 == 3)
            for (int a = 0; a < 3; ++a)
                from.direction[a] = round % 8 == 7 && a == 1 ? 0 : share(random) - 0.5;
        const std::vector<std::size_t> order = visibilityOrder(leaves, from);
        ASSERT_EQ(order.size(), leaves.size());
        std::vector<std::size_t> rank(leaves.size());
        for (std::size_t i = 0; i < order.size(); ++i) rank[order[i]] = i;
        const auto boxOf = [&](const DepthKey& key) {
            const double edge = std::ldexp(1.0, -key.depth.halvings());
            return Box3d{Vec3d(key.index) * edge, Vec3d(key.index + 1) * edge};
        };
        // Rays through two bricks meet the one that comes first in the order first.
        for (int ray = 0; ray < 1000; ++ray) {
            Vec3d origin = from.place, direction = from.direction;
            if (direction == Vec3d(0))
                for (int a = 0; a < 3; ++a) direction[a] = share(random) - 0.5;
            else
                for (int a = 0; a < 3; ++a) origin[a] = 4 * share(random) - 2 - 8 * direction[a];
            std::vector<std::pair<double, std::size_t>> met;
            for (std::size_t leaf = 0; leaf < leaves.size(); ++leaf) {
                const Box3d box = boxOf(leaves[leaf]);
                double begin = 0, end = 1e9;
                for (int a = 0; a < 3; ++a) {
                    if (direction[a] == 0) {
                        if (origin[a] <= box.min[a] || origin[a] >= box.max[a]) end = -1;
                        continue;
                    }
                    const double low = (box.min[a] - origin[a]) / direction[a],
                                 high = (box.max[a] - origin[a]) / direction[a];
                    begin = std::max(begin, std::min(low, high));
                    end = std::min(end, std::max(low, high));
                }
                if (begin + 1e-9 < end) met.emplace_back(begin, rank[leaf]);
            }
            std::sort(met.begin(), met.end());
            for (std::size_t i = 1; i < met.size(); ++i) ASSERT_LT(met[i - 1].second, met[i].second);
            hidden += std::int64_t(met.size()) - 1;
        }
    }
    EXPECT_GT(hidden, 10000);
}

}  // namespace
}  // namespace tessera
