#include "render/effect.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "brick_test_meshes.h"
#include "gl_calls.h"
#include "pictured.h"
#include "refine/camera_view.h"
#include "render/effects/axes.h"
#include "render/effects/bricks.h"
#include "render/effects/cuts.h"
#include "render/effects/errors.h"
#include "render/effects/isosurfaces.h"
#include "render/effects/occlusion.h"
#include "render/effects/preintegration.h"
#include "render/effects/probes.h"
#include "render/effects/shading.h"
#include "render/effects/shadows.h"
#include "schedule/random_schedule.h"
#include "tessera/error.h"

namespace tessera {
namespace {

/// A cube over several depths with a linear field, seen by parallel rays.
class Effects : public testing::Test {
  protected:
    static double linear(const Vec3d& p) { return glm::dot(kSlope, p); }
    static constexpr Vec3d kSlope{0.5, 1, -0.25};

    void SetUp() override {
        TESSERA_NEEDS_GL(kPlatform);
        pictured.emplace(gridMesh({3, 3, 3}, Vec3d(0), Vec3d(1)), linear, pointFocus({0.3, 0.4, 0.6}, 0.05));
        ASSERT_GE(pictured->depths(), 3);
        options.camera = lookAt({3, -2, 2.5}, Vec3d(0.5), 96);
        options.camera.heightWorld = 1.8;
        options.channel = 1;
        options.function = even(0.3);
        options.layerWorld = 0.3;
        for (int a = 0; a < 3; ++a) {
            Vec3d axis(0);
            axis[a] = 1;
            options.within.push_back({axis, 0.001});
            options.within.push_back({-axis, -0.999});
        }
    }
    Vec3d forward() const { return viewOf(options.camera).forward; }

    std::optional<Pictured> pictured;
    RenderOptions options;
};

TEST_F(Effects, ShadingOfALinearFieldIsTheSameEverywhere) {
    const RgbaImage plain = pictured->draw(options);
    const Shading shading{.towardsLight = {1, -1, 2}};
    options.effects = {shadingEffect(shading)};
    const RgbaImage shaded = pictured->draw(options);
    const Vec3d light = glm::normalize(shading.towardsLight);
    Vec3d normal = glm::normalize(kSlope);
    if (glm::dot(normal, forward()) > 0) normal = -normal;
    const double diffuse = std::max(glm::dot(normal, light), 0.0);
    const double specular =
        std::pow(std::max(glm::dot(normal, glm::normalize(light - forward())), 0.0), shading.shininess);
    ValueRange range;
    Box3d box;
    for (const PlacedBrick& brick : pictured->bricks) {
        range.min = std::min(range.min, brick.range.min);
        range.max = std::max(range.max, brick.range.max);
        box.include(pictured->frame.boxWorld(brick.key).min);
        box.include(pictured->frame.boxWorld(brick.key).max);
    }
    const double steep = glm::length(kSlope), size = std::max({box.size().x, box.size().y, box.size().z});
    const double belief = steep / (steep + range.width() / (5 * size));
    // Of green, which is half of red.
    const double lit = 0.5 * (shading.ambient + shading.diffuse * diffuse) + shading.specular * specular;
    const double expected = glm::mix(0.5, lit, belief);
    double worst = 0;
    int seen = 0;
    for (std::size_t p = 0; p < plain.pixels.size(); ++p) {
        const double opacity = double(plain.pixels[p][3]);
        ASSERT_NEAR(double(shaded.pixels[p][3]), opacity, 1e-6);
        if (opacity < 0.05) continue;
        ++seen;
        worst = std::max(worst, std::abs(double(shaded.pixels[p][1]) / opacity - expected));
    }
    EXPECT_GT(seen, 2000);
    EXPECT_LT(worst, 0.5 / 255) << "no step at borders between bricks, nor at the surface";
}

TEST_F(Effects, AnIsosurfaceIsWhereTheFieldHasItsValue) {
    options.function = even(0);
    const Isosurface surface{.value = 0.6, .color = {0.2, 0.8, 0.4}, .opacity = 0.75};
    const Isosurface behind{.value = 0.9, .color = {1, 0, 0}, .opacity = 1};
    options.effects = {isosurfacesEffect({behind, surface})};
    options.camera.heightWorld = 0;
    const RgbaImage image = pictured->draw(options);
    const CameraView view = viewOf(options.camera);
    int first = 0, second = 0, none = 0;
    double worst = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const ViewRay ray = view.rayOf(options.camera, x, y);
            const auto meets = [&](double value, double margin) {
                const double at = (value - linear(ray.originWorld)) / glm::dot(kSlope, ray.direction);
                const Vec3d p = ray.originWorld + at * ray.direction;
                return glm::all(glm::greaterThan(p, Vec3d(margin))) &&
                       glm::all(glm::lessThan(p, Vec3d(1 - margin)));
            };
            double opacity = 0;
            const bool isSure =
                meets(0.6, 0.02) == meets(0.6, -0.02) && meets(0.9, 0.02) == meets(0.9, -0.02);
            if (!isSure) continue;
            if (meets(0.6, 0)) opacity = 0.75, ++first;
            if (meets(0.9, 0)) opacity = 1, ++second;
            none += opacity == 0;
            worst = std::max(worst, std::abs(opacity - double(image.at(x, y)[3])));
            if (!meets(0.6, 0) || meets(0.9, 0)) continue;
            // Lit from the camera.
            const double facing = std::abs(glm::dot(glm::normalize(kSlope), ray.direction));
            const double green = 0.8 * (0.3 + 0.65 * facing) + 0.25 * std::pow(facing, 40.0);
            worst = std::max(worst, std::abs(0.75 * green - double(image.at(x, y)[1])));
        }
    EXPECT_LT(worst, 1.0 / 255);
    EXPECT_GT(first, 100);
    EXPECT_GT(second, 100);
    EXPECT_GT(none, 100);
}

/// The integral of -ln(1 - opacity) over the values between two.
double depthOf(const TransferFunction& function, double from, double to) {
    const auto& all = function.stops;
    const auto integral = [](double u) { return u > 0 ? u - u * std::log(u) : 0; };
    double sum = -std::log(1 - all.front().opacity) * std::max(0.0, std::min(to, all.front().value) - from) -
                 std::log(1 - all.back().opacity) * std::max(0.0, to - std::max(from, all.back().value));
    for (std::size_t i = 1; i < all.size(); ++i) {
        const double low = std::max(from, all[i - 1].value), high = std::min(to, all[i].value);
        if (!(low < high)) continue;
        const double u = 1 - between(all[i - 1], all[i], low).opacity;
        const double v = 1 - between(all[i - 1], all[i], high).opacity;
        sum += u == v ? -std::log(u) * (high - low) : (integral(u) - integral(v)) / (u - v) * (high - low);
    }
    return sum;
}

TEST_F(Effects, PreintegrationOfALinearFieldHasTheExactOpacity) {
    // A sheet far thinner than a slab, one that is opaque within, a step, and clear values.
    options.function = stops({{0.2, {1, 0, 0}, 0},
                              {0.201, {1, 1, 0}, 0.999},
                              {0.202, {0, 1, 0}, 0},
                              {0.5, {0, 1, 0}, 0.01},
                              {0.5, {0, 0, 1}, 0.2},
                              {0.8, {0, 0, 1}, 0.1},
                              {0.8, {0, 0, 1}, 0}});
    options.layerWorld = 0.004;
    options.effects = {preintegrationEffect()};
    double worst = 0;
    int seen = 0;
    for (const double slices : {0.25, 1.0, 4.0}) {
        options.slicesAVoxel = slices;
        const RgbaImage image = pictured->draw(options);
        const CameraView view = viewOf(options.camera);
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x) {
                const ViewRay ray = view.rayOf(options.camera, x, y);
                const auto depthFrom = [&](double low, double high) {
                    double begin = 0, end = 1e9;
                    for (int a = 0; a < 3; ++a) {
                        const double s = (low - ray.originWorld[a]) / ray.direction[a],
                                     t = (high - ray.originWorld[a]) / ray.direction[a];
                        begin = std::max(begin, std::min(s, t));
                        end = std::min(end, std::max(s, t));
                    }
                    const double rise = glm::dot(kSlope, ray.direction);
                    const double one = linear(ray.originWorld) + begin * rise,
                                 other = linear(ray.originWorld) + end * rise;
                    if (!(begin < end)) return 0.0;
                    return depthOf(options.function, std::min(one, other), std::max(one, other)) /
                           std::abs(rise) / options.layerWorld;
                };
                // Floats place the ray's ends a little beside where they are.
                const double depth = depthFrom(0.001, 0.999);
                const double apart =
                    std::abs(depthFrom(0.001 + 1e-6, 0.999 - 1e-6) - depthFrom(0.001 - 1e-6, 0.999 + 1e-6));
                const double missed = std::abs(std::exp(-depth) - (1 - double(image.at(x, y)[3])));
                worst = std::max(worst, missed - apart);
                seen += depth > 0;
            }
    }
    std::printf("pre-integrated: at most %.5f of 255 from the closed form\n", 255 * worst);
    EXPECT_LT(255 * worst, 0.1);
    EXPECT_GT(seen, 5000);
}

TEST(Preintegration, OfOneSliceAVoxelIsAsGoodAsManyWithoutIt) {
    TESSERA_NEEDS_GL(kPlatform);
    Pictured pictured(ballMesh(5, 1), radiusOf, pointFocus({0.4, -0.3, 0.2}, 0.12));
    const RayCaster caster = pictured.caster();
    RenderOptions options;
    options.camera = lookAt({2, -2.6, 1.5}, Vec3d(0), asked("TESSERA_PICTURE_PIXELS", 40), 30);
    options.channel = 1;
    options.layerWorld = 0.1;
    const std::pair<const char*, TransferFunction> functions[] = {
        {"soft", stops({{0.2, {0, 0, 1}, 0}, {0.6, {1, 0.8, 0.2}, 0.4}, {1, {1, 0, 0}, 0}})},
        {"thin shells", stops({{0.50, {0, 0, 1}, 0},
                               {0.51, {1, 0.8, 0.2}, 0.9},
                               {0.52, {1, 0, 0}, 0},
                               {0.80, {0, 0.5, 0}, 0},
                               {0.80, {0, 0.5, 0}, 0.6},
                               {0.81, {0, 0.5, 0}, 0.6},
                               {0.81, {0, 0.5, 0}, 0}})},
        {"opaque",
         stops({{0.6, {0, 0, 1}, 0}, {0.62, {1, 0.8, 0.2}, 1}, {0.64, {1, 0, 0}, 1}, {0.64, {}, 0}})}};
    for (const auto& [name, function] : functions) {
        options.function = function;
        const RayCastOptions rays{.layerWorld = options.layerWorld, .stepVoxels = 1.0 / 32};
        const RgbaImage converged = caster.draw(options.camera, {}, function, rays, {.threads = 2});
        double with[3], without[3];
        const double slices[] = {1, 2, 4};
        for (std::size_t i = 0; i < 3; ++i) {
            options.slicesAVoxel = slices[i];
            for (const bool isPreintegrated : {false, true}) {
                options.effects.clear();
                if (isPreintegrated) options.effects = {preintegrationEffect()};
                const RgbaImage image = pictured.draw(options);
                const std::string which = std::to_string(int(slices[i])) + (isPreintegrated ? "_pre" : "");
                keep(name, which.c_str(), image);
                (isPreintegrated ? with : without)[i] =
                    255 * differenceOf(image, converged).rms(std::int64_t(image.pixels.size()));
            }
        }
        std::printf(
            "%-12s RMS of 255 against the converged picture, 1, 2 and 4 slices a voxel: "
            "%.3f %.3f %.3f without, %.3f %.3f %.3f pre-integrated\n",
            name, without[0], without[1], without[2], with[0], with[1], with[2]);
        if (std::string(name) == "soft") {
            // The way between a slab's ends isn't straight: that is as large an error as the middle's.
            for (const double rms : with) EXPECT_LT(rms, 0.2);
            continue;
        }
        for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(with[i], without[i] / 4);
        EXPECT_LT(with[0], without[2]);
    }
}

/// Colours that are linear in the field's values.
TransferFunction colours() {
    return stops({{-0.5, {0, 1, 0.2}, 0}, {2, {1, 0, 0.7}, 0}});
}

TEST_F(Effects, ACutPlaneHasTheFieldsColourAndContoursOfOneWidth) {
    options.function = colours();
    options.camera.heightWorld = 0;
    options.camera.widthPixels = options.camera.heightPixels = 192;
    const HalfSpace half{{1, 0.5, 1.5}, 1.4};
    const Contours contours{.values = {0.3, 0.6, 0.9}, .widthPixels = 3, .color = {0, 0, 0}};
    const Cuts cuts{.planes = {{half, 0.75}}, .contours = contours};
    options.effects = {cutsEffect(cuts)};
    const RgbaImage image = pictured->draw(options);
    keep("cut", "contours", image);
    const CameraView view = viewOf(options.camera);
    const auto placeOf = [&](const ViewRay& ray) {
        return ray.originWorld + (half.offsetWorld - glm::dot(half.normalWorld, ray.originWorld)) /
                                     glm::dot(half.normalWorld, ray.direction) * ray.direction;
    };
    double worst = 0;
    int on = 0, off = 0, clear = 0;
    for (int y = 1; y + 1 < image.height; ++y)
        for (int x = 1; x + 1 < image.width; ++x) {
            const Vec3d p = placeOf(view.rayOf(options.camera, x, y));
            const double inside = std::min({p.x, p.y, p.z, 1 - p.x, 1 - p.y, 1 - p.z});
            if (std::abs(inside) < 0.02) continue;
            const Rgba& pixel = image.at(x, y);
            if (inside < 0) {
                ASSERT_EQ(pixel[3], 0);
                ++clear;
                continue;
            }
            worst = std::max(worst, std::abs(double(pixel[3]) - 0.75));
            const auto valueAt = [&](int i, int j) {
                return linear(placeOf(view.rayOf(options.camera, i, j)));
            };
            const double value = valueAt(x, y);
            const double steep = 0.5 * std::hypot(valueAt(x + 1, y) - valueAt(x - 1, y),
                                                  valueAt(x, y + 1) - valueAt(x, y - 1));
            double apart = 1e9;  // pixels from the nearest line
            for (const double line : contours.values) apart = std::min(apart, std::abs(value - line) / steep);
            const std::array<double, 4> shown =
                shownAs(between({-0.5, {0, 1, 0.2}, 1}, {2, {1, 0, 0.7}, 1}, value));
            const bool isOn = apart<0.95, isOff = apart> 2.05;
            on += isOn;
            off += isOff;
            for (std::size_t c = 0; c < 3; ++c)
                if (isOn || isOff)
                    worst = std::max(worst, std::abs(double(pixel[c]) - (isOff ? 0.75 * shown[c] : 0)));
        }
    EXPECT_LT(worst, 0.5 / 255) << "on bricks of all levels, and where they meet";
    EXPECT_GT(on, 200);
    EXPECT_GT(off, 2000);
    EXPECT_GT(clear, 5000);
    EXPECT_THROW(cutsEffect({}), InputError);
    EXPECT_THROW(cutsEffect({.planes = std::vector<CutPlane>(17)}), InputError);
}

/// Whether a combination has a place, by its definition.
bool holds(const ProbeShape& shape, const Vec3d& p) {
    const auto has = [&](const ProbeShape& part) { return holds(part, p); };
    switch (shape.kind) {
        case ProbeShape::plane:
            return glm::dot(shape.half.normalWorld, p) >= shape.half.offsetWorld;
        case ProbeShape::ball:
            return glm::distance(p, shape.centerWorld) < shape.radiusWorld;
        case ProbeShape::box:
            return glm::all(glm::greaterThanEqual(p, shape.boxWorld.min)) &&
                   glm::all(glm::lessThan(p, shape.boxWorld.max));
        case ProbeShape::unite:
            return std::ranges::any_of(shape.parts, has);
        case ProbeShape::common:
            return std::ranges::all_of(shape.parts, has);
        default:
            return has(shape.parts[0]) && std::none_of(shape.parts.begin() + 1, shape.parts.end(), has);
    }
}

std::vector<Probes> probes() {
    const ProbeShape ball{.kind = ProbeShape::ball, .centerWorld = {0.6, 0.35, 0.6}, .radiusWorld = 0.4};
    const ProbeShape box{.kind = ProbeShape::box, .boxWorld = {{0.3, -1, 0.5}, {0.8, 0.7, 2}}};
    const ProbeShape plane{.half = {{1, -1, 0.2}, 0.1}};
    const auto combined = [](ProbeShape::Kind kind, std::vector<ProbeShape> parts) {
        return ProbeShape{.kind = kind, .parts = std::move(parts)};
    };
    return {{ball},
            {box},
            {plane},
            {.shape = ball, .keepsInside = true},
            {combined(ProbeShape::unite, {ball, box})},
            {combined(ProbeShape::common, {box, ball, plane})},
            {combined(ProbeShape::subtract, {box, ball})},
            {.shape = combined(ProbeShape::subtract, {ball, plane, box}), .keepsInside = true},
            {combined(ProbeShape::unite, {combined(ProbeShape::common, {ball, plane}),
                                          combined(ProbeShape::subtract, {box, ball})})}};
}

TEST_F(Effects, ProbesTakeAwayWhatTheyHoldAndShowTheFieldWhereTheyCut) {
    options.camera = lookAt({3, -2, 2.5}, Vec3d(0.5), 48, 30);
    options.slicesAVoxel = 1;
    const CameraView view = viewOf(options.camera);
    constexpr int kSteps = 2000;
    int cut = 0, thinned = 0;
    for (Probes probe : probes()) {
        probe.opacity = 0;
        options.function = even(0.3);
        options.effects = {probesEffect(probe)};
        const RgbaImage volume = pictured->draw(options);
        probe.opacity = 1;
        options.function = colours();
        options.effects = {probesEffect(probe)};
        const RgbaImage surface = pictured->draw(options);
        double worst = 0, worstColour = 0;
        for (int y = 0; y < volume.height; ++y)
            for (int x = 0; x < volume.width; ++x) {
                const ViewRay ray = view.rayOf(options.camera, x, y);
                double begin = 0, end = 1e9;
                for (int a = 0; a < 3; ++a) {
                    const double s = (0.001 - ray.originWorld[a]) / ray.direction[a],
                                 t = (0.999 - ray.originWorld[a]) / ray.direction[a];
                    begin = std::max(begin, std::min(s, t));
                    end = std::min(end, std::max(s, t));
                }
                if (end - begin < 0.02) continue;
                // By many small steps along the ray.
                const double step = (end - begin) / kSteps;
                const auto isKept = [&](double at) {
                    return holds(probe.shape, ray.originWorld + at * ray.direction) == probe.keepsInside;
                };
                int kept = 0, changes = 0;
                double firstCut = -1, leastApart = 1e9, lastCut = begin;
                bool was = isKept(begin + 0.5 * step);
                kept += was;
                for (int i = 1; i < kSteps; ++i) {
                    const bool is = isKept(begin + (i + 0.5) * step);
                    kept += is;
                    if (is != was) {
                        const double at = begin + i * step;
                        if (changes++ == 0) firstCut = at;
                        leastApart = std::min(leastApart, at - lastCut);
                        lastCut = at;
                    }
                    was = is;
                }
                leastApart = std::min(leastApart, end - lastCut);
                if (changes > 0 && leastApart < 0.01)
                    continue;  // two cuts by each other, or a ray beside one
                const double opacity = 1 - std::pow(0.7, kept * step / options.layerWorld);
                const double steps = 2 * (changes + 1) * step / options.layerWorld;
                worst = std::max(worst, std::abs(double(volume.at(x, y)[3]) - opacity) - steps);
                thinned += changes > 0;
                if (changes == 0) continue;
                ++cut;
                const double value = linear(ray.originWorld + firstCut * ray.direction);
                const auto shown = shownAs(between({-0.5, {0, 1, 0.2}, 1}, {2, {1, 0, 0.7}, 1}, value));
                EXPECT_EQ(surface.at(x, y)[3], 1);
                for (std::size_t c = 0; c < 3; ++c)
                    worstColour = std::max(worstColour, std::abs(double(surface.at(x, y)[c]) - shown[c]));
            }
        EXPECT_LT(worst, 0.2 / 255);
        EXPECT_LT(worstColour, 0.5 / 255);
    }
    EXPECT_GT(cut, 1500);
    EXPECT_GT(thinned, 1500);
    EXPECT_THROW(probesEffect({{.kind = ProbeShape::unite}}), InputError);
    EXPECT_THROW(probesEffect({{.kind = ProbeShape::unite, .parts = std::vector<ProbeShape>(17)}}),
                 InputError);
}

/// The cube less a box: there are faces, edges and a hollow.
class HollowEffects : public Effects {
  protected:
    static constexpr Box3d kGone{{0.4, -1, 0.5}, {2, 0.6, 2}};
    static bool isSolid(const Vec3d& p) {
        return glm::all(glm::greaterThan(p, Vec3d(0.001))) && glm::all(glm::lessThan(p, Vec3d(0.999))) &&
               !(glm::all(glm::greaterThan(p, kGone.min)) && glm::all(glm::lessThan(p, kGone.max)));
    }
    static Effect hollow() {
        return probesEffect({.shape = {.kind = ProbeShape::box, .boxWorld = kGone}, .opacity = 0});
    }
};

TEST_F(HollowEffects, OcclusionDarkensHollowsAndNoPlanes) {
    options.function = even(0.99);
    options.layerWorld = 0.003;
    options.slicesAVoxel = 8;
    options.camera.widthPixels = options.camera.heightPixels = 72;
    const Occlusion occlusion{.radiusWorld = 0.3, .strength = 0.9};
    options.effects = {hollow(), occlusionEffect(occlusion)};
    const RgbaImage image = pictured->draw(options);
    keep("occlusion", "hollow", image);
    const Vec3d halfOfThem[] = {{-0.216934, 0.219289, 0.951237}, {0.501343, -0.506785, 0.701302},
                                {-0.207349, 0.957142, 0.202202}, {-0.954848, 0.217670, 0.202202},
                                {0.692626, 0.509404, 0.510663},  {-0.516852, -0.687086, 0.510663}};
    const CameraView view = viewOf(options.camera);
    int plain = 0, dark = 0;
    double worst = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const ViewRay ray = view.rayOf(options.camera, x, y);
            double at = 0;
            while (at < 6 && !isSolid(ray.originWorld + at * ray.direction)) at += 0.001;
            if (at >= 6 || !isSolid(ray.originWorld + (at + 0.02) * ray.direction)) continue;
            const Vec3d p = ray.originWorld + at * ray.direction;
            double passed = 0;
            bool isSure = true;
            for (const Vec3d& half : halfOfThem)
                for (const double sign : {-1.0, 1.0}) {
                    double cover = 0;
                    for (const double share : {0.5, 1.0}) {
                        const Vec3d there = p + sign * share * *occlusion.radiusWorld * half;
                        cover += isSolid(there) ? 0.5 : 0;
                        for (int corner = 0; corner < 8; ++corner) {
                            const Vec3d aside(corner & 1, corner >> 1 & 1, corner >> 2);
                            isSure = isSure && isSolid(there + 0.012 * (2.0 * aside - 1.0)) == isSolid(there);
                        }
                    }
                    passed += 1 - cover;
                }
            if (!isSure) continue;
            const double factor = 1 - occlusion.strength * std::max(1 - passed / 6, 0.0);
            worst = std::max(worst, std::abs(double(image.at(x, y)[0]) - factor));
            (factor < 0.9 ? dark : plain) += 1;
        }
    EXPECT_LT(worst, 1.0 / 255) << "on bricks of all levels";
    EXPECT_GT(plain, 200);
    EXPECT_GT(dark, 50);
}

TEST_F(HollowEffects, ShadowsAreWhatTheLightsWayThroughTheVolumeLeaves) {
    options.camera.widthPixels = options.camera.heightPixels = 24;
    options.measuresDevice = true;
    Shadows shadows{.towardsLight = {1, -1, 2}, .strength = 1};
    const Vec3d light = glm::normalize(shadows.towardsLight);
    constexpr double kStep = 0.01;
    const auto passedOver = [&](double length) { return std::pow(0.7, length / options.layerWorld); };
    const CameraView view = viewOf(options.camera);
    RgbaImage expected{options.camera.widthPixels, options.camera.heightPixels, {}};
    for (int y = 0; y < expected.height; ++y)
        for (int x = 0; x < expected.width; ++x) {
            const ViewRay ray = view.rayOf(options.camera, x, y);
            double left = 1, sum = 0;
            for (double at = 0.5 * kStep; at < 6; at += kStep) {
                const Vec3d p = ray.originWorld + at * ray.direction;
                if (!isSolid(p)) continue;
                double way = 0;
                for (double along = 0.5 * kStep; along < 1.5; along += kStep)
                    way += isSolid(p + along * light) ? kStep : 0;
                const double passed = passedOver(kStep);
                sum += left * (1 - passed) * passedOver(way);
                left *= passed;
            }
            expected.pixels.push_back({float(sum), float(sum / 2), float(sum / 4), float(1 - left)});
        }
    // Light is looked up some cells nearer to its source and to the eye, so it is right where cells are
    // small.
    double rms[2];
    for (const int finer : {0, 1}) {
        shadows.resolution = finer == 0 ? 96 : 192;
        options.effects = {hollow(), shadowsEffect(shadows)};
        RenderCounts counts;
        const RgbaImage image = pictured->draw(options, &counts);
        keep("shadows", finer == 0 ? "96" : "192", image);
        ASSERT_EQ(counts.effects.size(), 1u);
        EXPECT_EQ(counts.effects[0].name, "shadows");
        EXPECT_EQ(counts.effects[0].textures, 1);
        EXPECT_LE(counts.deviceMs, counts.drawMs) << "by whichever clock";
        EXPECT_EQ(counts.effects[0].passes, 2 + pictured->pool->layout().atlases);
        EXPECT_GT(counts.effects[0].bytes, 4 * std::pow(shadows.resolution, 3) / 2);
        const ImageDifference apart = differenceOf(image, expected);
        rms[finer] = 255 * apart.rms(std::int64_t(image.pixels.size()));
        std::printf("shadows, %d cells: RMS %.2f, largest %.2f of 255 from light by small steps\n",
                    shadows.resolution, rms[finer], 255 * apart.largest);
        EXPECT_LT(255 * apart.largest, finer == 0 ? 20 : 10);
    }
    EXPECT_LT(rms[1], 4);
    EXPECT_LT(rms[1], 0.6 * rms[0]);
    EXPECT_THROW(shadowsEffect({.towardsLight = Vec3d(0)}), InputError);
    EXPECT_THROW(shadowsEffect({.resolution = 4}), InputError);
}

TEST_F(Effects, EdgesOfBricksStandWhereTheyAre) {
    options.within.clear();
    options.function = even(0);
    options.effects = {brickEdgesEffect({.widthPixels = 3, .opacity = 1})};
    options.camera.widthPixels = options.camera.heightPixels = 256;
    RenderCounts counts;
    const RgbaImage image = pictured->draw(options, &counts);
    EXPECT_EQ(counts.unseenBricks, 0);
    const CameraView view = viewOf(options.camera);
    int on = 0;
    for (const PlacedBrick& brick : pictured->bricks) {
        const Box3d box = pictured->frame.boxWorld(brick.key);
        for (int i = 1; i < 8; ++i) {
            const Vec3d p = glm::mix(box.min, Vec3d(box.max.x, box.min.y, box.min.z), i / 8.0);
            const Vec3d at = p - options.camera.eyeWorld;
            const int x = int(128 * (1 + glm::dot(at, view.right) / view.wide));
            const int y = int(128 * (1 - glm::dot(at, view.up) / view.high));
            if (x < 1 || y < 1 || x > 254 || y > 254) continue;
            ++on;
            // Half of an outermost edge's line is beside the bricks.
            float most = 0;
            for (int n = 0; n < 9; ++n) most = std::max(most, image.at(x + n % 3 - 1, y + n / 3 - 1)[3]);
            EXPECT_GT(most, 0.9f) << x << " " << y;
        }
    }
    EXPECT_GT(on, 500);
    const auto clear = std::ranges::count_if(image.pixels, [](const Rgba& pixel) { return pixel[3] == 0; });
    EXPECT_GT(clear, 256 * 256 / 5);
}

TEST_F(Effects, ErrorsColourTheirBricks) {
    options.effects = {errorsEffect({.bound = 0.1, .strength = 0.5})};
    const std::size_t count = pictured->bricks.size();
    const auto drawn = [&](const std::vector<float>& errors) {
        options.brickNumbers = errors;
        return pictured->draw(options);
    };
    // The volume's colour is (1, 0.5, 0.25), and half of it is left.
    const std::pair<float, std::array<double, 3>> cases[] = {{0, {0.23, 0.30, 0.75}},
                                                             {0.05f, {0.87, 0.87, 0.87}},
                                                             {0.075f, {0.81, 0.445, 0.51}},
                                                             {0.2f, {0.40, 0.0, 0.45}},
                                                             {NAN, {0.35, 0.60, 0.35}}};
    for (const auto& [error, color] : cases) {
        const RgbaImage image = drawn(std::vector<float>(count, error));
        const Rgba& pixel = image.at(48, 48);
        ASSERT_GT(pixel[3], 0.1f);
        const std::array own{0.5, 0.25, 0.125};
        for (std::size_t c = 0; c < 3; ++c)
            EXPECT_NEAR(double(pixel[c] / pixel[3]), 0.5 * color[c] + own[c], 1e-4) << error;
    }
    // One brick's error is seen there alone.
    std::vector<float> errors(count, 0.f);
    const RgbaImage plain = drawn(errors);
    const Vec3d inside(0.8, 0.2, 0.8);
    Box3d box;
    for (std::size_t i = 0; i < count; ++i) {
        const Box3d own = pictured->frame.boxWorld(pictured->bricks[i].key);
        if (glm::any(glm::lessThan(inside, own.min)) || glm::any(glm::greaterThan(inside, own.max))) continue;
        box = own;
        errors[i] = 0.1f;
    }
    const RgbaImage marked = drawn(errors);
    const CameraView view = viewOf(options.camera);
    int differ = 0;
    for (int y = 0; y < 96; ++y)
        for (int x = 0; x < 96; ++x) {
            if (plain.at(x, y) == marked.at(x, y)) continue;
            ++differ;
            const ViewRay ray = view.rayOf(options.camera, x, y);
            double begin = 0, end = 1e9;
            for (int a = 0; a < 3; ++a) {
                const double low = (box.min[a] - ray.originWorld[a]) / ray.direction[a],
                             high = (box.max[a] - ray.originWorld[a]) / ray.direction[a];
                begin = std::max(begin, std::min(low, high));
                end = std::min(end, std::max(low, high));
            }
            EXPECT_LT(begin, end + 1e-6);
        }
    EXPECT_GT(differ, 4);
    options.brickNumbers.pop_back();
    EXPECT_THROW(pictured->draw(options), InputError);
    // A bar says what the colours are.
    LineView marks{options.camera, {}, 0, 0.0123};
    EXPECT_EQ(linesOf(std::vector{errorsEffect({})}, marks).marks.words[1].text, "1.23%");
    EXPECT_EQ(linesOf(options.effects, marks).marks.words[1].text, "10%");
}

/// One of each.
std::vector<Effect> everyEffect() {
    return {axesEffect({}),
            brickEdgesEffect({}),
            cutsEffect({.planes = {{}}}),
            errorsEffect({}),
            isosurfacesEffect({{.value = 0.6}}),
            preintegrationEffect(),
            occlusionEffect({}),
            probesEffect({}),
            shadingEffect({}),
            shadowsEffect({})};
}

/// All that OpenGL is asked for, while pictures are drawn.
class EffectCalls : public testing::Test {
  protected:
    void SetUp() override {
        TESSERA_NEEDS_GL(kPlatform);
        pictured.emplace(ballMesh(3, 1), wave, pointFocus({0.4, -0.3, 0.2}, 0.2), SampleFormat::r32f, 33,
                         GlContextOptions{.replace = recordGlCalls});
        state = pictured->pool->state();
        options.camera = lookAt({3, -2, 2.5}, Vec3d(0), 24);
        options.channel = 1;
        options.function = even(0.3);
        options.boundsWorld = {Vec3d(-1), Vec3d(1)};
        options.brickNumbers.assign(pictured->bricks.size(), 0.5f);
    }
    GlCalls drawnBy(SliceRenderer& renderer, const std::vector<Effect>& effects) {
        options.effects = effects;
        GlCalls::take();
        renderer.draw(*pictured->pool, *state, pictured->frame, pictured->bricks, options, {});
        return GlCalls::take();
    }

    std::optional<Pictured> pictured;
    std::shared_ptr<const PoolState> state;
    RenderOptions options;
};

TEST_F(EffectCalls, AnEffectThatIsntNamedLeavesNoTextNoObjectAndNoCall) {
    SliceRenderer plain(pictured->thread);
    const GlCalls first = drawnBy(plain, {}), again = drawnBy(plain, {});
    EXPECT_EQ(first.texts.size(), 4u) << "two programs";
    EXPECT_TRUE(again.texts.empty());
    EXPECT_EQ(first.countOf("CreateTextures"), 2) << "colour and depth";
    EXPECT_EQ(first.countOf("CreateBuffers"), 2) << "bricks and stops";
    EXPECT_EQ(again.countOf("CreateTextures"), 0);
    EXPECT_GT(again.countOf("DrawArraysInstanced"), 0);
    for (const Effect& effect : everyEffect()) {
        SCOPED_TRACE(effect.name);
        for (const std::string& text : first.texts)
            for (const ShaderText& own : effect.texts) EXPECT_EQ(text.find(own.text), std::string::npos);
        std::vector<Effect> effects = everyEffect();
        std::erase_if(effects, [&](const Effect& other) { return other.name != effect.name; });
        SliceRenderer renderer(pictured->thread);
        EXPECT_NE(drawnBy(renderer, effects).texts, first.texts);
        effects.clear();
        const GlCalls erased = drawnBy(renderer, effects);
        ASSERT_EQ(erased.texts.size(), 2u);
        for (const std::string& text : erased.texts)
            EXPECT_NE(std::ranges::find(first.texts, text), first.texts.end());
        EXPECT_EQ(drawnBy(renderer, effects).calls, again.calls);
    }
    SliceRenderer other(pictured->thread);
    EXPECT_EQ(drawnBy(other, {}).calls, first.calls) << "after all of them";
}

TEST_F(EffectCalls, AShaderHasTheTextsOfItsEffectsAlone) {
    const std::vector<Effect> all = everyEffect();
    for (const Effect& effect : all) {
        SliceRenderer renderer(pictured->thread);
        const GlCalls calls = drawnBy(renderer, {effect});
        const auto holds = [&](const ShaderText& text) {
            return std::ranges::any_of(calls.texts, [&](const std::string& shader) {
                // Passes of an effect's own take what they need.
                return shader.find("local_size_x") == std::string::npos &&
                       shader.find(text.text) != std::string::npos;
            });
        };
        for (const Effect& other : all)
            for (const ShaderText& text : other.texts) {
                const bool isOwn =
                    std::ranges::find(effect.texts, text.name, &ShaderText::name) != effect.texts.end();
                EXPECT_EQ(holds(text), isOwn) << effect.name << ", " << text.name;
            }
    }
}

TEST_F(Effects, OneThatIsntNamedChangesNothing) {
    const RgbaImage before = pictured->draw(options);
    options.effects = {shadingEffect({}), brickEdgesEffect({})};
    EXPECT_NE(pictured->draw(options).pixels, before.pixels);
    options.effects.clear();
    EXPECT_EQ(pictured->draw(options).pixels, before.pixels);
    EXPECT_THROW(isosurfacesEffect({}), InputError);
    EXPECT_THROW(isosurfacesEffect(std::vector<Isosurface>(17)), InputError);
}

}  // namespace
}  // namespace tessera
