// What the resamplers rely on beyond OpenGL's promises: that these combinations work on every platform here.
#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "gl/gl_program.h"
#include "gl/gl_thread.h"
#include "gl_test_tools.h"

namespace tessera {
namespace {

constexpr ShaderText kTriangleVert{"triangle.vert.glsl", R"(
#extension GL_ARB_shader_viewport_layer_array : enable
#extension GL_AMD_vertex_shader_layer : enable
layout(std430, binding = 0) readonly buffer Values { dvec4 values[]; };
flat out dvec4 sent;
uniform float depth = 0;
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3 : -1, gl_VertexID == 2 ? 3 : -1);
    gl_Position = vec4(corner, depth, 1);
    gl_Layer = gl_InstanceID;
    sent = values[gl_InstanceID];
}
)"};

class GlDraw : public testing::TestWithParam<GlPlatform> {
  protected:
    void SetUp() override {
        TESSERA_NEEDS_GL(GetParam());
        if (!glDeviceInfo(GetParam()).hasVertexShaderLayer)
            GTEST_SKIP() << "gl_Layer can't be written by a vertex shader";
    }
};

/// One value a layer of a texture with one texel a layer.
std::vector<float> readLayers(GlContext& context, const GlTexture& texture, int layers) {
    std::vector<float> values(static_cast<std::size_t>(layers), -1);
    context.functions().GetTextureImage(texture.id(), 0, GL_RED, GL_FLOAT,
                                        static_cast<GLsizei>(values.size() * sizeof(float)), values.data());
    return values;
}

TEST_P(GlDraw, DoublesGoFromAStorageBufferThroughAFlatVaryingUnrounded) {
    GlThread thread(GetParam());
    const ShaderText fragment{"difference.frag.glsl", R"(
flat in dvec4 sent;
layout(location = 0) out float value;
void main() { value = float((sent.x * sent.y + sent.z) * sent.w); }
)"};
    // x y + z is 2^-40 k exactly in double and 0 in float.
    constexpr int kLayers = 4;
    const double tiny = 0x1p-40;
    std::array<std::array<double, 4>, kLayers> source{};
    for (int k = 0; k < kLayers; ++k) source[static_cast<std::size_t>(k)] = {1 + k * tiny, 1, -1, 0x1p40};
    const std::vector<float> values = thread.run([&](GlContext& context) {
        const GlFunctions& gl = context.functions();
        const GlProgram program =
            makeProgram(context, {{GL_VERTEX_SHADER, kTriangleVert}, {GL_FRAGMENT_SHADER, fragment}});
        const GlBuffer buffer(context, std::span(source));
        const GlTexture target(context, GL_TEXTURE_3D, GL_R32F, 1, 1, kLayers);
        GlFramebuffer framebuffer(context);
        framebuffer.attach(GL_COLOR_ATTACHMENT0, target);
        const GlVertexArray empty(context);
        gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, buffer.id());
        gl.BindVertexArray(empty.id());
        gl.UseProgram(program.id());
        gl.Viewport(0, 0, 1, 1);
        gl.DrawArraysInstanced(GL_TRIANGLES, 0, 3, kLayers);
        return readLayers(context, target, kLayers);
    });
    EXPECT_EQ(values, (std::vector<float>{0, 1, 2, 3}));
}

/// Draws the layers' values at depth 0.25, then half of the layers' again, negative, at `secondDepth`.
std::vector<float> drawTwice(GlContext& context, GLenum colorTarget, float secondDepth) {
    const ShaderText fragment{"value.frag.glsl", R"(
flat in dvec4 sent;
uniform float factor;
layout(location = 0) out float value;
void main() { value = factor * float(sent.x); }
)"};
    constexpr int kLayers = 4;
    const std::array<std::array<double, 4>, kLayers> source{{{1}, {2}, {3}, {4}}};
    const GlFunctions& gl = context.functions();
    const GlProgram program =
        makeProgram(context, {{GL_VERTEX_SHADER, kTriangleVert}, {GL_FRAGMENT_SHADER, fragment}});
    const GlBuffer buffer(context, std::span(source));
    const GlTexture color(context, colorTarget, GL_R32F, 1, 1, kLayers);
    const GlTexture depth(context, GL_TEXTURE_2D_ARRAY, GL_DEPTH_COMPONENT32F, 1, 1, kLayers);
    GlFramebuffer framebuffer(context);
    framebuffer.attach(GL_COLOR_ATTACHMENT0, color);
    framebuffer.attach(GL_DEPTH_ATTACHMENT, depth);
    framebuffer.throwIfIncomplete();
    const GlVertexArray empty(context);
    gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
    const float far = 1;
    gl.ClearNamedFramebufferfv(framebuffer.id(), GL_DEPTH, 0, &far);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, buffer.id());
    gl.BindVertexArray(empty.id());
    gl.UseProgram(program.id());
    gl.Viewport(0, 0, 1, 1);
    gl.Enable(GL_DEPTH_TEST);
    gl.ProgramUniform1f(program.id(), program.uniform("factor"), 1);
    gl.ProgramUniform1f(program.id(), program.uniform("depth"), 0.25f);
    gl.DrawArraysInstanced(GL_TRIANGLES, 0, 3, kLayers);
    gl.ProgramUniform1f(program.id(), program.uniform("factor"), -1);
    gl.ProgramUniform1f(program.id(), program.uniform("depth"), secondDepth);
    gl.DrawArraysInstanced(GL_TRIANGLES, 0, 3, kLayers / 2);
    return readLayers(context, color, kLayers);
}

TEST_P(GlDraw, ADepthArrayServesTheLayersOfA3dTarget) {
    GlThread thread(GetParam());
    const GlFormat& format = thread.info().formats[3];
    ASSERT_EQ(format.name, "r32f");
    if (!format.isLayeredDepth) GTEST_SKIP() << "a 3D target takes no 2D-array depth on this device";
    const auto draw = [](float depth) {
        return [depth](GlContext& context) { return drawTwice(context, GL_TEXTURE_3D, depth); };
    };
    EXPECT_EQ(thread.run(draw(0.125f)), (std::vector<float>{-1, -2, 3, 4})) << "nearer must win";
    EXPECT_EQ(thread.run(draw(0.5f)), (std::vector<float>{1, 2, 3, 4})) << "farther must lose";
}

TEST_P(GlDraw, ADepthArrayServesTheLayersOfAnArrayTarget) {
    GlThread thread(GetParam());
    const auto draw = [](float depth) {
        return [depth](GlContext& context) { return drawTwice(context, GL_TEXTURE_2D_ARRAY, depth); };
    };
    EXPECT_EQ(thread.run(draw(0.125f)), (std::vector<float>{-1, -2, 3, 4})) << "nearer must win";
    EXPECT_EQ(thread.run(draw(0.5f)), (std::vector<float>{1, 2, 3, 4})) << "farther must lose";
}

TEST_P(GlDraw, EveryFormatOfTheContractIsALayeredTarget) {
    const GlDeviceInfo& info = glDeviceInfo(GetParam());
    for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_TRUE(info.formats[i].isRenderable) << info.formats[i].name;
        EXPECT_TRUE(info.formats[i].isLayered3d) << info.formats[i].name;
        EXPECT_TRUE(info.formats[i].isLayeredArray) << info.formats[i].name;
    }
}

TEST_P(GlDraw, AFragmentQueryCountsPixels) {
    GlThread thread(GetParam());
    const ShaderText fragment{"one.frag.glsl", "layout(location = 0) out float v;\nvoid main() { v = 1; }\n"};
    const std::uint64_t pixels = thread.run([&](GlContext& context) {
        const GlFunctions& gl = context.functions();
        const GlProgram program =
            makeProgram(context, {{GL_VERTEX_SHADER, kTriangleVert}, {GL_FRAGMENT_SHADER, fragment}});
        const std::array<std::array<double, 4>, 3> source{};
        const GlBuffer buffer(context, std::span(source));
        const GlTexture target(context, GL_TEXTURE_3D, GL_R8, 16, 8, 3);
        GlFramebuffer framebuffer(context);
        framebuffer.attach(GL_COLOR_ATTACHMENT0, target);
        const GlVertexArray empty(context);
        gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer.id());
        gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, buffer.id());
        gl.BindVertexArray(empty.id());
        gl.UseProgram(program.id());
        gl.Viewport(0, 0, 16, 8);
        GlQuery samples(context, GL_SAMPLES_PASSED);
        samples.begin();
        gl.DrawArraysInstanced(GL_TRIANGLES, 0, 3, 3);
        samples.end();
        return samples.result();
    });
    EXPECT_EQ(pixels, 16u * 8u * 3u);
}

INSTANTIATE_TEST_SUITE_P(Platform, GlDraw, testing::ValuesIn(glPlatforms()),
                         [](const auto& test) { return testNameOf(test.param); });

}  // namespace
}  // namespace tessera
