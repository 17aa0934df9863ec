#include "reference/ray_cast.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "reference/fields.h"
#include "reference/generators.h"
#include "refine/camera_view.h"
#include "refine/plan.h"
#include "refine/resample_tree.h"
#include "software/software_resampler.h"
#include "tessera/error.h"

namespace tessera {
namespace {

/// A mesh with one field, its bricks, and what draws them.
class Scene {
  public:
    Scene(TetMesh mesh, const PlaceFunction& field, Criterion criterion = Criterion::uniform)
        : mesh_(std::move(mesh)), nearest_(mesh_, 1) {
        addPointField(mesh_, "f", {field});
        RefineOptions options;
        options.criterion = criterion;
        options.resolution = criterion == Criterion::uniform ? 33 : 129;
        options.brickCells = 8;
        tree_ = planBricks(mesh_, options, {});
        ResampleStatistics statistics;
        store_ = resampleTree(tree_, *SoftwareResampler().bind(mesh_, fields_), 1, {}, statistics);
        reconstruction_.emplace(mesh_, fields_, tree_, store_, nearest_);
        caster_.emplace(tree_, *reconstruction_, 0, Execution{});
    }
    RgbaImage draw(const Camera& camera, const TransferFunction& function, const RayCastOptions& options = {},
                   const Execution& execution = {}) const {
        return caster_->draw(MeshRays(mesh_, camera, execution), function, options, execution);
    }
    const BrickTree& tree() const { return tree_; }

  private:
    TetMesh mesh_;
    const std::vector<int> fields_{0};
    NearestOnDemand nearest_;
    BrickTree tree_;
    BrickStore store_;
    std::optional<Reconstruction> reconstruction_;
    std::optional<RayCaster> caster_;
};

/// Looks obliquely at the unit box about (1/2, 1/2, 1/2).
Camera obliqueCamera(int pixels = 24) {
    const Vec3d eye(2.6, 1.9, 3.1);
    return {eye, Vec3d(0.5) - eye, {0, 1, 0}, 40, pixels, pixels};
}
TransferFunction evenly(double opacity) {
    return {"", {{0, {1, 0.5, 0.25}, opacity}}};
}

Vec3d directionOf(const Camera& camera, int x, int y) {
    return viewOf(camera).rayOf(camera, x, y).direction;
}

/// Where a ray is in a box; begin > end where it isn't.
RaySpan spanInBox(const Vec3d& eye, const Vec3d& direction, const Box3d& box) {
    RaySpan span{0, std::numeric_limits<double>::infinity()};
    for (int a = 0; a < 3; ++a) {
        const double low = (box.min[a] - eye[a]) / direction[a], high = (box.max[a] - eye[a]) / direction[a];
        span.begin = std::max(span.begin, std::min(low, high));
        span.end = std::min(span.end, std::max(low, high));
    }
    return span;
}

template <class Visit>
void forEachPixel(const Camera& camera, const Visit& visit) {
    for (int y = 0; y < camera.heightPixels; ++y)
        for (int x = 0; x < camera.widthPixels; ++x) visit(x, y);
}

TEST(RayCast, AnEvenMediumAbsorbsByTheExponentialOfThePath) {
    const Scene scene(boxMesh({.cells = Vec3i(3), .jitter = 0.2}), [](const Vec3d&) { return 1.0; });
    const Camera camera = obliqueCamera();
    const double layer = 0.3, absorption = -std::log(1 - 0.4) / layer;
    const RgbaImage image = scene.draw(camera, evenly(0.4), {.layerWorld = layer});
    int seen = 0;
    forEachPixel(camera, [&](int x, int y) {
        const RaySpan span = spanInBox(camera.eyeWorld, directionOf(camera, x, y), {Vec3d(0), Vec3d(1)});
        const double path = std::max(0.0, span.end - span.begin);
        const double alpha = 1 - std::exp(-absorption * path);
        seen += path > 0;
        EXPECT_NEAR(image.at(x, y)[3], alpha, 1e-6) << x << " " << y;
        EXPECT_NEAR(image.at(x, y)[0], alpha, 1e-6);
        EXPECT_NEAR(image.at(x, y)[1], alpha / 2, 1e-6);
        EXPECT_NEAR(image.at(x, y)[2], alpha / 4, 1e-6);
    });
    EXPECT_GT(seen, 100);
}

/// The integral of -ln(1 - v) over v.
double integralOfLog(double v) {
    return v + (1 - v) * std::log(1 - v);
}

TEST(RayCast, ALinearFieldOverSeveralLevelsConvergesByTheSquareOfTheStep) {
    // Elements shrink towards the middle, so levels change; a linear field is the same in all of them.
    const auto ramp = [](const Vec3d& p) { return 0.1 + 0.4 * p.x + 0.2 * p.y + 0.1 * p.z; };
    const Scene scene(gradedBoxMesh(12, 2, 0.1, 1), ramp, Criterion::elementSize);
    ASSERT_GE(scene.tree().levelCount(), 2);
    const TransferFunction function{"", {{0, {1, 1, 1}, 0}, {1, {1, 1, 1}, 1}}};
    const Camera camera = obliqueCamera();
    const auto worst = [&](double stepVoxels) {
        const RgbaImage image = scene.draw(camera, function, {.layerWorld = 0.5, .stepVoxels = stepVoxels});
        double most = 0;
        forEachPixel(camera, [&](int x, int y) {
            const Vec3d direction = directionOf(camera, x, y);
            const RaySpan span = spanInBox(camera.eyeWorld, direction, {Vec3d(0), Vec3d(1)});
            double alpha = 0;
            if (span.begin < span.end) {
                const double from = ramp(camera.eyeWorld + span.begin * direction);
                const double to = ramp(camera.eyeWorld + span.end * direction);
                const double depth =
                    (integralOfLog(to) - integralOfLog(from)) / (to - from) * (span.end - span.begin) / 0.5;
                alpha = 1 - std::exp(-depth);
            }
            most = std::max(most, std::abs(alpha - double(image.at(x, y)[3])));
        });
        return most;
    };
    const double coarse = worst(4), fine = worst(1);
    EXPECT_LT(worst(0.25), 1e-5);
    EXPECT_LT(fine, coarse / 10) << "a quarter of the step";
}

TEST(RayCast, APictureOfAThinShellHasConverged) {
    const Scene scene(boxMesh({.cells = Vec3i(6)}),
                      [](const Vec3d& p) { return glm::length(p - Vec3d(0.5)); });
    const TransferFunction shell{"", {{0.30, {1, 0, 0}, 0}, {0.34, {1, 1, 1}, 0.6}, {0.38, {0, 0, 1}, 0}}};
    const RayCastOptions options{.layerWorld = 0.05}, fine{.layerWorld = 0.05, .stepVoxels = 1.0 / 32};
    const Camera camera = obliqueCamera(32);
    const ImageDifference difference =
        differenceOf(scene.draw(camera, shell, options), scene.draw(camera, shell, fine));
    EXPECT_LT(difference.rms(32 * 32), 0.1 / 255);
}

TEST(RayCast, NothingIsDrawnOutsideTheMesh) {
    // Two boxes apart: the field between them would be seen if the reconstruction were taken there.
    TetMesh mesh = boxMesh({.cells = Vec3i(2), .sizeWorld = {0.31, 1, 1}});
    appendMesh(mesh, boxMesh({.cells = Vec3i(2), .originWorld = {0.67, 0, 0}, .sizeWorld = {0.33, 1, 1}}));
    const Scene scene(std::move(mesh), [](const Vec3d&) { return 1.0; });
    const Camera camera = obliqueCamera(48);
    const RgbaImage image = scene.draw(camera, evenly(0.5));
    int missed = 0, both = 0;
    forEachPixel(camera, [&](int x, int y) {
        double path = 0;
        int boxes = 0;
        for (const Box3d& box : {Box3d{Vec3d(0), {0.31, 1, 1}}, Box3d{{0.67, 0, 0}, Vec3d(1)}}) {
            const RaySpan span = spanInBox(camera.eyeWorld, directionOf(camera, x, y), box);
            path += std::max(0.0, span.end - span.begin);
            boxes += span.begin < span.end;
        }
        missed += boxes == 0;
        both += boxes == 2;
        if (boxes == 0)
            EXPECT_EQ(image.at(x, y), (Rgba{0, 0, 0, 0}));
        else
            EXPECT_NEAR(image.at(x, y)[3], 1 - std::exp(-std::log(2) * path), 1e-6);
    });
    EXPECT_GT(missed, 100);
    EXPECT_GT(both, 50);
}

TEST(RayCast, WhatIsInFrontHidesWhatIsBehind) {
    const Scene scene(boxMesh({.cells = Vec3i(4)}), [](const Vec3d& p) { return p.x; });
    const TransferFunction halves{"", {{0.5, {1, 0, 0}, 1}, {0.5, {0, 0, 1}, 1}}};
    const auto middle = [&](double eyeX, double forwardX) {
        const Camera camera{{eyeX, 0.52, 0.47}, {forwardX, 0, 0}, {0, 1, 0}, 10, 1, 1};
        return scene.draw(camera, halves).at(0, 0);
    };
    EXPECT_EQ(middle(-2, 1), (Rgba{1, 0, 0, 1}));
    EXPECT_EQ(middle(3, -1), (Rgba{0, 0, 1, 1}));
    EXPECT_EQ(middle(0.75, -1), (Rgba{0, 0, 1, 1})) << "from within the mesh";
    EXPECT_EQ(middle(3, 1), (Rgba{0, 0, 0, 0})) << "behind the eye";
}

TEST(RayCast, ValuesThatAreNotFiniteAreNotShown) {
    const Scene scene(boxMesh({}), [](const Vec3d&) { return std::numeric_limits<double>::quiet_NaN(); });
    for (const Rgba& pixel : scene.draw(obliqueCamera(8), evenly(0.5)).pixels)
        EXPECT_EQ(pixel, (Rgba{0, 0, 0, 0}));
}

TEST(RayCast, ThreadsDoNotChangeABit) {
    const Scene scene(sphereMesh(4), wavyField, Criterion::elementSize);
    const TransferFunction function{"", {{-0.5, {1, 0, 0}, 0}, {0, {0, 1, 0}, 0.5}, {0.7, {0, 0, 1}, 0.1}}};
    const RgbaImage one = scene.draw(obliqueCamera(), function, {}, {.threads = 1});
    EXPECT_EQ(one.pixels, scene.draw(obliqueCamera(), function, {}, {.threads = 3}).pixels);
}

TEST(RayCast, DifferencesAreOfColoursAlone) {
    const RgbaImage a{2, 1, {{0.5f, 0.5f, 0.5f, 1}, {0, 0, 0, 0}}};
    const RgbaImage b{2, 1, {{0.5f, 0.25f, 0.5f, 0.5f}, {0, 0, 0.5f, 0}}};
    const ImageDifference difference = differenceOf(a, b);
    EXPECT_DOUBLE_EQ(difference.largest, 0.5);
    EXPECT_DOUBLE_EQ(difference.rms(2), std::sqrt((0.0625 + 0.25) / 6));
    EXPECT_THROW(differenceOf(a, RgbaImage{}), InputError);
}

TEST(RayCast, RejectsStepsWithoutLength) {
    const Scene scene(boxMesh({}), wavyField);
    EXPECT_THROW(scene.draw(obliqueCamera(4), evenly(0.5), {.stepVoxels = 0}), InputError);
    EXPECT_THROW(scene.draw(obliqueCamera(4), evenly(0.5), {.layerWorld = -1}), InputError);
    EXPECT_THROW(scene.draw(obliqueCamera(4), {}), InputError);
}

}  // namespace
}  // namespace tessera
