#include "view/view_session.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <thread>

#include "brick_test_meshes.h"
#include "gl_test_tools.h"
#include "job/render_scene.h"
#include "job/resample_files.h"
#include "scene/scene_file.h"
#include "tessera/error.h"
#include "view/fresh_name.h"
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
    session_->setFrameMs(1e-3);
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

/// A device whose 3D textures get no memory beyond a bound. One thread at a time.
struct TextureMemory {
    static inline std::int64_t mostTexels = std::numeric_limits<std::int64_t>::max();
    static inline bool hasFailed = false;
    static inline decltype(GlFunctions::TextureStorage3D) realStorage = nullptr;
    static inline decltype(GlFunctions::GetError) realError = nullptr;

    /// For GlContextOptions::replace.
    static void bound(GlFunctions& gl) {
        realStorage = gl.TextureStorage3D;
        realError = gl.GetError;
        gl.TextureStorage3D = [](GLuint texture, GLsizei levels, GLenum format, GLsizei width, GLsizei height,
                                 GLsizei depth) {
            hasFailed = std::int64_t(width) * height * depth > mostTexels;
            if (!hasFailed) realStorage(texture, levels, format, width, height, depth);
        };
        gl.GetError = []() -> GLenum {
            return std::exchange(hasFailed, false) ? GL_OUT_OF_MEMORY : realError();
        };
    }
    explicit TextureMemory(std::int64_t texels) { mostTexels = texels; }
    ~TextureMemory() { mostTexels = std::numeric_limits<std::int64_t>::max(); }
};

class SmallDevice : public ViewSessionTest {
  protected:
    void makeSmall() {
        ViewOptions options;
        options.platform = kPlatform;
        options.makeThread = [](GlPlatform platform) {
            return std::make_unique<GlThread>(platform, GlContextOptions{.replace = TextureMemory::bound});
        };
        session_ = std::make_unique<ViewSession>(Job{}, options);
        session_->resize(90, 70);
    }
    std::size_t files() const {
        return std::size_t(std::distance(std::filesystem::directory_iterator(folder_), {}));
    }
    /// More bricks than the texels that a pool has at first.
    const Json kManyBricks = {
        {"version", 1},
        {"samples", 1},
        {"bricks", {{"resolution", 193}, {"focus", {{{"place", {0, 0, 0}}, {"radius", 2}}}}}}};
    /// A pool begins with about 3 million texels.
    static constexpr std::int64_t kTexels = 4'000'000;
};

TEST_F(SmallDevice, ShowsAsManyBricksAsItHolds) {
    makeSmall();
    session_->document().change(kManyBricks);
    {
        const TextureMemory memory(kTexels);
        open();
        EXPECT_TRUE(session_->mesh()->live().isDeviceFull());
        EXPECT_NE(session_->status().find("as many as the device holds"), std::string::npos)
            << session_->status();
        EXPECT_GT(session_->source()->bricks().size(), 300u);
        EXPECT_LE(session_->source()->bricks().size(), session_->source()->pool().capacity());
        // They go on following, within what there is.
        const std::vector<std::uint8_t> before = session_->picture().rgb;
        edit([](Json& json) { json["bricks"]["focus"][0] = {{"place", {0.9, 0, 0}}, {"radius", 0.3}}; });
        settle();
        EXPECT_TRUE(session_->hasConverged());
        EXPECT_NE(session_->picture().rgb, before);
    }
    // Another one may have more.
    session_->recover();
    settle();
    EXPECT_FALSE(session_->mesh()->live().isDeviceFull());
}

TEST_F(SmallDevice, ThatHoldsNothingIsAnError) {
    makeSmall();
    const TextureMemory memory(1000);
    session_->open(path_);
    EXPECT_THROW(settle(), GlMemoryError);
    settle();
    EXPECT_EQ(session_->source(), nullptr);
}

TEST_F(SmallDevice, LeavesNoHalfPicture) {
    ResampleRequest resample;
    resample.inputs = {path_};
    resample.output = (folder_ / "ball.vdb").string();
    resample.format = &outputFormats().front();
    resample.write.criterion = "uniform";
    resample.refine.criterion = Criterion::uniform;
    resample.refine.resolution = 33;
    Job job;
    resampleFiles(resample, job);
    RenderRequest request;
    request.output = (folder_ / "ball.png").string();
    request.platform = kPlatform;
    request.size = {90, 70};
    GlThread& thread = sharedGlThread(kPlatform);
    const auto replace = [&](const GlFunctions& by) {
        thread.run([&](GlContext& context) { const_cast<GlFunctions&>(context.functions()) = by; });
    };
    const GlFunctions before = thread.run([](GlContext& context) { return context.functions(); });
    GlFunctions bounded = before;
    TextureMemory::bound(bounded);
    replace(bounded);
    const std::size_t there = files();
    for (const std::string& input : {resample.output, path_}) {
        const TextureMemory memory(1000);
        request.input = input;
        EXPECT_THROW(renderScene(request, job), GlMemoryError) << input;
        EXPECT_EQ(files(), there);
    }
    // Of a mesh there may be fewer bricks, and that is said.
    std::vector<std::string> said;
    job.fellShort = [&](const std::string& sentence) { said.push_back(sentence); };
    const std::string scene = (folder_ / "scene.json").string();
    std::ofstream(scene) << kManyBricks;
    request.scene = scene;
    {
        const TextureMemory memory(kTexels);
        renderScene(request, job);
    }
    ASSERT_EQ(said.size(), 1u);
    EXPECT_NE(said[0].find("no memory for as many bricks"), std::string::npos);
    replace(before);
    said.clear();
    request.input = resample.output;
    request.scene.clear();
    renderScene(request, job);
    EXPECT_TRUE(said.empty());
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

TEST_F(ViewSessionTest, AnotherFileTakesThePlaceOfTheSceneOnlyWhenItIsThere) {
    open();
    edit([](Json& json) {
        json["slices"] = 3;
        json["effects"] = {{"axes", Json::object()}};
        json["clip"] = {{"planes", {{{"normal", {0, 1, 0}}, {"offset", -0.2}}}}};
    });
    settle();
    const Json before = session_->document().json();
    const std::vector<std::uint8_t> shown = session_->picture().rgb;
    session_->open((folder_ / "nowhere.vtu").string());
    EXPECT_THROW(settle(), std::exception);
    settle();
    EXPECT_EQ(session_->document().json(), before);
    EXPECT_TRUE(session_->hasConverged());
    EXPECT_EQ(session_->picture().rgb, shown);
    // The same file, again: nothing of the scene is another file's.
    session_->open(path_);
    settle();
    EXPECT_EQ(session_->document().json(), before);
    const std::string other = (folder_ / "other.vtu").string();
    std::filesystem::copy_file(path_, other);
    session_->open(other);
    settle();
    EXPECT_EQ(session_->path(), other);
    EXPECT_FALSE(session_->document().json().contains("effects"));
    EXPECT_FALSE(session_->document().json().contains("clip"));
    EXPECT_EQ(session_->document().scene().slicesAVoxel, 3);
    EXPECT_FALSE(session_->document().canUndo()) << "what was before is another file's";
    // A scene that doesn't fit the first file isn't in the way of the next one.
    make();
    edit([](Json& json) { json["field"] = "none"; });
    session_->open(path_);
    EXPECT_THROW(settle(), InputError);
    session_->open(other);
    settle();
    EXPECT_TRUE(session_->hasConverged());
}

TEST_F(ViewSessionTest, ASceneThatComesWithAFileIsForThatFile) {
    open();
    const std::string other = (folder_ / "other.vtu").string();
    std::filesystem::copy_file(path_, other);
    session_->open(other);
    session_->useScene({{"version", 1}, {"field", "g"}, {"bricks", {{"resolution", 33}, {"cells", 8}}}});
    EXPECT_EQ(session_->document().scene().field, "");
    EXPECT_THROW(session_->useScene({{"version", 2}}), InputError);
    settle();
    EXPECT_EQ(session_->path(), other);
    EXPECT_EQ(session_->source()->title(), "g");
    session_->useScene({{"version", 1}, {"field", "f"}, {"bricks", {{"resolution", 33}, {"cells", 8}}}});
    settle();
    EXPECT_EQ(session_->source()->title(), "f");
    EXPECT_TRUE(session_->document().canUndo());
}

TEST(FreshName, NeverNamesWhatIsThere) {
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("tessera-fresh-name-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    const std::string path = (folder / "my.picture.png").string();
    EXPECT_EQ(freshName(path), path);
    std::ofstream{path};
    EXPECT_EQ(freshName(path), (folder / "my.picture-2.png").string());
    std::filesystem::create_symlink("nowhere", folder / "my.picture-2.png");
    EXPECT_EQ(freshName(path), (folder / "my.picture-3.png").string());
    EXPECT_EQ(freshName("picture-of-nothing.png"), "picture-of-nothing.png");
    std::filesystem::remove_all(folder);
}

TEST_F(ViewSessionTest, OfFilesOpenedAtOnceTheLastOneIsShown) {
    const std::string other = (folder_ / "other.vtu").string();
    std::filesystem::copy_file(path_, other);
    session_->open(path_);
    session_->open((folder_ / "nowhere.vtu").string());
    session_->open(other);
    settle();
    EXPECT_EQ(session_->path(), other);
    EXPECT_TRUE(session_->hasConverged());
    EXPECT_TRUE(session_->takeMessages().empty());
}

TEST_F(ViewSessionTest, AContextThatIsLostWhileAFileIsReadIsReplaced) {
    session_->open(path_);
    session_->recover();
    settle();
    EXPECT_TRUE(session_->hasConverged());
    session_->open(path_);
    session_->open((folder_ / "nowhere.vtu").string());
    session_->recover();
    EXPECT_THROW(settle(), std::exception);
    settle();
    EXPECT_EQ(session_->path(), path_);
    EXPECT_TRUE(session_->hasConverged());
}

TEST_F(ViewSessionTest, WithoutAnotherDeviceTheSceneIsNotLost) {
    int left = 1;
    ViewOptions options;
    options.platform = kPlatform;
    options.makeThread = [&](GlPlatform platform) {
        if (left-- == 0) throw GlError("no other device");
        return std::make_unique<GlThread>(platform);
    };
    session_ = std::make_unique<ViewSession>(Job{}, options);
    session_->document().change({{"version", 1}, {"slices", 3}});
    session_->resize(90, 70);
    open();
    EXPECT_THROW(session_->recover(), GlError);
    const std::string scene = (folder_ / "scene.json").string();
    session_->saveScene(scene);
    EXPECT_EQ(readScene(scene).slicesAVoxel, 3);
}

TEST(SceneDocument, KeepsTheFilesThatASceneNames) {
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / ("tessera-scene-document-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder / "saved");
    const std::string read = (folder / "scene.json").string(), saved = (folder / "saved/scene.json").string();
    std::ofstream(read) << R"({"version": 1, "effects": {"outline": {"mesh": "wing.vtu"}}})";
    const SceneDocument document = SceneDocument::read(read);
    const std::string mesh = (folder / "wing.vtu").string();
    EXPECT_EQ(document.scene().outline.mesh, mesh);
    document.save(saved);
    EXPECT_EQ(readScene(saved).outline.mesh, mesh);
    EXPECT_FALSE(document.canUndo());
    std::filesystem::remove_all(folder);
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
