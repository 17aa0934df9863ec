#include "render/effects/errors.h"

#include <array>

#include "base/text.h"
#include "render/shaders.h"

namespace tessera {

namespace {

/// Without an error, at half the bound, at it; beyond it; not known.
constexpr std::array<MarkColor, 5> kColors{
    {{0.23, 0.30, 0.75}, {0.87, 0.87, 0.87}, {0.75, 0.02, 0.15}, {0.40, 0.0, 0.45}, {0.35, 0.60, 0.35}}};
/// Dots: of the bar, and from the picture's borders.
constexpr int kBarWide = 80, kBarHigh = 5, kFromBorder = 8;

double scaleOf(const ErrorTint& tint, double largest) {
    return tint.bound.value_or(largest > 0 ? largest : 1);
}

/// A bar with the colours from 0 to the bound.
PictureMarks barOf(const ErrorTint& tint, const LineView& view) {
    PictureMarks marks;
    marks.dotPixels = dotPixelsOf(view.camera);
    const double dot = marks.dotPixels, left = view.camera.widthPixels - (kBarWide + kFromBorder) * dot;
    const double below = view.camera.heightPixels - (kFromBorder + kLetterDots[1] + 3) * dot;
    for (int n = 0; n < kBarWide; ++n) {
        const double share = (n + 0.5) / kBarWide * 2;
        const auto part = std::size_t(share);
        MarkColor color;
        for (std::size_t c = 0; c < 3; ++c)
            color[c] = kColors[part][c] + (share - double(part)) * (kColors[part + 1][c] - kColors[part][c]);
        marks.boxes.push_back({left + n * dot, below - kBarHigh * dot, dot, kBarHigh * dot, color});
    }
    const double bound = scaleOf(tint, view.largestBrickNumber);
    const std::string most = tint.isShareOfRange ? shortNumber(100 * bound, 3) + "%" : shortNumber(bound, 3);
    const double wordsAt = below + (3 + kLetterDots[1] / 2.0) * dot;
    marks.words.push_back({"0", {left, wordsAt}, {1, 0}, tint.wordsColor});
    marks.words.push_back({most, {left + kBarWide * dot, wordsAt}, {-1, 0}, tint.wordsColor});
    marks.words.push_back({tint.isShareOfRange ? "error" : "error/bound",
                           {left + kBarWide * dot / 2, below - (kBarHigh + 3) * dot},
                           {0, -1},
                           tint.wordsColor});
    return marks;
}

}  // namespace

Effect errorsEffect(const ErrorTint& tint) {
    Effect effect;
    effect.name = "errors";
    effect.texts = {shaders::render::kErrors};
    effect.shade = "errorsShade";
    effect.needsBrickNumbers = true;
    effect.setUniforms = [tint](const EffectScene& scene) {
        std::array<std::array<float, 3>, kColors.size()> colors{};
        for (std::size_t n = 0; n < colors.size(); ++n)
            for (std::size_t c = 0; c < 3; ++c) colors[n][c] = float(kColors[n][c]);
        scene.gl.ProgramUniform3fv(scene.program.id(), scene.program.uniform("errorsColors"),
                                   GLsizei(colors.size()), colors[0].data());
        scene.set("errorsBound", scaleOf(tint, scene.largestBrickNumber));
        scene.set("errorsStrength", tint.strength);
    };
    effect.lines = [tint](const LineView& view) { return PictureLines{{}, barOf(tint, view)}; };
    return effect;
}

}  // namespace tessera
