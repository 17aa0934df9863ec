#include "job/render_vdb.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "files/atomic_file.h"
#include "job/output_paths.h"
#include "job/table_text.h"
#include "job/vdb_contents.h"
#include "pictures/image.h"
#include "pictures/image_exr.h"
#include "pool/pool_target.h"
#include "pool/stored_bricks.h"
#include "scene/colour_maps.h"
#include "scene/scene_file.h"
#include "tessera/error.h"
#include "vdb/vdb_read.h"

namespace tessera {

namespace {

constexpr std::size_t kHistogramBins = 64;
/// 16 bytes each, and up to 20 more while they are written.
constexpr std::int64_t kMostPixels = 200'000'000;

Scene sceneOf(const RenderRequest& request) {
    Scene scene = request.scene.empty() ? Scene{} : readScene(request.scene);
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

/// One component of a field, or the length of a vector.
class ShownChannel {
  public:
    ShownChannel(const OutputField& field, std::optional<int> component) : field_(field) {
        if (component && *component >= field.components)
            throw InputError(fmt::format("{} has {} components, counted from 0; there is no component {}",
                                         field.name, field.components, *component));
        if (component || field.components == 1) only_ = field.firstChannel + component.value_or(0);
    }

    /// A block of that channel alone.
    std::shared_ptr<const Block> of(const Block& block) const {
        auto shown = std::make_shared<Block>();
        shown->lattice = block.lattice;
        shown->box = block.box;
        shown->channels = 1;
        shown->coverage = block.coverage;
        const std::size_t points = block.count();
        shown->values.resize(points);
        for (std::size_t p = 0; p < points; ++p) shown->values[p] = valueAt(block, p);
        return shown;
    }
    std::string title() const {
        if (field_.components == 1) return field_.name;
        if (only_ < 0) return fmt::format("|{}|", field_.name);
        return fmt::format("{} {}", field_.name, only_ - field_.firstChannel);
    }

  private:
    float valueAt(const Block& block, std::size_t point) const {
        const auto at = [&](int channel) {
            return double(block.values[std::size_t(channel) * block.count() + point]);
        };
        if (only_ >= 0) return float(at(only_));
        double square = 0;
        for (int c = 0; c < field_.components; ++c)
            square += at(field_.firstChannel + c) * at(field_.firstChannel + c);
        return float(std::sqrt(square));
    }

    const OutputField& field_;
    int only_ = -1;
};

/// Calls visit(value) for the finite samples in the mesh.
template <class Visit>
void forEachSample(const std::vector<ShownBrick>& bricks, const Visit& visit) {
    for (const ShownBrick& brick : bricks)
        for (std::size_t p = 0; p < brick.samples->count(); ++p)
            if (brick.samples->coverage[p] != 0 && std::isfinite(brick.samples->values[p]))
                visit(double(brick.samples->values[p]));
}

/// Shares of the mesh's volume, as samples of coarse bricks stand for more of it.
std::vector<double> histogramOf(const std::vector<ShownBrick>& bricks, const std::array<double, 2>& range) {
    std::vector<double> shares(kHistogramBins);
    double all = 0;
    for (const ShownBrick& brick : bricks) {
        const double volume = std::ldexp(1.0, -3 * brick.leaf.key.depth.halvings());
        for (std::size_t p = 0; p < brick.samples->count(); ++p) {
            const auto value = double(brick.samples->values[p]);
            if (brick.samples->coverage[p] == 0 || !(value >= range[0] && value <= range[1])) continue;
            const double share = range[0] < range[1] ? (value - range[0]) / (range[1] - range[0]) : 0;
            shares[std::min(std::size_t(share * double(kHistogramBins)), kHistogramBins - 1)] += volume;
            all += volume;
        }
    }
    for (double& share : shares) share = all > 0 ? share / all : 0;
    return shares;
}

BrickPool makePool(GlThread& thread, const BrickTree& tree, const ValueRange& range) {
    TexelCoding coding({ValueCoding(range, SampleFormat::r32f)}, SampleFormat::r32f);
    const std::int64_t edge = tree.brickCells() + 1;
    PoolOptions options;
    options.budgetBytes = std::int64_t(tree.leafCount()) * edge * edge * edge * coding.pointBytes();
    // A little more, as atlases aren't of every size.
    options.budgetBytes += options.budgetBytes / 8 + 64 * edge * edge * edge * coding.pointBytes();
    return {thread, tree.brickCells(), std::move(coding), options};
}

/// Light for a value of a screen (sRGB).
double linearFromScreen(double v) {
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

void writeLight(const std::string& path, const RgbaImage& image, const Execution& execution) {
    ExrImage exr;
    exr.width = image.width;
    exr.height = image.height;
    for (const char* name : {"R", "G", "B", "A"}) exr.channels.push_back({name, {}});
    for (const Rgba& pixel : image.pixels) {
        const auto opacity = double(pixel[3]);
        for (std::size_t c = 0; c < 3; ++c) {
            const double shown = opacity > 0 ? std::min(double(pixel[c]) / opacity, 1.0) : 0;
            exr.channels[c].values.push_back(float(linearFromScreen(shown) * opacity));
        }
        exr.channels[3].values.push_back(pixel[3]);
    }
    writeExr(path, exr, execution);
}

LegendOptions legendOf(const Scene& scene, const std::string& title, const std::array<double, 2>& range) {
    LegendOptions legend;
    legend.title = scene.unit.empty() ? title : fmt::format("{} [{}]", title, scene.unit);
    legend.min = range[0];
    legend.max = range[1];
    legend.isLogarithmic = scene.function.isLogarithmic && scene.function.stops.empty();
    return legend;
}

/// A function's colours, those of stops without opacity too.
std::function<Rgb(double)> coloursOf(TransferFunction function) {
    for (TransferFunction::Stop& stop : function.stops) stop.opacity = 1;
    return [function](double value) {
        const std::array<double, 4> shown = shownAt(function, value);
        const auto byte = [](double v) { return std::uint8_t(std::lround(255 * std::clamp(v, 0.0, 1.0))); };
        return Rgb{byte(shown[0]), byte(shown[1]), byte(shown[2])};
    };
}

/// Draws the picture again without each of its effects. The first drawing of all, which has made shaders, is
/// done again too; of two the faster one counts.
template <class Draw>
std::vector<EffectCost> explainEffects(const RenderOptions& options, const RgbaImage& image,
                                       RenderCounts& whole, const Draw& draw) {
    const auto fastest = [&](const RenderOptions& of, RgbaImage& drawn) {
        RenderCounts counts, again;
        drawn = draw(of, counts);
        draw(of, again);
        counts.drawMs = std::min(counts.drawMs, again.drawMs);
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
        cost.bricks = whole.bricks - counts.bricks;
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
    TableRows rows{{"", "bricks", "ms", "changed pixels", "RMS of 255"}};
    rows.push_back({"the picture", std::to_string(picture.counts.bricks),
                    fmt::format("{:.1f}", picture.counts.drawMs), "", ""});
    for (const EffectCost& effect : picture.effects)
        rows.push_back({"of it " + effect.name, fmt::format("{:+}", effect.bricks),
                        fmt::format("{:+.1f}", effect.drawMs), std::to_string(effect.changesPixels),
                        fmt::format("{:.2f}", effect.changeRms)});
    return formatTable(rows, width) +
           fmt::format("device memory: bricks {:.1f} MB, picture {:.1f} MB; {} draw calls\n",
                       double(picture.poolBytes) * 1e-6, double(picture.counts.deviceBytes) * 1e-6,
                       picture.counts.draws);
}

}  // namespace

namespace {

RenderedPicture drawScene(const RenderRequest& request, const Scene& scene, VdbFile& file, Job& job) {
    const bool isExr = chooseFormat(request.output, {}, {"png", "exr"}) == "exr";
    const OutputField& field = chooseField(file, scene.field);
    const ShownChannel channel(field, scene.component);
    const Box3d bounds = coveredBounds(file);
    if (bounds.empty()) throw InputError(request.input + ": no voxel lies in the mesh: nothing to draw");

    StoredBricks stored =
        showStored(file.tree, file.store, {file.layers, file.halfFloat, true}, job.execution);
    file.store = BrickStore();
    parallelFor(job.execution, std::int64_t(stored.bricks.size()), [&](std::int64_t i) {
        ShownBrick& brick = stored.bricks[std::size_t(i)];
        brick.samples = channel.of(*brick.samples);
    });
    RenderedPicture picture;
    forEachSample(stored.bricks, [&](double value) {
        picture.range.min = std::min(picture.range.min, value);
        picture.range.max = std::max(picture.range.max, value);
    });
    if (picture.range.empty())
        throw InputError(
            fmt::format("{}: {} has no finite value: nothing to draw", request.input, channel.title()));
    // What lies beyond the layers of an extension isn't read.
    if (file.layers == 0)
        for (const std::string& note : stored.notes) job.say(note + "\n");

    const std::array<double, 2> shownRange = shownRangeOf(scene.function, picture.range);
    const LegendOptions legend = legendOf(scene, channel.title(), shownRange);
    const bool wantsLegend = scene.hasLegend && !isExr;
    const int besides = wantsLegend ? legendPixels(legend, scene.width, scene.height) : 0;
    if (wantsLegend && besides == 0)
        job.warn(
            fmt::format("a picture of {} x {} pixels has no room for a legend", scene.width, scene.height));
    RenderOptions options;
    options.camera = cameraOf(scene, bounds, besides);
    options.function = functionOf(scene.function, picture.range, histogramOf(stored.bricks, shownRange));
    const Vec3d size = bounds.size();
    options.layerWorld = scene.layerWorld.value_or(std::max({size.x, size.y, size.z}) / 20);
    options.slicesAVoxel = scene.slicesAVoxel;
    options.within = scene.within;
    options.samplesAPixel = scene.samplesAPixel;
    options.effects = scene.effects;

    GlThread& thread = sharedGlThread(chooseGlPlatform(request.platform));
    BrickPool pool = makePool(thread, file.tree, picture.range);
    PoolTarget target(pool, job.execution.threads);
    target.publish({.removed = {}, .added = stored.bricks});
    if (target.isBehind()) target.catchUp();
    std::vector<GrowingLeaf> leaves;
    for (const ShownBrick& brick : stored.bricks) leaves.push_back(brick.leaf);
    const Depth deepest(file.tree.levelCount() - 1);
    const BrickFrame frame{file.tree.originWorld(), file.tree.spacingWorld(levelOf(Depth(0), deepest)),
                           file.tree.brickCells()};
    const auto state = pool.state();
    SliceRenderer renderer(thread);
    const std::vector<PlacedBrick> placed = placeBricks(target, leaves, 0, job.execution);
    const auto draw = [&](const RenderOptions& of, RenderCounts& counts) {
        return renderer.draw(pool, *state, frame, placed, of, job.execution, &counts);
    };
    const RgbaImage image = draw(options, picture.counts);
    if (std::none_of(image.pixels.begin(), image.pixels.end(), [](const Rgba& p) { return p[3] > 0; }))
        throw InputError(
            fmt::format("nothing of {} is in the picture: the camera, a clip or the transfer "
                        "function leaves nothing to see",
                        channel.title()));
    if (isExr) {
        writeLight(request.output, image, job.execution);
    } else {
        RgbImage shown = overGround(image, scene.ground);
        if (wantsLegend) putLegend(shown, legend, coloursOf(options.function));
        writePng(request.output, shown);
    }
    if (request.explains) picture.effects = explainEffects(options, image, picture.counts, draw);
    picture.field = channel.title();
    picture.platform = nameOf(thread.platform());
    picture.device = thread.info().renderer;
    picture.width = image.width;
    picture.height = image.height;
    picture.bricks = stored.bricks.size();
    picture.poolBytes = pool.deviceBytes();
    job.say(
        fmt::format("{}: {}, {} x {} pixels, values {:.6g} to {:.6g}; {} of {} bricks drawn in {:.0f} ms\n",
                    request.output, picture.field, picture.width, picture.height, picture.range.min,
                    picture.range.max, picture.counts.bricks, picture.bricks, picture.counts.drawMs));
    if (request.explains) job.say(explanation(picture, job.textWidth));
    return picture;
}

}  // namespace

RenderedPicture renderVdb(const RenderRequest& request, Job& job) {
    checkOutputPaths({request.input, request.scene},
                     {{"--output", request.output}, {"--json", job.reportPath}});
    if (request.explains && request.output == "-" && job.reportPath.empty())
        throw InputError("--explain needs --json where the picture goes to standard output");
    chooseFormat(request.output, {}, {"png", "exr"});
    checkWritable(request.output);
    checkReportPath(job);
    const Scene scene = sceneOf(request);
    VdbFile file = readVdb(request.input);
    try {
        return drawScene(request, scene, file, job);
    } catch (const InputError& error) {
        // What doesn't fit the data was asked for by the scene, or by an option.
        const std::string why = error.what();
        const bool isOfInput = why.starts_with(request.input + ":");
        if (isOfInput || request.field || request.component) throw;
        throw InputError((request.scene.empty() ? request.input : request.scene) + ": " + why);
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
        json["effects"] = Json::array();
        for (const EffectCost& effect : picture.effects)
            json["effects"].push_back({{"name", effect.name},
                                       {"draw_ms", effect.drawMs},
                                       {"bricks", effect.bricks},
                                       {"changed_pixels", effect.changesPixels},
                                       {"change_rms_255", effect.changeRms}});
    }
    return json;
}

}  // namespace tessera
