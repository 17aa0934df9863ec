#include "render/effects/shading.h"

#include <algorithm>

#include "render/shaders.h"

namespace tessera {

namespace {

/// Values that change by their whole range over so many sizes of the scene are taken as even.
constexpr double kEvenSizes = 5;

}  // namespace

Effect shadingEffect(const Shading& shading) {
    namespace text = shaders::render;
    Effect effect;
    effect.name = "shading";
    effect.texts = {text::kPoolPlace, text::kNear, text::kGradient, text::kLight, text::kShading};
    effect.shade = "shadingShade";
    effect.readsIndex = true;
    effect.setUniforms = [shading](const EffectScene& scene) {
        scene.setDirection("shadingLight", shading.towardsLight);
        const std::array<float, 4> weights{float(shading.ambient), float(shading.diffuse),
                                           float(shading.specular), float(shading.shininess)};
        scene.set("shadingWeights", std::span(&weights, 1));
        const Vec3d size = scene.boxWorld.size();
        const double codes = scene.coding.encode(scene.range.max) - scene.coding.encode(scene.range.min);
        scene.set("shadingEven", codes / (kEvenSizes * std::max({size.x, size.y, size.z})));
    };
    return effect;
}

}  // namespace tessera
