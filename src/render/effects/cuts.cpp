#include "render/effects/cuts.h"

#include <algorithm>

#include "render/shaders.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kMostPlanes = 16, kMostLines = 64;

/// Between the ends of what values have and of what the transfer function tells apart.
std::vector<double> evenValues(const EffectScene& scene, int count) {
    const auto& stops = scene.function.stops;
    double low = scene.range.min, high = scene.range.max;
    if (stops.size() > 1 && stops.front().value < high && stops.back().value > low) {
        low = std::max(low, stops.front().value);
        high = std::min(high, stops.back().value);
    }
    std::vector<double> values;
    for (int i = 1; i <= count; ++i) values.push_back(low + (high - low) * i / (count + 1));
    return values;
}

}  // namespace

Effect cutsEffect(const Cuts& cuts) {
    if (cuts.planes.empty() || cuts.planes.size() > kMostPlanes)
        throw InputError("a picture has 1 to 16 cut planes");
    const Contours contours = cuts.contours.value_or(Contours{});
    if (contours.values.size() > kMostLines || contours.count < 1 || contours.count > int(kMostLines))
        throw InputError("cut planes have 1 to 64 contour lines");
    namespace text = shaders::render;
    Effect effect;
    effect.name = "cuts";
    effect.texts = {text::kPoolPlace, text::kNear, text::kCuts};
    effect.surfaceDistance = "cutsDistance";
    effect.surface = "cutsSurface";
    effect.needsAllBricks = true;
    effect.readsIndex = true;
    effect.setUniforms = [cuts, contours](const EffectScene& scene) {
        std::vector<std::array<float, 4>> planes;
        std::vector<float> opacities, codes;
        for (const CutPlane& plane : cuts.planes) {
            planes.push_back(scene.planeFromEye(plane.half));
            opacities.push_back(float(plane.opacity));
        }
        if (cuts.contours)
            for (const double value :
                 contours.values.empty() ? evenValues(scene, contours.count) : contours.values)
                codes.push_back(float(scene.coding.encode(value)));
        scene.set("cutPlanes", planes);
        scene.set("cutOpacities", opacities);
        scene.set("cutCount", int(planes.size()));
        if (!codes.empty()) scene.set("contourCodes", codes);
        scene.set("contourCount", int(codes.size()));
        const std::array<double, 3>& color = contours.color;
        scene.set("contourColor", Vec3d(color[0], color[1], color[2]));
        scene.set("contourWidth", 0.5 * contours.widthPixels * scene.lineScale);
        scene.set("cutPixelSize", scene.pixelSize);
    };
    return effect;
}

}  // namespace tessera
