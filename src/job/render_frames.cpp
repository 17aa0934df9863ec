#include "job/render_frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "files/atomic_file.h"
#include "job/algorithm_choice.h"
#include "job/output_paths.h"
#include "job/scene_picture.h"
#include "job/series_steps.h"
#include "job/source_effects.h"
#include "scene/camera_path.h"
#include "tessera/error.h"

namespace tessera {

namespace {

std::vector<std::string> outputsOf(const std::string& pattern, std::size_t count) {
    std::string numbered = pattern;
    if (!takesNumber(pattern)) {
        const std::filesystem::path path = pattern;
        numbered =
            (path.parent_path() / (path.stem().string() + "_####" + path.extension().string())).string();
    }
    std::vector<std::string> outputs;
    for (std::size_t n = 1; n <= count; ++n) outputs.push_back(numberedName(numbered, n));
    return outputs;
}

std::size_t frameCount(const FramesRequest& request) {
    const std::size_t files = request.inputs.size();
    if (files > 1 && request.frames && std::size_t(*request.frames) != files)
        throw InputError(
            fmt::format("--frames: {} files are as many frames, not {}", files, *request.frames));
    if (files > 1) return files;
    if (request.path.empty() && !request.orbits) throw InputError("--frames needs --path or --orbit");
    if (!request.frames) throw InputError("--path and --orbit need --frames");
    return std::size_t(*request.frames);
}

SceneCamera fixedCamera(const Camera& camera) {
    SceneCamera fixed;
    fixed.eyeWorld = camera.eyeWorld;
    fixed.targetWorld = camera.eyeWorld + camera.forwardWorld;
    fixed.up = camera.upWorld;
    fixed.openingDegrees = camera.openingDegrees;
    fixed.heightWorld = camera.heightWorld;
    return fixed;
}

/// The pictures' names, when they can be written.
std::vector<std::string> checkedOutputs(const FramesRequest& request, const Job& job) {
    if (request.picture.output == "-") throw InputError("several pictures can't go to standard output");
    if (request.picture.explains) throw InputError("--explain is for one picture");
    chooseFormat(request.picture.output, {}, {"png", "exr"});
    const std::vector<std::string> names = outputsOf(request.picture.output, frameCount(request));
    std::vector<std::string> inputs = request.inputs;
    inputs.push_back(request.picture.scene);
    inputs.push_back(request.path);
    std::vector<OutputPath> outputs{{"--json", job.reportPath}};
    for (const std::string& name : names) outputs.push_back({"--output", name});
    checkOutputPaths(inputs, outputs);
    checkWritable(names.front());
    checkReportPath(job);
    return names;
}

RenderedFrames drawFrames(const FramesRequest& request, const Scene& asked,
                          const std::optional<CameraPath>& path, const std::vector<std::string>& outputs,
                          Job& job) {
    const bool isExr = chooseFormat(request.picture.output, {}, {"png", "exr"}) == "exr";
    const std::size_t count = outputs.size();
    RenderedFrames frames;
    frames.outputs = outputs;
    GlThread& thread = sharedGlThread(chooseGlPlatform(request.picture.platform));
    warnOfDrivers(job);
    SliceRenderer renderer(thread);
    std::unique_ptr<PictureSource> source;
    Scene scene;
    Box3d firstBounds;
    std::size_t shown = 0;
    job.execution.declare({{Stage::reading, 0}, {Stage::writing, 1}});
    for (std::size_t n = 0; n < count; ++n) {
        job.execution.throwIfCancelled();
        job.execution.beginStep(fmt::format("picture {} of {}", n + 1, count), 1, double(count - n - 1));
        if (!source || request.inputs.size() > 1) {
            source.reset();  // before the next one takes memory
            source = openPictureSource(request.inputs[n < request.inputs.size() ? n : 0], asked, thread, job);
            scene = withEffectsOf(asked, *source, job);
            if (firstBounds.empty()) firstBounds = source->boundsWorld();
        }
        job.execution.report(Stage::writing, 0, 1);
        const double share = count > 1 ? double(n) / double(count - 1) : 0;
        const int besides = legendPixelsOf(scene, *source, !isExr);
        if (path)
            scene.camera = path->at(path->beginTime() + share * (path->endTime() - path->beginTime()));
        else if (request.orbits)
            scene.camera = orbited(asked, firstBounds, besides, double(n) / double(count));
        else if (!asked.camera.eyeWorld)
            scene.camera = fixedCamera(cameraOf(asked, firstBounds, besides));
        const ScenePicture picture = pictureOf(scene, *source, !isExr);
        const RgbaImage image =
            drawFrom(*source, renderer, picture.options, job.execution, &frames.last.counts);
        shown += !isEmpty(image);
        if (isExr)
            writeLight(frames.outputs[n], image, job.execution);
        else
            writePng(frames.outputs[n], onScreen(picture, image));
        frames.drawMs += frames.last.counts.drawMs;
        job.execution.report(Stage::writing, 1, 1);
    }
    if (shown == 0) throw InputError(fmt::format("nothing of {} is in any of the pictures", source->title()));
    describe(*source, thread, asked, frames.last);
    job.say(fmt::format("{} to {}: {} pictures of {}, {} x {} pixels, drawn in {:.0f} ms\n",
                        frames.outputs.front(), frames.outputs.back(), count, frames.last.field,
                        frames.last.width, frames.last.height, frames.drawMs));
    return frames;
}

}  // namespace

RenderedFrames renderFrames(const FramesRequest& request, Job& job) {
    const std::vector<std::string> outputs = checkedOutputs(request, job);
    std::optional<CameraPath> path;
    if (!request.path.empty()) path = readCameraPath(request.path);
    const Scene scene = sceneOf(request.picture, job);
    const bool hasOwnRange = scene.function.range || !scene.function.stops.empty();
    try {
        RenderedFrames frames = drawFrames(request, scene, path, outputs, job);
        if (request.inputs.size() > 1 && !hasOwnRange)
            job.warn(
                "each file has colours by the range of its own values: transfer_function.range fixes them");
        return frames;
    } catch (const InputError& error) {
        throwNamed(error, request.picture, request.inputs);
    }
}

Json framesJson(const FramesRequest& request, const RenderedFrames& frames) {
    Json json = renderedJson(request.picture, frames.last);
    json["input"] = request.inputs.size() > 1 ? Json(request.inputs) : Json(request.inputs.front());
    json["output"] = frames.outputs;
    if (!request.path.empty()) json["path"] = request.path;
    json["draw_ms"] = frames.drawMs;
    return json;
}

}  // namespace tessera
