#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "gl/gl_platform.h"
#include "gl/gl_thread.h"
#include "job/job.h"
#include "job/mesh_source.h"
#include "job/scene_picture.h"
#include "mesh_files/read_mesh.h"
#include "render/slice_renderer.h"
#include "view/scene_document.h"
#include "view/view_camera.h"

namespace tessera {

struct ViewOptions {
    std::optional<GlPlatform> platform;  ///< none: the best there is
    /// What a picture may take while something moves; 0: 33, or 100 where the processor draws.
    double frameMs = 0;
    /// For tests: makes the thread that draws.
    std::function<std::unique_ptr<GlThread>(GlPlatform)> makeThread = nullptr;
};

/// Pictures drawn so far while something moved or was refined, and what they took until they could be shown.
struct FrameTime {
    double ms = 0;
    double scale = 1;  ///< pixels drawn to those shown, along an edge
    bool isMoving = false;
};

/// What a window shows of a mesh or a .vdb file: bricks that refine around a focus, and the pictures of a
/// scene that is being edited. While something moves, pictures are as coarse as it takes to have them in
/// time; at rest they converge to that of `tessera render`. Nothing here waits for bricks: where one
/// processor draws and samples, sampling has the time between pictures, a fifth at least.
///
/// All calls are for one thread, that of the window; files are read in another one.
class ViewSession {
  public:
    using Clock = std::chrono::steady_clock;

    /// Throws GlError when no OpenGL can be had.
    ViewSession(const Job& job, const ViewOptions& options);
    ~ViewSession();

    /// Begins to read a mesh or a .vdb file; what is shown stays until it is there, and goes on being shown
    /// where it can't be opened. One that is still being read is given up. The scene keeps what isn't the
    /// file's: field, camera, transfer function and places are dropped for any file but the first.
    void open(const std::string& path);
    bool isOpening() const { return opening_.valid(); }
    /// A scene that was made elsewhere: for the file that is being opened, else for the one that is shown.
    void useScene(SceneDocument::Json json);
    /// Of what is shown; empty: nothing.
    const std::string& path() const { return path_; }

    /// When the mesh that is shown had been read, when it had been looked at, before the first brick was
    /// sampled, and when its coarsest bricks were in the pool.
    Clock::time_point readAt() const { return readAt_; }
    Clock::time_point madeAt() const { return madeAt_; }
    Clock::time_point coarsestAt() const { return coarsestAt_; }

    SceneDocument& document() { return document_; }
    const SceneDocument& document() const { return document_; }
    /// Of the part of the window that shows pictures.
    void resize(int widthPixels, int heightPixels);
    int width() const { return width_; }
    int height() const { return height_; }
    void setFrameMs(double ms) { frameMs_ = ms; }
    double frameMs() const { return frameMs_; }

    /// Null before there is something to show.
    const PictureSource* source() const { return source_.get(); }
    /// The same when it is a mesh.
    const MeshSource* mesh() const { return mesh_; }
    MeshSource* mesh() { return mesh_; }
    /// The camera of the picture, as the scene has it. There is a source.
    Camera camera() const;
    ViewCamera viewCamera() const;

    enum class Did { nothing, sampled, drew };
    /// Does a piece of what is to be done: opens what was read, samples bricks, or draws a picture. When it
    /// throws, a later call goes on. @param wasInterrupted called while a picture at rest is drawn: true ends
    /// it.
    Did work(const std::function<bool()>& wasInterrupted);

    /// The size of the window; empty before there is one.
    const RgbImage& picture() const { return picture_; }
    /// Counts the pictures.
    std::size_t pictureNumber() const { return pictureNumber_; }
    /// The picture is that of `tessera render`.
    bool hasConverged() const;
    /// Every brick that is wished for is there.
    bool isRefined() const;
    /// Takes what was noted since the last call.
    std::vector<FrameTime> takeFrames() { return std::exchange(frames_, {}); }
    /// In a sentence, what is going on.
    std::string status() const;
    /// Failures and warnings since the last call, a sentence each.
    std::vector<std::string> takeMessages();

    /// What is seen at a pixel: where half of the light that its ray loses is lost. None where it loses none.
    struct Seen {
        Vec3d placeWorld{0};
        double value = 0;
    };
    std::optional<Seen> seenAt(double xPixels, double yPixels) const;
    /// Where a place is in the picture, pixels; none behind the eye.
    std::optional<std::array<double, 2>> pixelOf(const Vec3d& placeWorld) const;
    /// The place as far in front of the eye that is at another pixel; the place itself when it isn't in
    /// front.
    Vec3d movedTo(const Vec3d& placeWorld, double xPixels, double yPixels) const;

    /// Draws the picture to the end, and writes it as `tessera render` does: .png or .exr. Throws InputError,
    /// IoError, GlError.
    void writePicture(const std::string& path);
    /// Writes the scene with the size of the window: `tessera render` makes the same picture of it.
    void saveScene(const std::string& path);

    /// Frames are noted as moving as long as this wasn't called for a while.
    void touch() { touched_ = Clock::now(); }
    /// As it is for a device that is lost: everything moves to a new one. Throws GlError where there is none,
    /// and when it has no memory; then what is shown may be gone, but not the scene.
    void recover();
    const GlDeviceInfo& device() const { return thread_->info(); }

  private:
    struct Opened {
        std::string path;
        std::shared_ptr<const MeshFile> file;  // null: a .vdb file
        Scene scene;                           // that the source is for
        std::unique_ptr<PictureSource> source;
        Clock::time_point readAt{}, madeAt{}, coarsestAt{};
    };
    /// What a picture is of.
    struct Shown {
        std::size_t revision = 0;
        std::int64_t state = 0;
        int width = 0, height = 0, samples = 0;
        double scale = 0, slices = 0;
        friend bool operator==(const Shown&, const Shown&) = default;
    };

    void begin(const std::string& path, std::shared_ptr<const MeshFile> file);
    void takeOpened();
    void follow();
    Scene sized(Scene scene) const;
    Scene sceneNow() const { return sized(document_.scene()); }
    Scene completeScene();
    bool isMoving() const;
    bool sample(double ms);
    double scaleFor(double ms, double slices) const;
    bool draw(double scale, double slices, int samples, const std::function<bool()>& wasInterrupted);
    Did drawOrSample(const std::function<bool()>& wasInterrupted);
    Shown wanted() const;

    Job job_;
    ViewOptions options_;
    std::unique_ptr<GlThread> thread_;
    std::unique_ptr<SliceRenderer> renderer_;
    bool sharesProcessor_ = false;
    double frameMs_ = 0;

    SceneDocument document_;
    std::string path_;
    Clock::time_point readAt_, madeAt_, coarsestAt_;
    std::shared_ptr<const MeshFile> file_;
    std::unique_ptr<PictureSource> source_;
    MeshSource* mesh_ = nullptr;
    std::future<Opened> opening_;
    std::string openingPath_;
    std::atomic<bool> isGivenUp_ = false;  // what is being opened
    bool opensAnotherFile_ = false;        // than the one shown, or the first one
    std::optional<std::string> next_;      // to be opened in its place
    std::optional<SceneDocument::Json> nextScene_;
    std::future<void> warming_;
    std::atomic<bool> isEnding_ = false;

    std::size_t followed_ = 0;       // revision of the document that the bricks follow
    std::optional<Scene> opened_;    // what the source was opened for, or couldn't be
    std::vector<Effect> effects_;    // of the scene, with what they take of the source
    SceneDocument::Json effectsOf_;  // that of the scene which they are of
    bool isRefined_ = false;
    int width_ = 0, height_ = 0;
    Clock::time_point touched_, lastDrawn_;
    double lastDrawMs_ = 0;
    double msARay_ = 2e-3;  // with one slice a voxel
    RgbImage picture_;
    RgbaImage drawn_;
    std::optional<ScenePicture> asked_;
    Shown shown_;
    std::size_t pictureNumber_ = 0;
    std::vector<FrameTime> frames_;
    class Mailbox;
    std::shared_ptr<Mailbox> mail_;  // from the thread that reads
};

}  // namespace tessera
