#include "render/effects/scale_bar.h"

#include "base/round_numbers.h"

namespace tessera {

namespace {

/// Of the picture's width, at most.
constexpr double kShare = 0.25;
/// Dots from the borders, and of the bar and its ends.
constexpr int kBorder = 8, kThick = 2, kEndHigh = 6;

}  // namespace

Effect scaleBarEffect(const ScaleBar& bar) {
    Effect effect;
    effect.name = "scale_bar";
    effect.lines = [bar](const LineView& view) {
        PictureLines lines;
        if (view.boundsWorld.empty()) return lines;
        const CameraView camera = viewOf(view.camera);
        const Vec3d middle = 0.5 * (view.boundsWorld.min + view.boundsWorld.max);
        double away = 1;  // parallel rays are as far apart everywhere
        if (!camera.isParallel) away = glm::dot(middle - view.camera.eyeWorld, camera.forward);
        if (!(away > 0)) return lines;
        const double pixelWorld = 2 * camera.high * away / view.camera.heightPixels;
        const double lengthWorld = roundLengthBelow(kShare * view.camera.widthPixels * pixelWorld);
        const double wide = lengthWorld / pixelWorld;
        PictureMarks& marks = lines.marks;
        marks.dotPixels = dotPixelsOf(view.camera);
        const double dot = marks.dotPixels;
        const double left = kBorder * dot, below = view.camera.heightPixels - kBorder * dot;
        marks.boxes.push_back({left, below - kThick * dot, wide, kThick * dot, bar.color});
        for (const double x : {left, left + wide - dot})
            marks.boxes.push_back({x, below - kEndHigh * dot, dot, kEndHigh * dot, bar.color});
        const std::string unit = bar.unit.empty() ? "" : " " + bar.unit;
        marks.words.push_back({roundNumberText(lengthWorld, lengthWorld) + unit,
                               {left + wide / 2, below - (kEndHigh + 2) * dot},
                               {0, -1},
                               bar.color});
        return lines;
    };
    return effect;
}

}  // namespace tessera
