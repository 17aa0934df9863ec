#include "scene/camera_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "mesh_test_tools.h"
#include "refine/camera_view.h"
#include "tessera/error.h"

namespace tessera {
namespace {

TEST(CameraPath, GoesThroughItsKeysSmoothly) {
    const CameraPath path({{.time = 0, .eyeWorld = {0, -5, 0}, .openingDegrees = 20},
                           {.time = 1, .eyeWorld = {2, -5, 1}, .openingDegrees = 40},
                           {.time = 4, .eyeWorld = {3, -1, 5}, .openingDegrees = 30}});
    EXPECT_EQ(path.at(0).eyeWorld, Vec3d(0, -5, 0));
    EXPECT_EQ(path.at(-3).eyeWorld, Vec3d(0, -5, 0));
    EXPECT_EQ(path.at(9).eyeWorld, Vec3d(3, -1, 5));
    constexpr double kStep = 1e-6;
    const auto x = [&](double time) { return path.at(time).eyeWorld->x; };
    EXPECT_NEAR(x(1), 2, 1e-12);
    EXPECT_NEAR(path.at(1).openingDegrees, 40, 1e-12);
    // The slope at a key is that between those beside it, from both sides.
    EXPECT_NEAR((x(1) - x(1 - kStep)) / kStep, 0.75, 1e-4);
    EXPECT_NEAR((x(1 + kStep) - x(1)) / kStep, 0.75, 1e-4);
    EXPECT_NEAR((x(kStep) - x(0)) / kStep, 2, 1e-4);
    // Keys on a line at even times are passed evenly.
    const CameraPath line({{.time = 0, .eyeWorld = {1, 2, 3}, .targetWorld = {0, 1, 0}},
                           {.time = 2, .eyeWorld = {2, 4, 6}, .targetWorld = {0, 1, 0}},
                           {.time = 4, .eyeWorld = {3, 6, 9}, .targetWorld = {0, 1, 0}}});
    for (double t = 0; t <= 4; t += 0.1) {
        EXPECT_NEAR(line.at(t).eyeWorld->z, 3 + 1.5 * t, 1e-12);
        EXPECT_NEAR(line.at(t).targetWorld->y, 1, 1e-12);
        EXPECT_NEAR(line.at(t).up.z, 1, 1e-12);
    }
}

TEST(CameraPath, IsReadStrictly) {
    const test::TemporaryFolder folder;
    const std::string file = folder.file("path.json");
    const auto read = [&](const std::string& text) {
        std::ofstream(file) << text;
        return readCameraPath(file);
    };
    const CameraPath path =
        read(R"({"version": 1, "keys": [{"eye": [1, 2, 3], "target": [0, 0, 0], "opening": 50},
        {"eye": [2, 2, 3], "target": [0, 0, 1], "up": [0, 2, 0]}]})");
    EXPECT_EQ(path.endTime(), 1);
    EXPECT_EQ(path.at(0).openingDegrees, 50);
    EXPECT_EQ(path.at(1).openingDegrees, 35);
    EXPECT_EQ(path.at(1).up, Vec3d(0, 1, 0));
    EXPECT_EQ(
        read(R"({"version": 1, "keys": [{"time": 2, "eye": [1, 2, 3], "target": [0, 0, 0], "height": 4}]})")
            .at(0)
            .heightWorld,
        4);
    const std::pair<const char*, const char*> cases[] = {
        {R"({"keys": []})", "version: expected a number"},
        {R"({"version": 1})", "keys: expected a list of keys"},
        {R"({"version": 1, "keys": []})", "keys: expected at least one key"},
        {R"({"version": 1, "keys": [{"eye": [1, 2, 3]}]})", "keys[0].target: expected three numbers"},
        {R"({"version": 1, "keys": [{"eye": [1, 2, 3], "target": [1, 2, 3]}]})",
         "keys[0].target: expected another"},
        {R"({"version": 1, "keys": [{"eye": [1, 2, 3], "target": [0, 2, 3], "fov": 3}]})",
         "unknown key \"fov\""},
        {R"({"version": 1, "keys": [{"eye": [1, 2, 3], "target": [0, 2, 3], "up": [0, 0, 0]}]})",
         "keys[0].up: expected a direction"},
        {R"({"version": 1, "keys": [{"eye": [1, 2, 3], "target": [0, 2, 3], "opening": 30, "height": 2}]})",
         "keys[0].opening: can't stand beside height"},
        {R"({"version": 1, "keys": [{"time": 1, "eye": [1, 2, 3], "target": [0, 2, 3]},
            {"time": 1, "eye": [1, 2, 3], "target": [0, 2, 3]}]})",
         "keys[1].time: expected a later time"},
        {R"({"version": 1, "keys": [{"eye": [1, 2, 3], "target": [0, 2, 3]},
            {"time": 1, "eye": [1, 2, 3], "target": [0, 2, 3]}]})",
         "keys[1]: all keys have a time, or none has"},
        {R"({"version": 1, "keys": [{"eye": [1, 2, 3], "target": [0, 2, 3]},
            {"height": 1, "eye": [1, 2, 3], "target": [0, 2, 3]}]})",
         "keys[1]: all keys have a height, or none has"}};
    for (const auto& [text, words] : cases) {
        std::string said = "not refused";
        try {
            read(text);
        } catch (const InputError& error) {
            said = error.what();
        }
        EXPECT_NE(said.find(words), std::string::npos) << text << "\n" << said;
        EXPECT_EQ(said.find(file), 0u) << said;
    }
}

TEST(CameraPath, AnOrbitHasAllOfTheDataInEveryPicture) {
    const Box3d box{{0, -1, 2}, {6, 1, 3}};
    const Vec3d middle = 0.5 * (box.min + box.max);
    for (const bool isParallel : {false, true}) {
        Scene scene;
        scene.hasLegend = false;
        scene.camera.isParallel = isParallel;
        double distance = 0;
        for (int n = 0; n < 24; ++n) {
            Scene turned = scene;
            turned.camera = orbited(scene, box, 0, n / 24.0);
            const Camera camera = cameraOf(turned, box, 0);
            const CameraView view = viewOf(camera);
            EXPECT_EQ(view.isParallel, isParallel);
            if (n > 0) {
                EXPECT_NEAR(glm::length(camera.eyeWorld - middle), distance, 1e-9);
            }
            distance = glm::length(camera.eyeWorld - middle);
            for (int c = 0; c < 8; ++c) {
                const Vec3d corner((c & 1 ? box.max : box.min).x, (c & 2 ? box.max : box.min).y,
                                   (c & 4 ? box.max : box.min).z);
                const Vec3d d = corner - camera.eyeWorld;
                const double away = isParallel ? 1 : glm::dot(d, view.forward);
                EXPECT_LT(std::abs(glm::dot(d, view.right)), away * view.wide);
                EXPECT_LT(std::abs(glm::dot(d, view.up)), away * view.high);
            }
        }
    }
    // A camera with an eye turns around what it looks at.
    Scene scene;
    scene.camera.eyeWorld = Vec3d(3, 0, 5);
    scene.camera.targetWorld = Vec3d(1, 0, 0);
    const Vec3d opposite = *orbited(scene, box, 0, 0.5).eyeWorld;
    EXPECT_NEAR(glm::length(opposite - Vec3d(-1, 0, 5)), 0, 1e-12);
    EXPECT_NEAR(glm::length(*orbited(scene, box, 0, 0.25).eyeWorld - Vec3d(1, 2, 5)), 0, 1e-12);
}

}  // namespace
}  // namespace tessera
