#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "device/value_coding.h"
#include "gl/gl_handles.h"
#include "gl/shader_text.h"
#include "mesh/field_range.h"
#include "render/picture_lines.h"
#include "render/placed_bricks.h"
#include "tessera/focus.h"
#include "tessera/transfer_function.h"
#include "tessera/vec.h"

namespace tessera {

/// What an effect sets its uniforms by.
struct EffectScene {
    const GlFunctions& gl;
    const GlProgram& program;
    const ValueCoding& coding;  ///< of the channel shown
    ValueRange range;           ///< of that channel in all bricks
    Box3d boxWorld;             ///< of all bricks
    BrickFrame frame;
    double finestSpacingWorld = 0;  ///< of these bricks
    double layerWorld = 1;          ///< as RenderOptions has it
    /// Of a pixel: its opening in radians, or with parallel rays its width in world units.
    double pixelSize = 0;
    double lineScale = 1;  ///< RenderOptions::lineScale
    Vec3d eyeWorld{0};     ///< places in shaders are relative to it
    const TransferFunction& function;
    double largestBrickNumber = 0;  ///< of those that are known

    void set(const char* name, int value) const;
    void set(const char* name, double value) const;
    void set(const char* name, const Vec3d& value) const;
    /// Of at least one.
    void set(const char* name, std::span<const GLint> values) const;
    void set(const char* name, std::span<const float> values) const;
    void set(const char* name, std::span<const std::array<float, 4>> values) const;
    /// With the length 1; a vector of the length 0 as it is.
    void setDirection(const char* name, const Vec3d& value) const;
    /// As the shader has planes: a normal of length 1, so that no product of floats over- or underflows, and
    /// the offset relative to the eye.
    std::array<float, 4> planeFromEye(const HalfSpace& half) const;
};

class EffectPass;

/// A texture that an effect's shader reads.
struct EffectTexture {
    const char* sampler = "";  ///< the name in the shader
    GlTexture texture;
    std::int64_t bytes = 0;
};

/// Something that a picture shows beside the volume itself. The shader is put together from the effects that
/// a picture names, so one that it doesn't name leaves no text there, no uniform, no buffer and no pass.
///
/// An effect is a file of GLSL and one of C++ in render/effects. The GLSL has functions for some of the
/// places named here; shaders/brick_fragment.glsl calls them. `local` is a place in the brick, in voxels;
/// `origin` and `direction`, of length 1, are those of the ray, relative to the eye in world units.
struct Effect {
    std::string name;               ///< as scenes write it
    std::vector<ShaderText> texts;  ///< in the order needed; one that effects share stands in the shader once
    /// What `hide` needs, of `texts`. It can do without a brick.
    std::vector<ShaderText> hideTexts;
    /// void f(inout vec4 shown, vec3 local, vec3 direction): a sample of the volume that is seen, its colour
    /// and opacity.
    std::string shade;
    /// vec4 f(float codeBegin, float codeEnd, vec3 begin, vec3 end, vec3 direction): what a slab has that is
    /// thin, colour times opacity, and opacity; codes and places at both ends of the part in the mesh.
    std::string sheet;
    /// bool f(float codeBegin, float codeEnd): whether that has anything; where it hasn't, `sheet` isn't
    /// called.
    std::string hasSheet;
    /// vec4 f(vec3 local): what is on a face of the brick, where the ray comes in or goes out.
    std::string face;
    /// vec4 f(float codeBegin, float codeEnd, float layers, out float share): colour and opacity of a slab so
    /// thick, by the codes at its ends, in place of those of the code in its middle; and where in the slab
    /// that is seen, from 0 to 1. One effect's at most.
    std::string classify;
    /// float f(vec3 origin, vec3 direction, float after): how far along the ray, beyond `after`, the effect's
    /// next surface is; a lot when there is none. Slabs end there. For a ray the same numbers in every call
    /// and every brick, so that a surface is drawn once: `precise`.
    std::string surfaceDistance;
    /// vec4 f(vec3 local, vec3 origin, vec3 direction, float at): what is on that surface, as `sheet`.
    std::string surface;
    /// bool f(vec3 origin, vec3 direction, float at): whether nothing of the volume is shown there.
    std::string hide;
    bool needsAllBricks = false;     ///< those too of which the transfer function shows nothing
    bool needsBrickNumbers = false;  ///< RenderOptions::brickNumbers
    bool readsIndex = false;         ///< needs the pool's index of bricks
    std::function<void(const EffectScene&)> setUniforms;  ///< none: it has none
    /// Makes textures for a picture before it is drawn, by passes of its own, on the OpenGL thread. None: it
    /// needs none.
    std::function<std::vector<EffectTexture>(EffectPass&)> makeTextures;
    /// Lines in the volume, and marks on the picture. An effect may have nothing else.
    std::function<PictureLines(const LineView&)> lines;
    /// Of the picture's width and height, on each side: what a camera that is to be found leaves for it.
    double marginShare = 0;
};

/// What effects draw in lines, and what they put onto the picture afterwards, in their order.
PictureLines linesOf(std::span<const Effect> effects, const LineView& view);

}  // namespace tessera
