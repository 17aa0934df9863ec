#include "view/view_session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <thread>
#include <utility>

#include "base/parallel.h"
#include "base/timer.h"
#include "job/describe_files.h"
#include "job/import_mesh.h"
#include "job/source_effects.h"
#include "job/vdb_source.h"
#include "refine/camera_view.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Something that was touched so long ago is at rest.
constexpr std::chrono::milliseconds kTouchLasts{250};
constexpr double kFrameMsOfGpu = 33, kFrameMsOfProcessor = 100;
/// Of the time of a picture, what sampling has behind it.
constexpr double kSamplingShare = 0.2;
constexpr double kSampleMs = 20;
/// Pictures of what is being refined, while nothing moves: such a multiple of a moving one's time, and a
/// fifth of all time.
constexpr double kFirstFrame = 0.3, kRefiningFrames = 3, kRefiningPause = 4;
constexpr double kLeastScale = 0.1;
constexpr double kMovingSlices = 0.25;
/// Small parts, so that a hand needn't wait for them.
constexpr int kRaysATile = 256;

/// A picture at another size, linear between pixels.
RgbaImage resized(const RgbaImage& image, int width, int height, const Execution& execution) {
    if (image.width == width && image.height == height) return image;
    RgbaImage to{width, height, {}};
    to.pixels.resize(std::size_t(width) * std::size_t(height));
    const float across = float(image.width) / float(width), down = float(image.height) / float(height);
    parallelFor(execution, height, [&](std::int64_t y) {
        const float v = std::clamp((float(y) + 0.5f) * down - 0.5f, 0.0f, float(image.height - 1));
        const int above = int(v), below = std::min(above + 1, image.height - 1);
        for (int x = 0; x < width; ++x) {
            const float u = std::clamp((float(x) + 0.5f) * across - 0.5f, 0.0f, float(image.width - 1));
            const int left = int(u), right = std::min(left + 1, image.width - 1);
            const float s = u - float(left), t = v - float(above);
            const Rgba &a = image.at(left, above), &b = image.at(right, above), &c = image.at(left, below),
                       &d = image.at(right, below);
            Rgba& pixel = to.at(x, int(y));
            for (std::size_t i = 0; i < 4; ++i)
                pixel[i] = (1 - t) * ((1 - s) * a[i] + s * b[i]) + t * ((1 - s) * c[i] + s * d[i]);
        }
    });
    return to;
}

/// A small picture of one brick as a scene has them, so that the device's programs are there when a file is.
void warmUp(SliceRenderer& renderer, GlThread& thread, const Scene& scene) {
    const int cells = scene.bricks.cells, edge = cells + 1;
    const ValueRange range{0, 1};
    TexelCoding coding({ValueCoding(range, SampleFormat::r32f)}, SampleFormat::r32f);
    PoolOptions poolOptions;
    poolOptions.budgetBytes = 8 * std::int64_t(edge) * edge * edge * coding.pointBytes();
    BrickPool pool(thread, cells, std::move(coding), poolOptions);
    auto block = std::make_shared<Block>();
    block->box = {Vec3i(0), Vec3i(edge)};
    block->channels = 1;
    block->values.resize(block->count());
    for (std::size_t p = 0; p < block->count(); ++p) block->values[p] = float(p % 2);
    block->coverage.assign(block->count(), 1);
    block->coverage[0] = 0;  // not whole
    const std::vector<ShownBrick> bricks{{GrowingLeaf{}, block}};
    PoolTarget target(pool, 1);
    target.publish({.removed = {}, .added = bricks});
    RenderOptions options;
    options.boundsWorld = {Vec3d(0), Vec3d(cells)};
    options.camera = cameraOf(scene, options.boundsWorld, 0);
    options.camera.widthPixels = options.camera.heightPixels = 32;
    options.function.stops = {{0, {1, 1, 1}, 0.5}};
    options.effects = scene.effects;
    options.values = range;
    renderer.draw(pool, *pool.state(), {Vec3d(0), 1, cells}, placeBricks(target, 0), options, {});
}

/// Of another file's scene what isn't about its place and its values stays.
SceneDocument forAnotherFile(SceneDocument::Json json) {
    for (const char* key : {"field", "component", "camera", "transfer_function", "layer", "clip", "unit",
                            "bookmarks", "effects"})
        json.erase(key);
    if (json.contains("bricks")) json["bricks"].erase("focus");
    SceneDocument document;
    document.restart(std::move(json));
    return document;
}

}  // namespace

/// Sentences from any thread.
class ViewSession::Mailbox {
  public:
    void put(const std::string& sentence) {
        const std::lock_guard lock(mutex_);
        sentences_.push_back(sentence);
    }
    std::vector<std::string> take() {
        const std::lock_guard lock(mutex_);
        return std::exchange(sentences_, {});
    }

  private:
    std::mutex mutex_;
    std::vector<std::string> sentences_;
};

ViewSession::ViewSession(const Job& job, const ViewOptions& options)
    : job_(job), options_(options), mail_(std::make_shared<Mailbox>()) {
    job_.execution.cancel = &isEnding_;
    job_.execution.progress = nullptr;
    job_.say = [](const std::string&) {};
    job_.warn = job_.fellShort = [mail = mail_](const std::string& text) { mail->put(text); };
    if (!options_.makeThread)
        options_.makeThread = [](GlPlatform platform) { return std::make_unique<GlThread>(platform); };
    thread_ = options_.makeThread(chooseGlPlatform(options_.platform));
    renderer_ = std::make_unique<SliceRenderer>(*thread_);
    sharesProcessor_ = thread_->info().isSoftware;
    frameMs_ =
        options_.frameMs > 0 ? options_.frameMs : (sharesProcessor_ ? kFrameMsOfProcessor : kFrameMsOfGpu);
    touched_ = lastDrawn_ = Clock::now() - std::chrono::hours(1);
}

ViewSession::~ViewSession() {
    isEnding_ = isGivenUp_ = true;
    if (opening_.valid()) opening_.wait();
    if (warming_.valid()) warming_.wait();
    // Before the thread that they live on.
    opening_ = {};
    source_.reset();
    renderer_.reset();
}

void ViewSession::open(const std::string& path) {
    if (isOpening()) {
        isGivenUp_ = true;
        next_ = path;
        return;
    }
    begin(path, nullptr);
}

void ViewSession::useScene(SceneDocument::Json json) {
    if (!isOpening() || !(opensAnotherFile_ || next_)) return document_.change(std::move(json));
    SceneDocument().change(json);  // is one
    nextScene_ = std::move(json);
}

void ViewSession::begin(const std::string& path, std::shared_ptr<const MeshFile> file) {
    openingPath_ = path;
    isGivenUp_ = false;
    // A scene that came first is for the file that comes first, even where that can't be opened.
    opensAnotherFile_ = opened_ && path != path_;
    const Scene scene = opensAnotherFile_ ? sized(forAnotherFile(document_.json()).scene()) : sceneNow();
    if (!opensAnotherFile_) opened_ = scene;
    if (!source_)
        warming_ = std::async(std::launch::async, [this, scene = Scene(scene)]() mutable {
            scene.camera = {};
            try {
                warmUp(*renderer_, *thread_, scene);
            } catch (const std::exception&) {  // what is wrong is told where the picture is drawn
            }
        });
    Opened begun{path, std::move(file), scene, nullptr};
    opening_ = std::async(std::launch::async, [this, opened = std::move(begun)]() mutable {
        const Scene& asked = opened.scene;
        Job job = job_;
        job.execution.cancel = &isGivenUp_;
        if (isVdbName(opened.path)) {
            opened.source = openVdbSource(opened.path, asked.field, asked.component, *thread_, job);
            return std::move(opened);
        }
        if (!opened.file) opened.file = std::make_shared<const MeshFile>(openMesh(opened.path, {}, job));
        const int threads = sharesProcessor_ ? 0 : std::max(1, job.execution.threadCount() - 1);
        opened.readAt = Clock::now();
        auto source = makeMeshSource(opened.path, opened.file->mesh, asked, threads, *thread_, job.execution);
        opened.madeAt = Clock::now();
        source->live().showCoarsest(job.execution);
        opened.coarsestAt = Clock::now();
        opened.source = std::move(source);
        return std::move(opened);
    });
}

void ViewSession::takeOpened() {
    if (!isOpening() || opening_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
    if (warming_.valid()) warming_.get();
    std::future<Opened> ready = std::move(opening_);
    if (next_) {
        begin(*std::exchange(next_, std::nullopt), nullptr);
        return;
    }
    const auto scene = std::exchange(nextScene_, std::nullopt);
    Opened opened = ready.get();
    if (scene || opensAnotherFile_)
        document_.restart(scene ? *scene : forAnotherFile(document_.json()).json());
    opened_ = opened.scene;
    source_ = std::move(opened.source);
    effectsOf_ = nullptr;
    mesh_ = dynamic_cast<MeshSource*>(source_.get());
    file_ = std::move(opened.file);
    path_ = opened.path;
    readAt_ = opened.readAt;
    madeAt_ = opened.madeAt;
    coarsestAt_ = opened.coarsestAt;
    followed_ = 0;
    isRefined_ = mesh_ == nullptr;
    shown_ = {};
}

Scene ViewSession::sized(Scene scene) const {
    if (width_ > 0 && height_ > 0) scene.width = width_, scene.height = height_;
    return scene;
}

/// What can't be made of the source is left out, and noted.
Scene ViewSession::completeScene() {
    Scene scene = sceneNow();
    // A mesh's edges take long: they aren't found again for every step of a camera that is dragged.
    SceneDocument::Json effectsNow = SceneDocument::Json::array();
    for (const char* key : {"effects", "background", "unit", "length_unit"})
        effectsNow.push_back(document_.json().contains(key) ? document_.json()[key] : nullptr);
    if (effectsOf_ != effectsNow) {
        effectsOf_ = std::move(effectsNow);
        effects_.clear();
        for (const Effect& effect : scene.effects) {
            Scene one = scene;
            one.effects = {effect};
            try {
                effects_.push_back(withEffectsOf(std::move(one), *source_, job_).effects.front());
            } catch (const InputError& error) {
                mail_->put(error.what());
            }
        }
    }
    scene.effects = effects_;
    return scene;
}

void ViewSession::resize(int widthPixels, int heightPixels) {
    width_ = std::max(1, widthPixels);
    height_ = std::max(1, heightPixels);
}

Camera ViewSession::camera() const {
    const Scene scene = sceneNow();
    return cameraOf(scene, source_->boundsWorld(), legendPixelsOf(scene, *source_, true));
}

ViewCamera ViewSession::viewCamera() const {
    const Box3d& bounds = source_->boundsWorld();
    const auto& target = document_.scene().camera.targetWorld;
    return ViewCamera::of(camera(), target.value_or(0.5 * (bounds.min + bounds.max)));
}

bool ViewSession::isMoving() const {
    return Clock::now() - touched_ < kTouchLasts;
}

/// Brings the bricks after the scene.
void ViewSession::follow() {
    if (followed_ == document_.revision() || isOpening()) return;
    const Scene scene = sceneNow();
    const auto isOfSource = [](const Scene& s) {
        return std::tuple(s.field, s.component, s.bricks.resolution, s.bricks.cells, s.bricks.budgetBytes);
    };
    if (isOfSource(scene) != isOfSource(*opened_)) {
        begin(path_, file_);
        return;
    }
    // What the camera sees is sampled when it has come to rest.
    if (scene.bricks.pixelsAVoxel > 0 && isMoving()) return;
    followed_ = document_.revision();
    if (mesh_ && mesh_->setFocus(scene)) isRefined_ = false;
}

bool ViewSession::sample(double ms) {
    if (!mesh_ || isRefined_) return false;
    const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                             std::chrono::duration<double, std::milli>(ms));
    isRefined_ = mesh_->live().update(sharesProcessor_ ? deadline : Clock::now(), job_.execution);
    return true;
}

ViewSession::Shown ViewSession::wanted() const {
    const auto state = source_->pool().state();
    const Scene& scene = document_.scene();
    return {document_.revision(), state ? state->number : 0, width_, height_, scene.samplesAPixel, 1,
            scene.slicesAVoxel};
}

bool ViewSession::hasConverged() const {
    return source_ && isRefined() && shown_ == wanted();
}

bool ViewSession::isRefined() const {
    return source_ && isRefined_ && !isOpening() && followed_ == document_.revision();
}

/// Of a picture that takes so long.
double ViewSession::scaleFor(double ms, double slices) const {
    const double rays = ms / (msARay_ * std::max(slices, 0.25));
    return std::clamp(std::sqrt(rays / (double(width_) * height_)), kLeastScale, 1.0);
}

bool ViewSession::draw(double scale, double slices, int samples,
                       const std::function<bool()>& wasInterrupted) {
    const Timer timer;
    ScenePicture asked = pictureOf(completeScene(), *source_, true);
    const auto state = source_->pool().state();
    if (!state) return false;
    Shown shown{document_.revision(), state->number, width_, height_, samples, scale, slices};
    RenderOptions options = asked.options;
    options.slicesAVoxel = slices;
    options.samplesAPixel = samples;
    options.lineScale = scale;
    options.camera.widthPixels = std::max(1, int(std::lround(scale * width_)));
    options.camera.heightPixels = std::max(1, int(std::lround(scale * height_)));
    std::atomic<bool> cancel = false;
    Execution execution = job_.execution;
    if (wasInterrupted) {
        options.raysATile = kRaysATile;
        options.beforeTile = [&] { cancel = cancel || wasInterrupted(); };
        execution.cancel = &cancel;
    }
    RenderCounts counts;
    try {
        drawn_ = drawFrom(*source_, *renderer_, options, execution, &counts);
    } catch (const Cancelled&) {
        if (!cancel) throw;
        return false;
    }
    const double rays = double(options.camera.widthPixels) * options.camera.heightPixels * samples;
    picture_ = onScreen(asked, resized(drawn_, width_, height_, job_.execution));
    asked_ = std::move(asked);
    shown_ = shown;
    ++pictureNumber_;
    lastDrawMs_ = timer.elapsedMs();
    lastDrawn_ = Clock::now();
    msARay_ = 0.5 * (msARay_ + lastDrawMs_ / (rays * std::max(slices, 0.25)));
    frames_.push_back({lastDrawMs_, scale, isMoving()});
    return true;
}

ViewSession::Did ViewSession::drawOrSample(const std::function<bool()>& wasInterrupted) {
    const Shown wish = wanted();
    if (wish.state == 0) return sample(kSampleMs) ? Did::sampled : Did::nothing;
    const auto differs = [&] {
        return shown_.revision != wish.revision || shown_.state != wish.state || shown_.width != wish.width ||
               shown_.height != wish.height;
    };
    if (isMoving()) {
        const bool wasSampled = sample(kSamplingShare * lastDrawMs_);
        if (!differs()) return wasSampled ? Did::sampled : Did::nothing;
        // Sampling has its part of the time from one picture to the next.
        const double ms = isRefined_ || !sharesProcessor_ ? frameMs_ : frameMs_ / (1 + kSamplingShare);
        draw(scaleFor(ms, kMovingSlices), kMovingSlices, 1, nullptr);
        return Did::drew;
    }
    if (!isRefined_) {
        // A change of the scene is shown at once, new bricks now and then.
        const double sinceMs = std::chrono::duration<double, std::milli>(Clock::now() - lastDrawn_).count();
        const bool isDue = shown_.revision != wish.revision || sinceMs > kRefiningPause * lastDrawMs_;
        if (differs() && isDue) {
            // The first picture of all is there as soon as can be.
            const double ms = (shown_.state == 0 ? kFirstFrame : kRefiningFrames) * frameMs_;
            draw(scaleFor(ms, wish.slices), wish.slices, 1, wasInterrupted);
            return Did::drew;
        }
        return sample(kSampleMs) ? Did::sampled : Did::nothing;
    }
    if (shown_ == wish) return Did::nothing;
    // Every pixel once, then what the scene asks for.
    if (differs() || shown_.scale < 1 || shown_.slices < wish.slices)
        draw(1, wish.slices, 1, wasInterrupted);
    else
        draw(1, wish.slices, wish.samples, wasInterrupted);
    return Did::drew;
}

ViewSession::Did ViewSession::work(const std::function<bool()>& wasInterrupted) {
    takeOpened();
    if (!source_ || width_ <= 0 || height_ <= 0) return Did::nothing;
    follow();
    return drawOrSample(wasInterrupted);
}

std::string ViewSession::status() const {
    if (isOpening()) return fmt::format("reading {}", openingPath_);
    if (!source_) return "drop a mesh or a .vdb file here";
    if (mesh_ && !isRefined()) {
        if (source_->bricks().empty()) return "sampling the coarsest bricks";
        const ScheduleProgress progress = mesh_->live().scheduler().progress();
        return fmt::format("refining: {} of {} bricks", progress.leavesShown,
                           std::max(progress.leavesShown, progress.leavesPlanned));
    }
    const std::string bricks = fmt::format("{} bricks", source_->bricks().size());
    if (mesh_ && mesh_->live().scheduler().isCutShort())
        return bricks + ", as many as the " + (mesh_->live().isDeviceFull() ? "device" : "budget") +
               " holds" + (hasConverged() ? "; the picture has converged" : "");
    return bricks + (hasConverged() ? ", the picture has converged" : "");
}

std::vector<std::string> ViewSession::takeMessages() {
    return mail_->take();
}

std::optional<ViewSession::Seen> ViewSession::seenAt(double xPixels, double yPixels) const {
    if (!source_ || !asked_) return std::nullopt;
    const RenderOptions& options = asked_->options;
    const CameraView view = viewOf(options.camera);
    const ViewRay ray = view.rayOf(options.camera, xPixels, yPixels);
    // Within the data and the clips.
    std::vector<HalfSpace> within = options.within;
    const Box3d& bounds = source_->boundsWorld();
    for (int a = 0; a < 3; ++a) {
        Vec3d axis(0);
        axis[a] = 1;
        within.push_back({axis, bounds.min[a]});
        within.push_back({-axis, -bounds.max[a]});
    }
    double begin = 0, end = std::numeric_limits<double>::infinity();
    for (const HalfSpace& half : within) {
        const double rise = glm::dot(half.normalWorld, ray.direction);
        const double missing = half.offsetWorld - glm::dot(half.normalWorld, ray.originWorld);
        if (rise == 0 && missing > 0) return std::nullopt;
        if (rise > 0) begin = std::max(begin, missing / rise);
        if (rise < 0) end = std::min(end, missing / rise);
    }
    const Vec3d size = bounds.size();
    const double least = glm::length(size) * 1e-5;
    struct Step {
        Seen seen;
        double lost;  // of the light that came in
    };
    std::vector<Step> steps;
    double light = 1;
    for (double at = begin; at < end && light > 1e-3;) {
        const Vec3d place = ray.originWorld + at * ray.direction;
        const auto samples = source_->samplesAt(place);
        const double step = std::max(
            samples ? 0.5 * source_->frame().spacingWorld(samples->key.depth) : glm::length(size) / 512,
            least);
        if (samples)
            if (const auto value = source_->valueAt(place)) {
                const double opacity = shownAt(options.function, *value)[3];
                const double passed = std::pow(1 - opacity, step / options.layerWorld);
                if (passed < 1) steps.push_back({{place, *value}, light * (1 - passed)});
                light *= passed;
            }
        at += step;
    }
    double lost = 0;
    for (const Step& step : steps)
        if ((lost += step.lost) >= 0.5 * (1 - light)) return step.seen;
    return std::nullopt;
}

std::optional<std::array<double, 2>> ViewSession::pixelOf(const Vec3d& placeWorld) const {
    if (!asked_) return std::nullopt;
    const Camera& camera = asked_->options.camera;
    const CameraView view = viewOf(camera);
    const Vec3d from = placeWorld - camera.eyeWorld;
    const double depth = view.isParallel ? 1 : glm::dot(from, view.forward);
    if (!(depth > 0)) return std::nullopt;
    const double u = glm::dot(from, view.right) / (depth * view.wide);
    const double v = glm::dot(from, view.up) / (depth * view.high);
    return std::array{0.5 * (u + 1) * camera.widthPixels, 0.5 * (1 - v) * camera.heightPixels};
}

Vec3d ViewSession::movedTo(const Vec3d& placeWorld, double xPixels, double yPixels) const {
    if (!pixelOf(placeWorld)) return placeWorld;
    const Camera& camera = asked_->options.camera;
    const CameraView view = viewOf(camera);
    const double depth = glm::dot(placeWorld - camera.eyeWorld, view.forward);
    const ViewRay ray = view.rayOf(camera, xPixels, yPixels);
    const double along = glm::dot(ray.direction, view.forward);
    return ray.originWorld +
           (depth - glm::dot(ray.originWorld - camera.eyeWorld, view.forward)) / along * ray.direction;
}

void ViewSession::writePicture(const std::string& path) {
    if (!source_) throw InputError("there is nothing to show yet");
    const bool isExr = path.ends_with(".exr");
    if (!isExr && !path.ends_with(".png")) throw InputError(path + ": pictures are .png or .exr files");
    const Scene scene = completeScene();
    if (isExr || shown_ != wanted()) {
        const ScenePicture asked = pictureOf(scene, *source_, !isExr);
        if (!source_->pool().state()) throw InputError("there is nothing to show yet");
        const RgbaImage image = drawFrom(*source_, *renderer_, asked.options, job_.execution);
        isExr ? writeLight(path, image, job_.execution) : writePng(path, onScreen(asked, image));
        return;
    }
    writePng(path, picture_);
}

void ViewSession::saveScene(const std::string& path) {
    SceneDocument::Json json = document_.json();
    json["size"] = {width_, height_};
    SceneDocument saved;
    saved.change(std::move(json));
    saved.save(path);
}

void ViewSession::recover() {
    auto made = options_.makeThread(chooseGlPlatform(options_.platform));
    if (warming_.valid()) warming_.get();
    // What is being opened is on the device that is lost, but the mesh that was read isn't.
    const bool wasOpening = isOpening();
    std::shared_ptr<const MeshFile> file;
    if (wasOpening) try {
            file = opening_.get().file;
        } catch (const std::exception&) {  // it will be told again
        }
    renderer_ = std::make_unique<SliceRenderer>(*made);
    const std::unique_ptr<GlThread> lost = std::exchange(thread_, std::move(made));
    shown_ = {};
    try {
        if (source_) source_->moveTo(*thread_);
    } catch (...) {
        mesh_ = nullptr;
        source_.reset();
        path_.clear();
        throw;
    }
    if (!source_) opened_.reset();
    if (next_)
        begin(*std::exchange(next_, std::nullopt), nullptr);
    else if (wasOpening)
        begin(openingPath_, std::move(file));
}

}  // namespace tessera
