#include "job/render_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "files/atomic_file.h"
#include "files/named_file.h"
#include "job/algorithm_choice.h"
#include "job/describe_files.h"
#include "job/import_mesh.h"
#include "job/mesh_source.h"
#include "job/output_paths.h"
#include "job/scene_picture.h"
#include "job/source_effects.h"
#include "job/table_text.h"
#include "job/vdb_source.h"
#include "scene/scene_file.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// 16 bytes each, and up to 20 more while they are written.
constexpr std::int64_t kMostPixels = 200'000'000;
/// Shaders compute in single precision.
constexpr double kShortestDrawn = 1e-30, kLongestDrawn = 1e30;

}  // namespace

Scene sceneOf(const RenderRequest& request, const Job& job) {
    Scene scene = request.scene.empty() ? Scene{} : readScene(request.scene);
    if (!scene.outline.mesh.empty() && !job.followsLinks)
        checkInFolder(folderOf(request.scene), request.scene, scene.outline.mesh);
    if (request.field) scene.field = *request.field;
    if (request.component) scene.component = request.component;
    if (request.size) scene.width = (*request.size)[0], scene.height = (*request.size)[1];
    if (request.samplesAPixel) scene.samplesAPixel = *request.samplesAPixel;
    if (std::int64_t(scene.width) * scene.height > kMostPixels)
        throw InputError(fmt::format("{}a picture of {} x {} pixels is larger than {} million pixels",
                                     request.size ? "" : request.scene + ": ", scene.width, scene.height,
                                     kMostPixels / 1'000'000));
    for (const std::string& name : request.without) {
        const auto isNamed = [&](const Effect& effect) { return effect.name == name; };
        if (std::erase_if(scene.effects, isNamed) == 0)
            throw InputError(fmt::format("--without: the scene has no effect '{}'", name));
    }
    return scene;
}

namespace {

/// Draws the picture again without each of its effects. The first drawing of all, which has made shaders, is
/// done again too; of two the faster one counts.
template <class Draw>
std::vector<EffectCost> explainEffects(const RenderOptions& options, const RgbaImage& image,
                                       RenderCounts& whole, const Draw& draw) {
    const auto fastest = [&](RenderOptions of, RgbaImage& drawn) {
        of.measuresDevice = true;
        RenderCounts counts, again;
        drawn = draw(of, counts);
        draw(of, again);
        counts.drawMs = std::min(counts.drawMs, again.drawMs);
        counts.deviceMs = std::min(counts.deviceMs, again.deviceMs);
        return counts;
    };
    RgbaImage drawn;
    whole = fastest(options, drawn);
    std::vector<EffectCost> costs;
    for (std::size_t i = 0; i < options.effects.size(); ++i) {
        RenderOptions without = options;
        without.effects.erase(without.effects.begin() + std::ptrdiff_t(i));
        const RenderCounts counts = fastest(without, drawn);
        EffectCost& cost = costs.emplace_back();
        cost.name = options.effects[i].name;
        cost.drawMs = whole.drawMs - counts.drawMs;
        cost.deviceMs = whole.deviceMs - counts.deviceMs;
        cost.bricks = whole.bricks - counts.bricks;
        cost.passes = whole.passes - counts.passes;
        cost.textures = whole.textures - counts.textures;
        cost.deviceBytes = whole.deviceBytes - counts.deviceBytes;
        double squares = 0;
        for (std::size_t p = 0; p < image.pixels.size(); ++p)
            for (std::size_t c = 0; c < 3; ++c) {
                const double apart = double(image.pixels[p][c]) - double(drawn.pixels[p][c]);
                squares += apart * apart;
                cost.changesPixels += c == 0 && image.pixels[p] != drawn.pixels[p];
            }
        cost.changeRms = 255 * std::sqrt(squares / double(3 * image.pixels.size()));
    }
    return costs;
}

std::string explanation(const RenderedPicture& picture, std::size_t width) {
    TableRows rows{{"", "bricks", "passes", "textures", "MB", "device ms", "pixels", "RMS"}};
    const RenderCounts& all = picture.counts;
    rows.push_back({"the picture", std::to_string(all.bricks), std::to_string(all.passes),
                    std::to_string(all.textures), fmt::format("{:.1f}", 1e-6 * double(all.deviceBytes)),
                    fmt::format("{:.1f}", all.deviceMs), "", ""});
    for (const EffectCost& effect : picture.effects)
        rows.push_back({"of it " + effect.name, fmt::format("{:+}", effect.bricks),
                        fmt::format("{:+}", effect.passes), fmt::format("{:+}", effect.textures),
                        fmt::format("{:+.1f}", 1e-6 * double(effect.deviceBytes)),
                        fmt::format("{:+.1f}", effect.deviceMs), std::to_string(effect.changesPixels),
                        fmt::format("{:.2f}", effect.changeRms)});
    return formatTable(rows, width) +
           fmt::format("device memory: bricks {:.1f} MB, picture {:.1f} MB; {} draw calls\n",
                       double(picture.poolBytes) * 1e-6, double(picture.counts.deviceBytes) * 1e-6,
                       picture.counts.draws);
}

}  // namespace

std::unique_ptr<PictureSource> openPictureSource(const std::string& input, const Scene& scene,
                                                 GlThread& thread, Job& job) {
    if (isVdbName(input)) return openVdbSource(input, scene.field, scene.component, thread, job);
    const MeshFile file = openMesh(input, {}, job);
    std::unique_ptr<MeshSource> source = makeMeshSource(input, file.mesh, scene, 0, thread, job.execution);
    source->setFocus(scene);
    do source->live().scheduler().finish(job.execution);
    while (!source->live().update(BrickScheduler::Clock::now(), job.execution));
    if (source->live().isDeviceFull())
        job.fellShort("the OpenGL device has no memory for as many bricks as the focus asks for");
    else if (source->live().scheduler().isCutShort())
        job.fellShort(fmt::format("a budget of {:.3g} MB holds fewer bricks than the focus asks for",
                                  1e-6 * double(scene.bricks.budgetBytes)));
    return source;
}

void describe(const PictureSource& source, const GlThread& thread, const Scene& scene,
              RenderedPicture& picture) {
    picture.field = source.title();
    picture.platform = nameOf(thread.platform());
    picture.device = thread.info().renderer;
    picture.width = scene.width;
    picture.height = scene.height;
    picture.range = source.range();
    picture.bricks = source.bricks().size();
    picture.poolBytes = source.pool().deviceBytes();
}

namespace {

std::string whyEmpty(const Box3d& boundsWorld) {
    const Vec3d size = boundsWorld.size();
    const double longest = std::max({size.x, size.y, size.z});
    if (longest >= kShortestDrawn && longest <= kLongestDrawn)
        return "the camera, a clip or the transfer function leaves nothing to see";
    return fmt::format(
        "devices draw lengths between {:g} and {:g}, and the data is {:.6g} long: other units help",
        kShortestDrawn, kLongestDrawn, longest);
}

RenderedPicture drawScene(const RenderRequest& request, const Scene& scene, Job& job) {
    const bool isExr = chooseFormat(request.output, {}, {"png", "exr"}) == "exr";
    GlThread& thread = sharedGlThread(chooseGlPlatform(request.platform));
    warnOfDrivers(job);
    const std::unique_ptr<PictureSource> source = openPictureSource(request.input, scene, thread, job);
    const ScenePicture asked = pictureOf(withEffectsOf(scene, *source, job), *source, !isExr);
    if (asked.lacksLegend)
        job.warn(
            fmt::format("a picture of {} x {} pixels has no room for a legend", scene.width, scene.height));
    SliceRenderer renderer(thread);
    const auto draw = [&](const RenderOptions& of, RenderCounts& counts) {
        return drawFrom(*source, renderer, of, job.execution, &counts);
    };
    RenderedPicture picture;
    const RgbaImage image = draw(asked.options, picture.counts);
    if (isEmpty(image))
        throw InputError(fmt::format("nothing of {} is in the picture: {}", source->title(),
                                     whyEmpty(source->boundsWorld())));
    if (isExr)
        writeLight(request.output, image, job.execution);
    else
        writePng(request.output, onScreen(asked, image));
    if (request.explains) picture.effects = explainEffects(asked.options, image, picture.counts, draw);
    describe(*source, thread, scene, picture);
    job.say(
        fmt::format("{}: {}, {} x {} pixels, values {:.6g} to {:.6g}; {} of {} bricks drawn in {:.0f} ms\n",
                    request.output, picture.field, picture.width, picture.height, picture.range.min,
                    picture.range.max, picture.counts.bricks, picture.bricks, picture.counts.drawMs));
    if (request.explains) job.say(explanation(picture, job.textWidth));
    return picture;
}

}  // namespace

void throwNamed(const InputError& error, const RenderRequest& request, std::span<const std::string> inputs) {
    // What doesn't fit the data was asked for by the scene, or by an option.
    const std::string why = error.what();
    const bool isOfInput =
        std::ranges::any_of(inputs, [&](const std::string& input) { return why.starts_with(input + ":"); });
    if (isOfInput || request.field || request.component) throw InputError(why);
    throw InputError((request.scene.empty() ? inputs.front() : request.scene) + ": " + why);
}

RenderedPicture renderScene(const RenderRequest& request, Job& job) {
    checkOutputPaths({request.input, request.scene},
                     {{"--output", request.output}, {"--json", job.reportPath}});
    if (request.explains && request.output == "-" && job.reportPath.empty())
        throw InputError("--explain needs --json where the picture goes to standard output");
    chooseFormat(request.output, {}, {"png", "exr"});
    checkWritable(request.output);
    checkReportPath(job);
    const Scene scene = sceneOf(request, job);
    try {
        return drawScene(request, scene, job);
    } catch (const InputError& error) {
        throwNamed(error, request, std::vector{request.input});
    }
}

Json renderedJson(const RenderRequest& request, const RenderedPicture& picture) {
    Json json = documentHead("render");
    json["input"] = request.input;
    json["output"] = request.output;
    if (!request.scene.empty()) json["scene"] = request.scene;
    json["field"] = picture.field;
    json["size"] = {picture.width, picture.height};
    json["value_range"] = rangeJson(picture.range);
    json["device"] = {{"platform", picture.platform}, {"renderer", picture.device}};
    json["bricks"] = {{"total", picture.bricks}, {"drawn", picture.counts.bricks}};
    json["draw_calls"] = picture.counts.draws;
    json["device_bytes"] = {{"bricks", picture.poolBytes}, {"picture", picture.counts.deviceBytes}};
    json["draw_ms"] = picture.counts.drawMs;
    if (request.explains) {
        json["device_ms"] = picture.counts.deviceMs;
        json["passes"] = picture.counts.passes;
        json["textures"] = picture.counts.textures;
        json["effects"] = Json::array();
        for (const EffectCost& effect : picture.effects)
            json["effects"].push_back({{"name", effect.name},
                                       {"draw_ms", effect.drawMs},
                                       {"device_ms", effect.deviceMs},
                                       {"passes", effect.passes},
                                       {"textures", effect.textures},
                                       {"device_bytes", effect.deviceBytes},
                                       {"bricks", effect.bricks},
                                       {"changed_pixels", effect.changesPixels},
                                       {"change_rms_255", effect.changeRms}});
    }
    return json;
}

}  // namespace tessera
