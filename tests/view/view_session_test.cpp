#include "view/view_session.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <thread>

#include "brick_test_meshes.h"
#include "gl_test_tools.h"
#include "job/render_scene.h"
#include "scene/scene_file.h"
#include "tessera/error.h"
#include "vtu_text.h"

namespace tessera {
namespace {

using Json = SceneDocument::Json;
constexpr GlPlatform kPlatform = GlPlatform::eglSurfaceless;

class ViewSessionTest : public testing::Test {
  protected:
    void SetUp() override {
        TESSERA_NEEDS_GL(kPlatform);
        folder_ = std::filesystem::temp_directory_path() /
                  ("tessera-view-test-" + std::to_string(::getpid()) + "-" +
                   testing::UnitTest::GetInstance()->current_test_info()->name());
        std::filesystem::create_directories(folder_);
        TetMesh ball = ballMesh(6, 1);
        addPointField(ball, "f", [](const Vec3d& p) { return p.x + 0.3 * std::sin(5 * p.y); });
        addPointField(ball, "g", [](const Vec3d& p) { return glm::length(p); });
        path_ = (folder_ / "ball.vtu").string();
        test::VtuText text;
        text.points = ball.points;
        for (const auto& tet : ball.tets) text.cells.push_back({10, {tet.begin(), tet.end()}});
        for (const Field& field : ball.fields) {
            std::string values;
            for (const double value : field.values) values += test::VtuText::number(value) + " ";
            text.pointArrays.push_back({field.name, "Float64", 1, values});
        }
        std::ofstream(path_) << text.text();
        make();
    }
    void TearDown() override {
        session_.reset();
        std::filesystem::remove_all(folder_);
    }

    void make() {
        ViewOptions options;
        options.platform = kPlatform;
        options.frameMs = 30;
        session_ = std::make_unique<ViewSession>(Job{}, options);
        session_->document().change(
            {{"version", 1}, {"bricks", {{"resolution", 65}, {"cells", 8}}}, {"samples", 1}});
        session_->resize(90, 70);
    }
    /// Works until nothing is left to do.
    void settle() {
        for (int i = 0; i < 100000; ++i)
            if (session_->work(nullptr) == ViewSession::Did::nothing) {
                if (!session_->isOpening()) return;
                std::this_thread::sleep_for(std::chrono::milliseconds(1));
            }
        FAIL() << "it never comes to rest: " << session_->status();
    }
    void open() {
        session_->open(path_);
        settle();
        ASSERT_TRUE(session_->hasConverged()) << session_->status();
    }
    void edit(const std::function<void(Json&)>& change) {
        Json json = session_->document().json();
        change(json);
        session_->document().change(json);
    }
    std::string bytesOf(const std::string& path) {
        std::ifstream file(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    std::filesystem::path folder_;
    std::string path_;
    std::unique_ptr<ViewSession> session_;
};

TEST_F(ViewSessionTest, ItsPictureIsThatOfRenderForTheSceneItSaves) {
    open();
    edit([](Json& json) {
        json["bricks"]["focus"] = {{{"place", {0.5, 0.2, 0.1}}, {"radius", 0.2}}};
        json["transfer_function"] = {{"map", "magma"}, {"opacity", {{0, 0.1}, {1, 0.9}}}};
        json["clip"] = {{"planes", {{{"normal", {0, 1, 0}}, {"offset", -0.2}}}}};
        json["effects"] = {{"shading", Json::object()}};
        json["legend"] = false;
        json["samples"] = 4;
    });
    session_->document().change([&] {
        ViewCamera camera = session_->viewCamera();
        camera.orbit(0.2, 0.1);
        camera.zoom(1.5);
        Json json = session_->document().json();
        json["camera"] = camera.json();
        return json;
    }());
    settle();
    EXPECT_TRUE(session_->hasConverged());
    const std::string scene = (folder_ / "scene.json").string(), shown = (folder_ / "shown.png").string(),
                      drawn = (folder_ / "drawn.png").string();
    session_->saveScene(scene);
    session_->writePicture(shown);
    RenderRequest request;
    request.input = path_;
    request.output = drawn;
    request.scene = scene;
    request.platform = kPlatform;
    Job job;
    renderScene(request, job);
    EXPECT_EQ(bytesOf(shown), bytesOf(drawn));
    EXPECT_GT(bytesOf(shown).size(), 1000u);
    // Another session that opens the scene shows the same.
    make();
    session_->document() = SceneDocument::read(scene);
    session_->open(path_);
    settle();
    const std::string again = (folder_ / "again.png").string();
    session_->writePicture(again);
    EXPECT_EQ(bytesOf(again), bytesOf(shown));
}

TEST_F(ViewSessionTest, EffectsTakeWhatTheyNeedOfTheMesh) {
    open();
    edit([](Json& json) { json["legend"] = false; });
    settle();
    const std::vector<std::uint8_t> plain = session_->picture().rgb;
    edit([](Json& json) { json["effects"] = {{"outline", {{"edges", "all"}}}}; });
    settle();
    EXPECT_NE(session_->picture().rgb, plain);
    EXPECT_TRUE(session_->takeMessages().empty());
    // What the mesh doesn't have is said once, and the rest is drawn.
    edit([](Json& json) { json["effects"] = {{"errors", Json::object()}}; });
    settle();
    EXPECT_EQ(session_->picture().rgb, plain);
    const std::vector<std::string> messages = session_->takeMessages();
    ASSERT_EQ(messages.size(), 1u);
    EXPECT_NE(messages[0].find("effects.errors"), std::string::npos);
}

TEST_F(ViewSessionTest, WhatMovesIsCoarseAndConvergesAtRest) {
    open();
    const RgbImage converged = session_->picture();
    session_->setFrameMs(1);
    session_->takeFrames();
    session_->touch();
    edit([&](Json& json) {
        ViewCamera camera = session_->viewCamera();
        camera.orbit(0.1, 0);
        json["camera"] = camera.json();
    });
    while (session_->work(nullptr) != ViewSession::Did::drew) {
    }
    const std::vector<FrameTime> frames = session_->takeFrames();
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_TRUE(frames[0].isMoving);
    EXPECT_LT(frames[0].scale, 0.5);
    EXPECT_FALSE(session_->hasConverged());
    EXPECT_EQ(session_->picture().width, 90);
    session_->document().undo();
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    settle();
    EXPECT_TRUE(session_->hasConverged());
    EXPECT_EQ(session_->picture().rgb, converged.rgb);
}

TEST_F(ViewSessionTest, APictureAtRestGivesWay) {
    open();
    edit([](Json& json) { json["slices"] = 3; });
    const std::size_t before = session_->pictureNumber();
    int asked = 0;
    for (int i = 0; i < 5; ++i)
        session_->work([&] {
            ++asked;
            return true;
        });
    EXPECT_EQ(session_->pictureNumber(), before);
    EXPECT_GE(asked, 5);
    settle();
    EXPECT_GT(session_->pictureNumber(), before);
    EXPECT_TRUE(session_->hasConverged());
}

TEST_F(ViewSessionTest, UndoAndRedoTakeBackDragsWhole) {
    SceneDocument document;
    const Json first = document.json();
    for (int i = 1; i <= 10; ++i) document.drag({{"version", 1}, {"slices", 0.5 * i}});
    document.endDrag();
    document.change({{"version", 1}, {"slices", 7}});
    EXPECT_THROW(document.change({{"version", 1}, {"slices", "many"}}), InputError);
    EXPECT_EQ(document.scene().slicesAVoxel, 7);
    document.undo();
    EXPECT_EQ(document.scene().slicesAVoxel, 5);
    document.undo();
    EXPECT_EQ(document.json(), first);
    EXPECT_FALSE(document.canUndo());
    document.redo();
    document.redo();
    EXPECT_EQ(document.scene().slicesAVoxel, 7);
    EXPECT_FALSE(document.canRedo());
    document.undo();
    document.drag({{"version", 1}, {"slices", 2}});
    EXPECT_FALSE(document.canRedo());
    document.undo();
    EXPECT_EQ(document.scene().slicesAVoxel, 5);
}

TEST_F(ViewSessionTest, AFieldAndBricksAreChosenAnew) {
    open();
    EXPECT_EQ(session_->source()->title(), "f");
    ASSERT_EQ(session_->source()->fields().size(), 2u);
    const std::size_t bricks = session_->source()->bricks().size();
    edit([](Json& json) { json["field"] = "g"; });
    settle();
    EXPECT_EQ(session_->source()->title(), "g");
    EXPECT_NEAR(session_->source()->range().max, 1, 1e-6);
    edit([](Json& json) { json["bricks"]["resolution"] = 129; });
    settle();
    EXPECT_GT(session_->source()->bricks().size(), bricks);
    session_->document().undo();
    session_->document().undo();
    settle();
    EXPECT_EQ(session_->source()->title(), "f");
    EXPECT_EQ(session_->source()->bricks().size(), bricks);
    // What can't be leaves everything as it was.
    edit([](Json& json) { json["field"] = "none"; });
    EXPECT_THROW(settle(), InputError);
    EXPECT_EQ(session_->source()->title(), "f");
    settle();
    EXPECT_EQ(session_->source()->title(), "f");
    session_->open((folder_ / "nowhere.vtu").string());
    EXPECT_THROW(settle(), std::exception);
    settle();
    EXPECT_EQ(session_->path(), path_);
}

TEST_F(ViewSessionTest, SeesWhatIsUnderTheCursor) {
    open();
    edit([](Json& json) {
        json["camera"] = {{"eye", {0, -5, 0}}, {"target", {0, 0, 0}}};
        json["transfer_function"] = {{"stops", {{{"value", 0}, {"opacity", 1}}}}};
        json["legend"] = false;
    });
    settle();
    const auto seen = session_->seenAt(45, 35);
    ASSERT_TRUE(seen.has_value());
    // Opaque: the surface of the ball.
    EXPECT_NEAR(seen->placeWorld.y, -1, 0.1);
    EXPECT_NEAR(seen->placeWorld.x, 0, 0.02);
    EXPECT_NEAR(seen->value, seen->placeWorld.x + 0.3 * std::sin(5 * seen->placeWorld.y), 0.1);
    const auto pixel = session_->pixelOf(seen->placeWorld);
    ASSERT_TRUE(pixel.has_value());
    EXPECT_NEAR((*pixel)[0], 45, 1e-6);
    EXPECT_NEAR((*pixel)[1], 35, 1e-6);
    EXPECT_FALSE(session_->seenAt(1, 1).has_value());
}

TEST_F(ViewSessionTest, ALostContextIsReplaced) {
    // Its next call says that it is gone, as a driver would, and so do all later ones.
    std::vector<GlThread*> made;
    ViewOptions options;
    options.platform = kPlatform;
    options.makeThread = [&](GlPlatform platform) {
        auto thread = std::make_unique<GlThread>(platform);
        made.push_back(thread.get());
        return thread;
    };
    session_ = std::make_unique<ViewSession>(Job{}, options);
    session_->document().change(
        {{"version", 1}, {"bricks", {{"resolution", 65}, {"cells", 8}}}, {"samples", 1}});
    session_->resize(90, 70);
    open();
    const RgbImage before = session_->picture();
    EXPECT_THROW(made.back()->run([](GlContext& context) {
        auto& gl = const_cast<GlFunctions&>(context.functions());
        gl.GetError = []() -> GLenum { return GL_CONTEXT_LOST; };
    }),
                 GlError);
    edit([](Json& json) { json["slices"] = 3; });
    EXPECT_THROW(settle(), GlError);
    session_->recover();
    EXPECT_EQ(made.size(), 2u);
    session_->document().undo();
    settle();
    EXPECT_TRUE(session_->hasConverged());
    EXPECT_EQ(session_->picture().rgb, before.rgb);
    // The bricks go on following.
    const std::size_t bricks = session_->source()->bricks().size();
    edit([](Json& json) { json["bricks"]["focus"] = {{{"place", {0.9, 0, 0}}, {"radius", 0.4}}}; });
    settle();
    EXPECT_NE(session_->source()->bricks().size(), bricks);
}

TEST(ViewCamera, TurnsAboutWhatItLooksAt) {
    ViewCamera camera{{0, -4, 0}, {0, 0, 0}, {0, 0, 1}};
    camera.orbit(0.5, 0);
    EXPECT_NEAR(glm::length(camera.eyeWorld - Vec3d(-4, 0, 0)), 0, 1e-12);
    camera.orbit(-0.5, 0);
    camera.orbit(0, 10);  // over the pole it doesn't go
    EXPECT_NEAR(glm::length(camera.eyeWorld), 4, 1e-12);
    EXPECT_LT(std::abs(std::abs(camera.eyeWorld.z) - 4), 1e-3);
    camera = {{0, -4, 0}, {0, 0, 0}, {0, 0, 1}};
    camera.pan(0.25, 0.5);
    const double high = 2 * 4 * std::tan(35 * std::numbers::pi / 360);
    EXPECT_NEAR(camera.targetWorld.x, -0.25 * high, 1e-12);
    EXPECT_NEAR(camera.targetWorld.z, -0.5 * high, 1e-12);
    camera.zoom(2);
    EXPECT_NEAR(glm::length(camera.eyeWorld - camera.targetWorld), 2, 1e-12);
    camera.fly(0.5, 0, 0);
    EXPECT_NEAR(camera.targetWorld.y, 1, 1e-12);
}

}  // namespace
}  // namespace tessera
