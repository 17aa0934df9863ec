#include "render/effects/bricks.h"

#include "render/shaders.h"

namespace tessera {

Effect brickEdgesEffect(const BrickEdges& edges) {
    Effect effect;
    effect.name = "bricks";
    effect.texts = {shaders::render::kBricks};
    effect.face = "bricksFace";
    effect.needsAllBricks = true;
    effect.setUniforms = [edges](const EffectScene& scene) {
        scene.set("bricksWidth", 0.5 * edges.widthPixels * scene.pixelSize * scene.lineScale);
        scene.set("bricksOpacity", edges.opacity);
    };
    return effect;
}

}  // namespace tessera
