#include "scene/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "mesh_test_tools.h"
#include "refine/camera_view.h"
#include "scene/colour_maps.h"
#include "scene/scene_file.h"
#include "tessera/error.h"

namespace tessera {
namespace {

class SceneFile : public testing::Test {
  protected:
    Scene read(const std::string& text) const {
        std::ofstream(path()) << text;
        return readScene(path());
    }
    /// What is said of a scene that is refused.
    std::string refusal(const std::string& text) const {
        try {
            read(text);
        } catch (const InputError& error) {
            return error.what();
        }
        return "not refused";
    }
    std::string path() const { return folder_.file("scene.json"); }

  private:
    test::TemporaryFolder folder_;
};

TEST_F(SceneFile, OfAVersionAloneIsTheDefault) {
    const Scene scene = read(R"({"version": 1})");
    EXPECT_EQ(scene.field, "");
    EXPECT_EQ(scene.function.map, "viridis");
    EXPECT_EQ(scene.width, 1024);
    EXPECT_TRUE(scene.hasLegend);
    EXPECT_TRUE(scene.within.empty());
}

TEST_F(SceneFile, SaysAllThatASceneHas) {
    const Scene scene = read(R"({"$schema": "scene.schema.json", "version": 1, "field": "V", "component": 2,
        "camera": {"eye": [1, 2, 3], "target": [0, 0, 1], "up": [0, 2, 0], "height": 4},
        "transfer_function": {"map": "cool-warm", "range": [1, 100], "log": true,
                              "opacity": [[0, 0], [0.5, 0.25], [0.5, 1]]},
        "layer": 0.5, "background": [0, 0.5, 1],
        "clip": {"box": [0, 1, 2, 3, 4, 5], "planes": [{"normal": [0, 0, 2], "offset": 3}]},
        "length_unit": "mm",
        "effects": {"errors": {"bound": 0.01}, "outline": {"mesh": "wing.vtu", "angle": 45}, "axes": {}, "scale_bar": {}, "shading": {"light": [0, 0, 3], "specular": 0}, "bricks": {}, "preintegration": {},
                    "occlusion": {"voxels": 4, "strength": 0.5},
                    "shadows": {"light": [0, 0, 2], "strength": 0.5, "resolution": 64},
                    "cuts": {"planes": [{"normal": [0, 0, 2], "offset": 3, "opacity": 0.5}],
                             "contours": {"values": [1, 2], "width": 2, "color": [1, 1, 1]}},
                    "probes": {"shapes": [{"difference": [{"box": [0, 0, 0, 1, 1, 1]},
                                                          {"sphere": {"center": [0, 0, 0], "radius": 1}}]},
                                          {"plane": {"normal": [0, 1, 0], "offset": 0}}],
                               "keep": "inside", "opacity": 0.5, "lit": true, "light": [1, 0, 0]},
                    "isosurfaces": {"surfaces": [{"value": 3}, {"value": 1, "color": [1, 0, 0], "opacity": 0.5}]}},
        "size": [640, 480], "samples": 9, "slices": 4, "legend": false, "unit": "m/s"})");
    EXPECT_EQ(scene.field, "V");
    EXPECT_EQ(scene.component, 2);
    EXPECT_EQ(scene.camera.eyeWorld, Vec3d(1, 2, 3));
    EXPECT_EQ(scene.camera.targetWorld, Vec3d(0, 0, 1));
    EXPECT_EQ(scene.camera.up, Vec3d(0, 1, 0));
    EXPECT_EQ(scene.camera.heightWorld, 4);
    EXPECT_EQ(scene.function.map, "cool-warm");
    EXPECT_EQ(scene.function.range, (std::array<double, 2>{1, 100}));
    EXPECT_TRUE(scene.function.isLogarithmic);
    EXPECT_EQ(scene.function.opacities.size(), 3u);
    EXPECT_EQ(scene.layerWorld, 0.5);
    EXPECT_EQ(scene.ground, (std::array<double, 3>{0, 0.5, 1}));
    ASSERT_EQ(scene.within.size(), 7u);
    EXPECT_EQ(scene.within[1].normalWorld, Vec3d(-1, 0, 0));
    EXPECT_EQ(scene.within[1].offsetWorld, -3);
    EXPECT_EQ(scene.within[6].normalWorld, Vec3d(0, 0, 1));
    EXPECT_EQ(scene.within[6].offsetWorld, 1.5);
    EXPECT_EQ(scene.width, 640);
    EXPECT_EQ(scene.height, 480);
    EXPECT_EQ(scene.samplesAPixel, 9);
    EXPECT_EQ(scene.slicesAVoxel, 4);
    EXPECT_FALSE(scene.hasLegend);
    EXPECT_EQ(scene.unit, "m/s");
    EXPECT_EQ(scene.lengthUnit, "mm");
    std::vector<std::string> names;
    for (const Effect& effect : scene.effects) names.push_back(effect.name);
    EXPECT_EQ(names, (std::vector<std::string>{"axes", "bricks", "cuts", "errors", "isosurfaces", "outline",
                                               "preintegration", "probes", "scale_bar", "shading",
                                               "occlusion", "shadows"}));
    EXPECT_EQ(scene.outline.mesh, path().substr(0, path().rfind('/') + 1) + "wing.vtu");
    EXPECT_EQ(scene.outline.shown.leastDegrees, 45);
    // Units are in what effects write.
    const LineView view{{{0, -9, 0}, {0, 1, 0}, {0, 0, 1}}, {Vec3d(-1), Vec3d(1)}};
    EXPECT_TRUE(linesOf(scene.effects, view).marks.words.back().text.ends_with(" mm"));
}

TEST_F(SceneFile, LargerThanAnySceneIsNotRead) {
    EXPECT_EQ(refusal(std::string((16 << 20) + 1, ' ')), path() + ": larger than 16 MiB");
}

TEST_F(SceneFile, IsRefusedWithThePlaceOfWhatIsWrong) {
    const std::pair<const char*, const char*> cases[] = {
        {"{", "not JSON"},
        {"[]", "the scene: expected an object"},
        {"{}", "version: expected a number"},
        {R"({"version": 1, "size": [4, 4], "size": [5, 5]})", "the key \"size\" stands twice"},
        {"[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]",
         "nested more than 32 deep"},
        {R"({"version": 1, "transfer_function": {"range": [-1.7e308, 1.7e308]}})",
         "transfer_function.range: exp"},
        {R"({"version": 1, "clip": {"planes": [{"normal": [1e-150, 0, 0], "offset": 1e300}]}})",
         "clip.planes[0].offset: expected a number that isn't so large"},
        {R"({"version": 2})", "version: expected 1"},
        {R"({"version": 1, "colour": 3})", "unknown key \"colour\"; it knows"},
        {R"({"version": 1, "field": 3})", "field: expected a text"},
        {R"({"version": 1, "component": 1.5})", "component: expected a whole number from 0 to 8"},
        {R"({"version": 1, "component": -1})", "component: expected a whole number"},
        {R"({"version": 1, "size": [0, 10]})", "size[0]: expected a whole number from 1 to 32768"},
        {R"({"version": 1, "size": 10})", "size: expected width and height"},
        {R"({"version": 1, "samples": 2})", "samples: expected 1, 4, 9 or 16"},
        {R"({"version": 1, "slices": 0})", "slices: expected a number from 0.125 to 64"},
        {R"({"version": 1, "legend": "no"})", "legend: expected true or false"},
        {R"({"version": 1, "layer": 0})", "layer: expected a number above 0"},
        {R"({"version": 1, "layer": 1e999})", "not JSON"},
        {R"({"version": 1, "background": [0, 0, 2]})", "background: expected three numbers from 0 to 1"},
        {R"({"version": 1, "camera": 1})", "camera: expected an object"},
        {R"({"version": 1, "camera": {"eye": [1, 2]}})", "camera.eye: expected three numbers"},
        {R"({"version": 1, "camera": {"target": [1, 2, 3]}})", "camera.target: needs an eye"},
        {R"({"version": 1, "camera": {"eye": [1, 2, 3], "target": [1, 2, 3]}})", "another place"},
        {R"({"version": 1, "camera": {"eye": [1, 2, 3], "direction": [1, 0, 0]}})",
         "camera.direction: can't stand beside eye"},
        {R"({"version": 1, "camera": {"height": 3}})", "camera.height: needs an eye"},
        {R"({"version": 1, "camera": {"up": [0, 0, 0]}})", "camera.up: expected a direction"},
        {R"({"version": 1, "camera": {"opening": 180}})",
         "camera.opening: expected a number from 0.1 to 170"},
        {R"({"version": 1, "transfer_function": {"map": "jet"}})",
         "transfer_function.map: expected one of viridis, cividis, magma, turbo, cool-warm, gray"},
        {R"({"version": 1, "transfer_function": {"range": [2, 1]}})", "transfer_function.range: expected"},
        {R"({"version": 1, "transfer_function": {"opacity": []}})", "transfer_function.opacity: expected"},
        {R"({"version": 1, "transfer_function": {"opacity": [[0.5, 1], [0.2, 1]]}})", "ascending"},
        {R"({"version": 1, "transfer_function": {"stops": [{"value": 1}]}})",
         "transfer_function.stops[0].opacity: expected a number"},
        {R"({"version": 1, "transfer_function": {"map": "gray", "stops": [{"value": 1, "opacity": 1}]}})",
         "transfer_function.map: can't stand beside stops"},
        {R"({"version": 1, "effects": {"glow": {}}})", "effects: unknown key \"glow\"; it knows axes"},
        {R"({"version": 1, "effects": {"axes": {"width": 0}}})", "effects.axes.width: expected a number"},
        {R"({"version": 1, "effects": {"axes": {"color": [2, 0, 0]}}})",
         "effects.axes.color: expected three"},
        {R"({"version": 1, "effects": {"scale_bar": {"length": 1}}})",
         "effects.scale_bar: unknown key \"length\""},
        {R"({"version": 1, "effects": {"errors": {"bound": 0}}})",
         "effects.errors.bound: expected a number above 0"},
        {R"({"version": 1, "effects": {"outline": {"edges": "some"}}})",
         "effects.outline.edges: expected sharp or all"},
        {R"({"version": 1, "effects": {"outline": {"edges": "all", "angle": 20}}})",
         "effects.outline.angle: can't stand beside all edges"},
        {R"({"version": 1, "effects": {"errors": {"bound": 0.01}, "outline": {"mesh": ""}}})",
         "effects.outline.mesh: expected the name of a file"},
        {R"({"version": 1, "length_unit": 1})", "length_unit: expected a text"},
        {R"({"version": 1, "effects": {"occlusion": {"radius": 1, "voxels": 4}}})",
         "effects.occlusion.voxels: can't stand beside radius"},
        {R"({"version": 1, "effects": {"occlusion": {"radius": 0}}})",
         "effects.occlusion.radius: expected a number above 0"},
        {R"({"version": 1, "effects": {"shadows": {}}})", "effects.shadows.light: expected"},
        {R"({"version": 1, "effects": {"shadows": {"light": [0, 0, 1], "resolution": 1000}}})",
         "effects.shadows.resolution: expected a whole number from 8 to 512"},
        {R"({"version": 1, "effects": {"preintegration": {"table": 2}}})",
         "effects.preintegration: unknown key \"table\"; it knows none"},
        {R"({"version": 1, "effects": {"cuts": {"planes": []}}})",
         "effects.cuts.planes: expected a list of 1 to 16"},
        {R"({"version": 1, "effects": {"cuts": {"planes": [{"normal": [0, 0, 0], "offset": 1}]}}})",
         "effects.cuts.planes[0].normal: expected a direction"},
        {R"({"version": 1, "effects": {"cuts": {"planes": [{"normal": [0, 0, 1], "offset": 1}],
            "contours": {"values": [1], "count": 3}}}})",
         "effects.cuts.contours.count: can't stand beside values"},
        {R"({"version": 1, "effects": {"probes": {"shapes": [{}]}}})",
         "effects.probes.shapes[0]: expected a plane, sphere, box"},
        {R"({"version": 1, "effects": {"probes": {"shapes": [{"union": [{"sphere": {"center": [0, 0, 0]}}]}]}}})",
         "effects.probes.shapes[0].union[0].sphere.radius: expected a number"},
        {R"({"version": 1, "effects": {"probes": {"shapes": [{"box": [0, 0, 0, 1, 1, 1],
            "plane": {"normal": [0, 0, 1], "offset": 1}}]}}})",
         "effects.probes.shapes[0].box: can't stand beside another shape"},
        {R"({"version": 1, "effects": {"probes": {"keep": "all", "shapes": [{"box": [0, 0, 0, 1, 1, 1]}]}}})",
         "effects.probes.keep: expected inside or outside"},
        {R"({"version": 1, "effects": {"shading": {"ambient": 2}}})",
         "effects.shading.ambient: expected a number from 0 to 1"},
        {R"({"version": 1, "effects": {"shading": {"light": [0, 0, 0]}}})",
         "effects.shading.light: expected a dir"},
        {R"({"version": 1, "effects": {"isosurfaces": {"surfaces": []}}})",
         "effects.isosurfaces.surfaces: expected a list of 1 to 16"},
        {R"({"version": 1, "effects": {"isosurfaces": {"surfaces": [{}]}}})",
         "effects.isosurfaces.surfaces[0].value: expected a number"},
        {R"({"version": 1, "effects": {"bricks": {"width": 0}}})", "effects.bricks.width: expected a number"},
        {R"({"version": 1, "clip": {"box": [0, 0, 0, 1, 0, 1]}})", "clip.box: expected"},
        {R"({"version": 1, "clip": {"planes": [{"normal": [0, 0, 0], "offset": 1}]}})",
         "clip.planes[0].normal: expected a direction"},
        {R"({"version": 1, "clip": {"planes": [{"normal": [0, 0, 1]}]}})",
         "clip.planes[0].offset: expected a number"}};
    for (const auto& [text, words] : cases) {
        const std::string said = refusal(text);
        EXPECT_NE(said.find(words), std::string::npos) << text << "\n" << said;
        EXPECT_EQ(said.find(path()), 0u) << said;
    }
}

TEST(SceneCamera, WithoutAnEyeSeesAllOfABox) {
    const Box3d box{{-3, 10, 0.1}, {5, 11, 0.2}};
    for (const bool isParallel : {false, true})
        for (const Vec3d& direction :
             {Vec3d(-0.6, 0.75, -0.45), Vec3d(1, 0, 0), Vec3d(0, 0, -1), Vec3d(0, 0, 1), Vec3d(0.1, -2, 3)})
            for (const auto& [width, height] : {std::pair(1024, 768), std::pair(200, 900)}) {
                Scene scene;
                scene.width = width;
                scene.height = height;
                scene.camera.direction = direction;
                scene.camera.isParallel = isParallel;
                const Camera camera = cameraOf(scene, box, 100);
                const CameraView view = viewOf(camera);
                EXPECT_EQ(view.isParallel, isParallel);
                double most = 0;
                for (unsigned c = 0; c < 8; ++c) {
                    Vec3d p;
                    for (int a = 0; a < 3; ++a) p[a] = (c >> a & 1 ? box.max : box.min)[a];
                    p -= camera.eyeWorld;
                    const double depth = glm::dot(p, view.forward);
                    EXPECT_GT(depth, 0);
                    const double scale = isParallel ? 1 : depth;
                    const double x = std::abs(glm::dot(p, view.right)) / (scale * view.wide),
                                 y = std::abs(glm::dot(p, view.up)) / (scale * view.high);
                    EXPECT_LT(x, 1 - 150.0 / width * (width > 500 ? 1 : 0.5));
                    EXPECT_LT(y, 0.9);
                    most = std::max(
                        {most, x / (1 - 2 * std::max(0.06, std::min(100.0 / width, 0.25))), y / 0.88});
                }
                EXPECT_NEAR(most, 1, 1e-9) << "as large as it can be";
            }
}

TEST(SceneFunction, OfAMapHasItsColoursOverTheRange) {
    SceneFunction function;
    function.map = "gray";
    function.opacities = {{0, 0}, {0.5, 0.2}, {0.5, 0.8}, {1, 0.4}};
    const TransferFunction made = functionOf(function, {2, 6}, {});
    checkTransferFunction(made);
    const auto shown = [&](double value) { return shownAt(made, value); };
    EXPECT_NEAR(shown(3)[3], 0.1, 1e-12);
    EXPECT_NEAR(shown(3)[0], 0.1 * 0.25, 1e-12);
    EXPECT_NEAR(shown(3.999999)[3], 0.2, 1e-5);
    EXPECT_NEAR(shown(4)[3], 0.8, 1e-12) << "a step";
    EXPECT_NEAR(shown(5)[3], 0.6, 1e-12);
    EXPECT_NEAR(shown(100)[3], 0.4, 1e-12);
    function.range = {1, 1000};
    function.isLogarithmic = true;
    const TransferFunction logarithmic = functionOf(function, {2, 6}, {});
    checkTransferFunction(logarithmic);
    EXPECT_NEAR(shownAt(logarithmic, std::pow(1000.0, 0.25))[3], 0.1, 1e-4);
    function.range = {-1, 1};
    EXPECT_THROW(functionOf(function, {2, 6}, {}), InputError);
}

TEST(SceneFunction, WithoutOpacitiesShowsWhatIsRare) {
    const std::vector<double> histogram{0.9, 0.05, 0, 0.05};
    const TransferFunction made = functionOf({}, {0, 4}, histogram);
    checkTransferFunction(made);
    EXPECT_LT(shownAt(made, 0.2)[3], 0.01) << "but it isn't nothing";
    EXPECT_GT(shownAt(made, 0.2)[3], 0);
    EXPECT_LT(shownAt(made, 0.8)[3], 0.01);
    EXPECT_GT(shownAt(made, 1.5)[3], 0.3);
    EXPECT_NEAR(shownAt(made, 2.5)[3], 0.6, 1e-9);
    // One value, and none of a histogram.
    const TransferFunction single = functionOf({}, {3, 3}, std::vector<double>{1, 0});
    EXPECT_EQ(single.stops.size(), 1u);
    EXPECT_GT(functionOf({}, {3, 3}, {}).stops[0].opacity, 0);
}

TEST(ColourMaps, AreColoursFromEndToEnd) {
    EXPECT_EQ(colourMapNames().size(), 6u);
    for (const std::string_view name : colourMapNames()) {
        EXPECT_TRUE(isColourMap(name));
        EXPECT_NE(mappedColour(name, 0), mappedColour(name, 1));
        EXPECT_EQ(mappedColour(name, -1), mappedColour(name, 0));
        for (int i = 0; i < 100; ++i) {
            const auto a = mappedColour(name, i / 100.0), b = mappedColour(name, (i + 1) / 100.0);
            for (std::size_t c = 0; c < 3; ++c) {
                EXPECT_GE(a[c], 0);
                EXPECT_LE(a[c], 1);
                EXPECT_NEAR(a[c], b[c], 0.07) << name << i;
            }
        }
    }
    EXPECT_FALSE(isColourMap("jet"));
}

}  // namespace
}  // namespace tessera
