#include "render/effects/occlusion.h"

#include "render/shaders.h"

namespace tessera {

Effect occlusionEffect(const Occlusion& occlusion) {
    namespace text = shaders::render;
    Effect effect;
    effect.name = "occlusion";
    effect.texts = {text::kPoolPlace, text::kNear, text::kHidden, text::kDepth, text::kOcclusion};
    effect.shade = "occlusionShade";
    effect.readsIndex = true;
    effect.setUniforms = [occlusion](const EffectScene& scene) {
        const double radius =
            occlusion.radiusWorld.value_or(occlusion.radiusVoxels * scene.finestSpacingWorld);
        scene.set("occlusionRadius", radius);
        scene.set("occlusionStrength", occlusion.strength);
        scene.set("occlusionLayers", 0.5 * radius / scene.layerWorld);
    };
    return effect;
}

}  // namespace tessera
