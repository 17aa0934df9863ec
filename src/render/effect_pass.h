#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>

#include "pool/brick_pool.h"
#include "render/effect.h"

namespace tessera {

/// What compute shaders of effects need of a picture. All of it must outlive the pass.
struct EffectPassSource {
    GlContext& context;
    const BrickPool& pool;
    std::span<const Effect> effects;  ///< of the picture
    std::span<const HalfSpace> within;
    int channel = 0;
    std::function<EffectScene(const GlProgram&)> sceneOf;
    std::map<std::string, GlProgram>& programs;  ///< made before
};

/// Uniforms that look places up in a pool: of shaders/samples.glsl, shaders/clips.glsl and
/// effects/pool_place.glsl.
void setPoolUniforms(const EffectScene& scene, const BrickPool& pool, std::span<const HalfSpace> within,
                     int channel);

/// How an effect makes a texture before a picture is drawn: by compute shaders, which look up places in the
/// pool. The buffers of the stops and the pool's index are bound.
class EffectPass {
  public:
    explicit EffectPass(const EffectPassSource& source) : source_(source) {}

    GlContext& context() const { return source_.context; }
    /// A program of this text behind those of effects/pool_place.glsl, effects/hidden.glsl and
    /// effects/depth.glsl; their uniforms are set.
    EffectScene begin(const ShaderText& compute);
    /// So many work groups; ends with a barrier, so that what comes later sees what was written.
    void run(const EffectScene& scene, const Vec3i& groups);
    /// For each texture of the pool that has bricks of the channel, which is bound.
    void runForEachAtlas(const EffectScene& scene, const Vec3i& groups);
    /// Run so far.
    int passes() const { return passes_; }

  private:
    EffectPassSource source_;
    int passes_ = 0;
};

}  // namespace tessera
