#include "render/effects/preintegration.h"

#include "render/shaders.h"

namespace tessera {

Effect preintegrationEffect() {
    Effect effect;
    effect.name = "preintegration";
    effect.texts = {shaders::render::kDepth, shaders::render::kPreintegration};
    effect.classify = "preintegrationClassify";
    return effect;
}

}  // namespace tessera
