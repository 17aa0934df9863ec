#include "render/effects/probes.h"

#include "render/shaders.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kMostShapes = 16, kMostTerms = 64;

/// As the shader has it.
struct PostfixShape {
    std::vector<ProbeShape> shapes;
    std::vector<GLint> terms;

    void add(const ProbeShape& shape) {
        if (shape.kind <= ProbeShape::box) {
            terms.push_back(GLint(shapes.size()));
            shapes.push_back(shape);
            return;
        }
        if (shape.parts.empty()) throw InputError("a combination of probes needs a shape");
        for (std::size_t i = 0; i < shape.parts.size(); ++i) {
            add(shape.parts[i]);
            if (i > 0) terms.push_back(GLint(ProbeShape::box) - GLint(shape.kind));
        }
    }
};

}  // namespace

Effect probesEffect(const Probes& probes) {
    PostfixShape postfix;
    postfix.add(probes.shape);
    if (postfix.shapes.size() > kMostShapes || postfix.terms.size() > kMostTerms)
        throw InputError("probes have 1 to 16 shapes");
    namespace text = shaders::render;
    Effect effect;
    effect.name = "probes";
    effect.texts = {text::kProbeShapes, text::kLight, text::kProbes};
    effect.hideTexts = {text::kProbeShapes};
    effect.surfaceDistance = "probesDistance";
    effect.surface = "probesSurface";
    effect.hide = "probesHide";
    effect.needsAllBricks = true;
    effect.setUniforms = [probes, postfix](const EffectScene& scene) {
        std::vector<std::array<float, 4>> shapes;
        std::vector<GLint> kinds;
        const auto place = [&](const Vec3d& world, double last) {
            const Vec3d p = world - scene.eyeWorld;
            shapes.push_back({float(p.x), float(p.y), float(p.z), float(last)});
        };
        for (const ProbeShape& shape : postfix.shapes) {
            kinds.push_back(shape.kind);
            switch (shape.kind) {
                case ProbeShape::plane:
                    shapes.push_back(scene.planeFromEye(shape.half));
                    shapes.push_back({});
                    break;
                case ProbeShape::ball:
                    place(shape.centerWorld, shape.radiusWorld);
                    shapes.push_back({});
                    break;
                default:
                    place(shape.boxWorld.min, 0);
                    place(shape.boxWorld.max, 0);
            }
        }
        scene.set("probeShapes", shapes);
        scene.set("probeKinds", kinds);
        scene.set("probeCount", int(kinds.size()));
        scene.set("probeTerms", postfix.terms);
        scene.set("probeTermCount", int(postfix.terms.size()));
        scene.set("probesKeepInside", int(probes.keepsInside));
        scene.set("probeOpacity", probes.opacity);
        scene.setDirection("probeLight", probes.towardsLight);
        const std::array<float, 4> lit{0.4f, 0.6f, 0.1f, 30}, unlit{1, 0, 0, 1};
        scene.set("probeWeights", std::span(probes.isLit ? &lit : &unlit, 1));
    };
    return effect;
}

}  // namespace tessera
