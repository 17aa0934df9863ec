#include "reference/mesh_cast.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "reference/fields.h"
#include "reference/generators.h"
#include "reference/ray_cast.h"
#include "reference/ray_elements.h"
#include "refine/plan.h"
#include "refine/resample_tree.h"
#include "software/software_resampler.h"
#include "tessera/error.h"

namespace tessera {
namespace {

/// Looks obliquely at the unit box about (1/2, 1/2, 1/2).
Camera obliqueCamera(int pixels = 24) {
    const Vec3d eye(2.6, 1.9, 3.1);
    return {eye, Vec3d(0.5) - eye, {0, 1, 0}, 40, pixels, pixels};
}

double ramp(const Vec3d& p) {
    return 0.1 + 0.4 * p.x + 0.2 * p.y + 0.1 * p.z;
}

/// Stops between which colour and opacity both change, a step, and a value at which alone all light is
/// stopped.
TransferFunction rich() {
    return {"",
            {{0.2, {1, 0, 0}, 0.05},
             {0.35, {0, 1, 0.5}, 0.6},
             {0.45, {0.2, 0.3, 1}, 0},
             {0.45, {1, 1, 0}, 0.3},
             {0.55, {0, 0, 1}, 1},
             {0.65, {1, 0.2, 0.2}, 0.1}}};
}

/// The model by many short steps, the field from `valueAt` by the distance; NaN: nothing there.
template <class ValueAt>
std::array<double, 4> bySteps(const RaySpan& span, const TransferFunction& function, double layer, int steps,
                              const ValueAt& valueAt) {
    std::array<double, 4> sum{};
    double light = 1;
    const double length = (span.end - span.begin) / steps;
    for (int i = 0; i < steps; ++i) {
        const double value = valueAt(span.begin + (i + 0.5) * length);
        if (std::isnan(value)) continue;
        const std::array<double, 4> shown = shownAt(function, value);
        if (!(shown[3] > 0)) continue;
        const double passed = std::pow(1 - shown[3], length / layer);
        for (std::size_t c = 0; c < 3; ++c) sum[c] += light * (1 - passed) * shown[c] / shown[3];
        light *= passed;
    }
    sum[3] = 1 - light;
    return sum;
}

/// Where a ray is in a box; begin > end where it isn't.
RaySpan spanInBox(const ViewRay& ray, const Box3d& box) {
    RaySpan span{0, std::numeric_limits<double>::infinity()};
    for (int a = 0; a < 3; ++a) {
        const double low = (box.min[a] - ray.originWorld[a]) / ray.direction[a];
        const double high = (box.max[a] - ray.originWorld[a]) / ray.direction[a];
        span.begin = std::max(span.begin, std::min(low, high));
        span.end = std::min(span.end, std::max(low, high));
    }
    return span;
}
const Box3d kUnitBox{Vec3d(0), Vec3d(1)};

template <class Visit>
void forEachRay(const Camera& camera, const Visit& visit) {
    const CameraView view = viewOf(camera);
    for (int y = 0; y < camera.heightPixels; ++y)
        for (int x = 0; x < camera.widthPixels; ++x) visit(x, y, view.rayOf(camera, x, y));
}

TEST(MeshCast, ALinearFieldIsDrawnAsItsIntegral) {
    TetMesh mesh = boxMesh({.cells = Vec3i(3), .jitter = 0.2});
    addPointField(mesh, "f", {ramp});
    Camera camera = obliqueCamera();
    for (const double height : {0.0, 1.8}) {
        camera.heightWorld = height;
        for (const double layer : {0.5, 0.05}) {
            const RgbaImage image = castMesh(mesh, camera, {.function = rich(), .layerWorld = layer}, {});
            int seen = 0;
            double worst = 0;
            forEachRay(camera, [&](int x, int y, const ViewRay& ray) {
                const RaySpan span = spanInBox(ray, kUnitBox);
                if (!(span.begin < span.end)) {
                    ASSERT_EQ(image.at(x, y), Rgba{}) << x << " " << y;
                    return;
                }
                ++seen;
                const auto expected = bySteps(span, rich(), layer, 20'000, [&](double at) {
                    return ramp(ray.originWorld + at * ray.direction);
                });
                for (std::size_t c = 0; c < 4; ++c)
                    worst = std::max(worst, std::abs(expected[c] - double(image.at(x, y)[c])));
            });
            EXPECT_GT(seen, 100);
            // The steps themselves are off by this where the function is opaque.
            EXPECT_LT(worst, 2e-4) << height << " " << layer;
        }
    }
}

TEST(MeshCast, ARampToFullOpacityHasItsClosedForm) {
    TetMesh mesh = boxMesh({.cells = Vec3i(4), .jitter = 0.2});
    addPointField(mesh, "f", {[](const Vec3d& p) { return p.x; }});
    // Opaque at 1/2 alone: of the light exp(-1/2 / layer) is left.
    const TransferFunction peak{"", {{0.25, {0, 0, 0}, 0}, {0.5, {1, 1, 1}, 1}, {0.75, {0, 0, 0}, 0}}};
    const Camera camera{{-1, 0.47, 0.53}, {1, 0, 0}, {0, 0, 1}, 35, 5, 5, 0.6};
    for (const double layer : {0.1, 0.5, 3.0})
        for (const Rgba& pixel : castMesh(mesh, camera, {.function = peak, .layerWorld = layer}, {}).pixels) {
            EXPECT_NEAR(double(pixel[3]), -std::expm1(-0.5 / layer), 1e-6);
            EXPECT_EQ(pixel[0], pixel[1]);
        }
    // Opaque from 1/2 on: nothing gets through, and the colour beyond isn't seen.
    const TransferFunction wall{"", {{0.5, {0, 0, 0}, 0}, {0.5, {0.25, 0.5, 1}, 1}, {0.6, {1, 0, 0}, 1}}};
    for (const Rgba& pixel : castMesh(mesh, camera, {.function = wall}, {}).pixels) {
        EXPECT_EQ(pixel[3], 1);
        EXPECT_NEAR(pixel[0], 0.25, 1e-6);
        EXPECT_NEAR(pixel[2], 1, 1e-6);
    }
}

TEST(MeshCast, IsWhatRaysThroughFineBricksConvergeTo) {
    TetMesh mesh = gradedBoxMesh(6, 2, 0.1, 1);
    addPointField(mesh, "f", {ramp});
    const std::vector<int> fields{0};
    RefineOptions options;
    options.criterion = Criterion::uniform;
    options.resolution = 17;  // trilinear interpolation has a linear field exactly
    options.brickCells = 8;
    const BrickTree tree = planBricks(mesh, options, {});
    ResampleStatistics statistics;
    const BrickStore store = resampleTree(tree, *SoftwareResampler().bind(mesh, fields), 1, {}, statistics);
    const NearestOnDemand nearest(mesh, 1);
    const RayCaster caster(tree, {mesh, fields, tree, store, nearest}, 0, {});
    const Camera camera = obliqueCamera(32);
    const TransferFunction function{
        "", {{0.2, {1, 0, 0}, 0.05}, {0.4, {0, 1, 0.5}, 0.6}, {0.6, {1, 1, 0}, 0}, {0.7, {0, 0, 1}, 0.8}}};
    const RgbaImage rays =
        caster.draw(MeshRays(mesh, camera, {}), function, {.layerWorld = 0.3, .stepVoxels = 1.0 / 64}, {});
    const RgbaImage exact = castMesh(mesh, camera, {.function = function, .layerWorld = 0.3}, {});
    EXPECT_LT(differenceOf(rays, exact).largest, 1e-4);
    EXPECT_GT(differenceOf(exact, RgbaImage{32, 32, std::vector<Rgba>(32 * 32)}).largest, 0.5);
}

TEST(MeshCast, ElementsHaveTheirOwnValueInACellField) {
    TetMesh mesh = boxMesh({.cells = {4, 1, 1}});
    addCellField(mesh, "f", {[](const Vec3d& p) { return std::floor(4 * p.x); }});
    const TransferFunction function{
        "", {{0, {1, 0, 0}, 0.2}, {1, {0, 1, 0}, 0.5}, {2, {0, 0, 1}, 0}, {3, {1, 1, 1}, 1}}};
    const Camera camera{{-1, 0.47, 0.53}, {1, 0, 0}, {0, 0, 1}, 35, 3, 3, 0.6};
    const double first = 1 - std::pow(0.8, 0.25 / 0.5), second = 1 - std::pow(0.5, 0.25 / 0.5);
    const double left = (1 - first) * (1 - second);
    for (const Rgba& pixel : castMesh(mesh, camera, {.function = function, .layerWorld = 0.5}, {}).pixels) {
        EXPECT_NEAR(pixel[0], first + left, 1e-6);
        EXPECT_NEAR(pixel[1], (1 - first) * second + left, 1e-6);
        EXPECT_NEAR(pixel[2], left, 1e-6);
        EXPECT_EQ(pixel[3], 1);
    }
}

TEST(MeshCast, ElementsWithAValueThatIsNotFiniteAreNotDrawn) {
    for (const double odd : {std::numeric_limits<double>::quiet_NaN(), 1e300}) {
        TetMesh mesh = boxMesh({.cells = {4, 1, 1}});
        addPointField(mesh, "f", {[&](const Vec3d& p) { return p.x > 0.9 ? odd : 1; }});
        const TransferFunction even{"", {{0, {1, 1, 1}, 0.5}}};
        const Camera camera{{-1, 0.47, 0.53}, {1, 0, 0}, {0, 0, 1}, 35, 3, 3, 0.6};
        for (const Rgba& pixel : castMesh(mesh, camera, {.function = even, .layerWorld = 0.5}, {}).pixels)
            EXPECT_NEAR(pixel[3], 1 - std::pow(0.5, 0.75 / 0.5), 1e-6) << "up to x = 3/4";
    }
}

TEST(MeshCast, OfElementsThatOverlapTheOneOwnsAPlaceInWhichItLiesDeepest) {
    TetMesh mesh = overlappingMesh(30, 3);
    addRandomField(mesh, "f", FieldLocation::cell, 1, 0.5, 0.5, 5);
    const TransferFunction function{"", {{0, {1, 0, 0}, 0.1}, {0.5, {0, 1, 0}, 0.4}, {1, {0, 0, 1}, 0.2}}};
    const Camera camera = obliqueCamera(16);
    const RgbaImage image = castMesh(mesh, camera, {.function = function, .layerWorld = 0.3}, {});
    double worst = 0;
    int shared = 0;
    forEachRay(camera, [&](int x, int y, const ViewRay& ray) {
        const auto valueAt = [&](double at) {
            const Vec3d p = at * ray.direction;
            double deepest = 0, value = std::numeric_limits<double>::quiet_NaN();
            int owners = 0;
            for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
                const ElementPlanes planes = elementPlanes(mesh, e, ray.originWorld).value();
                double depth = std::numeric_limits<double>::infinity();
                for (std::size_t f = 0; f < 4; ++f)
                    depth = std::min(depth, (glm::dot(planes.normals[f], p) - planes.offsets[f]) /
                                                glm::length(planes.normals[f]));
                owners += depth > 0;
                if (depth > deepest) deepest = depth, value = mesh.fields[0].values[e];
            }
            shared += owners > 1;
            return value;
        };
        const auto expected = bySteps({2.5, 5.5}, function, 0.3, 1000, valueAt);
        for (std::size_t c = 0; c < 4; ++c)
            worst = std::max(worst, std::abs(expected[c] - double(image.at(x, y)[c])));
    });
    EXPECT_GT(shared, 500);
    EXPECT_LT(worst, 0.02) << "borders lie anywhere in a step";
}

TEST(MeshCast, ThreadsDoNotChangeABit) {
    TetMesh mesh = sphereMesh(4);
    addPointField(mesh, "f", {wavyField});
    const MeshCastOptions options{.function = rich(), .layerWorld = 0.1};
    EXPECT_EQ(castMesh(mesh, obliqueCamera(), options, {.threads = 1}).pixels,
              castMesh(mesh, obliqueCamera(), options, {.threads = 3}).pixels);
}

TEST(MeshCast, RefusesOptionsOutOfRange) {
    TetMesh mesh = boxMesh({.cells = Vec3i(1)});
    addPointField(mesh, "f", {ramp});
    const auto draw = [&](const MeshCastOptions& options) {
        return castMesh(mesh, obliqueCamera(2), options, {});
    };
    EXPECT_NO_THROW(draw({.function = rich()}));
    EXPECT_THROW(draw({}), InputError);
    EXPECT_THROW(draw({.function = rich(), .layerWorld = 0}), InputError);
    EXPECT_THROW(draw({.field = 1, .function = rich()}), InputError);
    EXPECT_THROW(draw({.component = 1, .function = rich()}), InputError);
}

}  // namespace
}  // namespace tessera
