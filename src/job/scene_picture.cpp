#include "job/scene_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pictures/image_exr.h"

namespace tessera {

namespace {

/// Light for a value of a screen (sRGB).
double linearFromScreen(double v) {
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
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

}  // namespace

int legendPixelsOf(const Scene& scene, const PictureSource& source, bool isOnScreen) {
    if (!scene.hasLegend || !isOnScreen) return 0;
    const LegendOptions legend =
        legendOf(scene, source.title(), shownRangeOf(scene.function, source.range()));
    return legendPixels(legend, scene.width, scene.height);
}

ScenePicture pictureOf(const Scene& scene, const PictureSource& source, bool isOnScreen) {
    ScenePicture picture;
    picture.ground = scene.ground;
    const std::array<double, 2> shownRange = shownRangeOf(scene.function, source.range());
    picture.legend = legendOf(scene, source.title(), shownRange);
    const int besides = legendPixelsOf(scene, source, isOnScreen);
    picture.hasLegend = besides > 0;
    picture.lacksLegend = scene.hasLegend && isOnScreen && besides == 0;
    RenderOptions& options = picture.options;
    options.camera = cameraOf(scene, source.boundsWorld(), besides);
    options.function = functionOf(scene.function, source.range(), source.histogram(shownRange));
    const Vec3d size = source.boundsWorld().size();
    options.layerWorld = scene.layerWorld.value_or(std::max({size.x, size.y, size.z}) / 20);
    options.slicesAVoxel = scene.slicesAVoxel;
    options.within = scene.within;
    options.samplesAPixel = scene.samplesAPixel;
    options.effects = scene.effects;
    options.values = source.range();
    options.boundsWorld = source.boundsWorld();
    LineView view{options.camera, options.boundsWorld};
    if (std::ranges::any_of(options.effects, &Effect::needsBrickNumbers)) {
        options.brickNumbers = source.brickErrors();
        view.largestBrickNumber = largestOf(options.brickNumbers);
    }
    if (isOnScreen) picture.marks = linesOf(options.effects, view).marks;
    return picture;
}

RgbaImage drawFrom(const PictureSource& source, SliceRenderer& renderer, const RenderOptions& options,
                   const Execution& execution, RenderCounts* counts) {
    const auto state = source.pool().state();
    return renderer.draw(source.pool(), *state, source.frame(), source.bricks(), options, execution, counts);
}

bool isEmpty(const RgbaImage& drawn) {
    return std::none_of(drawn.pixels.begin(), drawn.pixels.end(), [](const Rgba& p) { return p[3] > 0; });
}

RgbImage onScreen(const ScenePicture& picture, const RgbaImage& drawn) {
    RgbImage shown = overGround(drawn, picture.ground);
    putMarks(shown, picture.marks, picture.ground);
    if (picture.hasLegend) putLegend(shown, picture.legend, coloursOf(picture.options.function));
    return shown;
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

}  // namespace tessera
