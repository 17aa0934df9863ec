#include "render/effects/shadows.h"

#include <algorithm>
#include <cmath>

#include "render/effect_pass.h"
#include "render/shaders.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Light is looked up so many cells nearer to the light and to the eye than the sample is: a surface doesn't
/// shade itself by the cells that it lies in.
constexpr double kNearerLight = 1.5, kNearerEye = 3;
constexpr float kNoCode = 3e38f;

/// Points along rays of the light around the volume, a cell beyond it on all sides.
struct LightGrid {
    std::array<Vec3d, 3> axes;  // of length 1; the last one points towards the light
    Vec3d originWorld{0};
    double cellWorld = 1;
    Vec3i points{0};

    LightGrid(const Box3d& box, const Shadows& shadows) {
        axes[2] = glm::normalize(shadows.towardsLight);
        const Vec3d aside = std::abs(axes[2].x) < 0.7 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
        axes[0] = glm::normalize(glm::cross(aside, axes[2]));
        axes[1] = glm::cross(axes[2], axes[0]);
        Vec3d low(0), size(0);
        for (int a = 0; a < 3; ++a) {
            const Vec3d& axis = axes[std::size_t(a)];
            for (int b = 0; b < 3; ++b) {
                low[a] += std::min(axis[b] * box.min[b], axis[b] * box.max[b]);
                size[a] += std::abs(axis[b]) * (box.max[b] - box.min[b]);
            }
        }
        cellWorld = std::max({size.x, size.y, size.z}) / shadows.resolution;
        for (int a = 0; a < 3; ++a) {
            points[a] = int(std::ceil(size[a] / cellWorld)) + 3;
            originWorld += (low[a] - cellWorld) * axes[std::size_t(a)];
        }
    }
};

std::vector<EffectTexture> makeLight(EffectPass& pass, const Shadows& shadows) {
    namespace text = shaders::render;
    const EffectScene codes = pass.begin(text::kShadowCodes);
    const GlFunctions& gl = codes.gl;
    const LightGrid grid(codes.boxWorld, shadows);
    const double edge = codes.frame.rootSpacingWorld * codes.frame.cells;
    codes.set("gridOrigin", (grid.originWorld - codes.frame.originWorld) / edge);
    for (std::size_t a = 0; a < 3; ++a)
        codes.set(("gridSteps[" + std::to_string(a) + "]").c_str(), grid.cellWorld / edge * grid.axes[a]);
    codes.set("eyeFromOrigin", codes.eyeWorld - codes.frame.originWorld);
    codes.set("rootEdge", edge);
    const Vec3i& n = grid.points;
    const auto makeTexture = [&] { return GlTexture(pass.context(), GL_TEXTURE_3D, GL_R32F, n.x, n.y, n.z); };
    EffectTexture soft{"shadowLight", makeTexture(), std::int64_t(sizeof(float)) * n.x * n.y * n.z};
    const GLuint id = soft.texture.id();
    gl.ClearTexImage(id, 0, GL_RED, GL_FLOAT, &kNoCode);
    gl.BindImageTexture(0, id, 0, GL_TRUE, 0, GL_READ_WRITE, GL_R32F);
    const Vec3i groups = (n + 3) / 4;
    pass.runForEachAtlas(codes, groups);
    const GlTexture light = makeTexture();  // for a while
    gl.BindImageTexture(1, light.id(), 0, GL_TRUE, 0, GL_READ_WRITE, GL_R32F);
    const EffectScene through = pass.begin(text::kShadowLight);
    through.set("layersAStep", grid.cellWorld / through.layerWorld);
    through.set("noCode", double(kNoCode));
    pass.run(through, {(n.x + 7) / 8, (n.y + 7) / 8, 1});
    pass.run(pass.begin(text::kShadowBlur), groups);
    for (const GLenum filter : {GL_TEXTURE_MIN_FILTER, GL_TEXTURE_MAG_FILTER})
        gl.TextureParameteri(id, filter, GL_LINEAR);
    std::vector<EffectTexture> made;
    made.push_back(std::move(soft));
    return made;
}

}  // namespace

Effect shadowsEffect(const Shadows& shadows) {
    const double length = glm::length(shadows.towardsLight);
    if (!(length > 0) || !std::isfinite(length) || shadows.resolution < 8 || shadows.resolution > 512)
        throw InputError("shadows need a direction of the light, and a grid of 8 to 512 cells");
    namespace text = shaders::render;
    Effect effect;
    effect.name = "shadows";
    effect.texts = {text::kShadows};
    effect.shade = "shadowsShade";
    effect.readsIndex = true;
    effect.setUniforms = [shadows](const EffectScene& scene) {
        const LightGrid grid(scene.boxWorld, shadows);
        const double edge = scene.frame.rootSpacingWorld * scene.frame.cells;
        std::array<std::array<float, 4>, 3> rows;
        for (int a = 0; a < 3; ++a) {
            const double points = grid.points[a];
            const Vec3d axis = grid.axes[std::size_t(a)] / (grid.cellWorld * points);
            const double offset = glm::dot(scene.frame.originWorld - grid.originWorld, axis) +
                                  (0.5 + (a == 2 ? kNearerLight : 0)) / points;
            rows[std::size_t(a)] = {float(edge * axis.x), float(edge * axis.y), float(edge * axis.z),
                                    float(offset)};
        }
        scene.set("shadowRows", rows);
        scene.set("shadowNearer", kNearerEye * grid.cellWorld / edge);
        scene.set("shadowStrength", shadows.strength);
    };
    effect.makeTextures = [shadows](EffectPass& pass) { return makeLight(pass, shadows); };
    return effect;
}

}  // namespace tessera
