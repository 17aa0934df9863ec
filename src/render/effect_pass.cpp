#include "render/effect_pass.h"

#include <algorithm>

#include "gl/gl_program.h"
#include "render/effect_hooks.h"
#include "render/shaders.h"

namespace tessera {

void setPoolUniforms(const EffectScene& scene, const BrickPool& pool, std::span<const HalfSpace> within,
                     int channel) {
    scene.set("component", channel % int(kChannelsAGroup));
    std::vector<std::array<float, 4>> clips;
    for (const HalfSpace& half : within) clips.push_back(scene.planeFromEye(half));
    scene.set("clipCount", int(clips.size()));
    if (!clips.empty()) scene.set("clips", clips);
    const Vec3i& slots = pool.layout().slots;
    scene.gl.ProgramUniform3i(scene.program.id(), scene.program.uniform("slotsAlong"), slots.x, slots.y,
                              slots.z);
}

EffectScene EffectPass::begin(const ShaderText& compute) {
    std::string key = std::string(compute.name) + " " + std::to_string(source_.pool.brickCells());
    for (const Effect& effect : source_.effects)
        if (!effect.hide.empty()) key += " " + effect.name;
    auto found = source_.programs.find(key);
    if (found == source_.programs.end()) {
        namespace text = shaders::render;
        const HookTexts hooks = hookTextsOf(source_.effects, &Effect::hide);
        std::vector<ShaderDefine> defines = hooks.defines;
        defines.push_back({"CELLS", std::to_string(source_.pool.brickCells())});
        defines.push_back({"BRICK_INDEX_BINDING", "2"});
        std::vector<ShaderText> shared{text::kStops, brickIndexShader(), text::kSamples, text::kClips,
                                       text::kPoolPlace};
        for (const Effect& effect : source_.effects)
            shared.insert(shared.end(), effect.hideTexts.begin(), effect.hideTexts.end());
        shared.push_back({"calls of effects", hooks.functions});
        shared.push_back(text::kHidden);
        shared.push_back(text::kDepth);
        GlProgram made = makeProgram(source_.context, {{GL_COMPUTE_SHADER, compute, shared}}, defines);
        found = source_.programs.emplace(key, std::move(made)).first;
    }
    const EffectScene scene = source_.sceneOf(found->second);
    setPoolUniforms(scene, source_.pool, source_.within, source_.channel);
    for (const Effect& effect : source_.effects)
        if (!effect.hide.empty()) effect.setUniforms(scene);
    return scene;
}

void EffectPass::run(const EffectScene& scene, const Vec3i& groups) {
    scene.gl.UseProgram(scene.program.id());
    scene.gl.DispatchCompute(GLuint(groups.x), GLuint(groups.y), GLuint(groups.z));
    scene.gl.MemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT);
    ++passes_;
}

void EffectPass::runForEachAtlas(const EffectScene& scene, const Vec3i& groups) {
    const std::size_t group = std::size_t(source_.channel) / kChannelsAGroup;
    for (int atlas = 0; atlas < source_.pool.layout().atlases; ++atlas) {
        scene.gl.BindTextureUnit(0, source_.pool.codes(atlas, group).id());
        scene.gl.BindTextureUnit(1, source_.pool.coverage(atlas, group).id());
        scene.set("atlas", atlas);
        run(scene, groups);
    }
}

}  // namespace tessera
