#include "render/line_pass.h"

#include <array>
#include <span>

#include "gl/gl_program.h"
#include "render/shaders.h"

namespace tessera {

namespace {

constexpr std::array<GLenum, 2> kBoth{GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1};
/// Along a ray that meets no line.
constexpr float kEndless = 3e38f;
/// A texel of the colours, distances and depths of lines, and of what lies behind them.
constexpr std::int64_t kTexelBytes = 4 + 4 + 4 + 16;

}  // namespace

LinePass::LinePass(GlContext& context, int edge, const GlTexture& color, const GlTexture& depth)
    : edge_(edge) {
    namespace text = shaders::render;
    draw_ = makeProgram(context,
                        {{GL_VERTEX_SHADER, text::kLineVertex}, {GL_FRAGMENT_SHADER, text::kLineFragment}});
    compose_ = makeProgram(
        context, {{GL_VERTEX_SHADER, text::kCloseVertex}, {GL_FRAGMENT_SHADER, text::kLineCompose}});
    vertices_ = GlVertexArray(context);
    colors_ = GlTexture(context, GL_TEXTURE_2D, GL_RGBA8, edge, edge);
    distances_ = GlTexture(context, GL_TEXTURE_2D, GL_R32F, edge, edge);
    depth_ = GlTexture(context, GL_TEXTURE_2D, GL_DEPTH_COMPONENT32F, edge, edge);
    behind_ = GlTexture(context, GL_TEXTURE_2D, GL_RGBA32F, edge, edge);
    const GlFunctions& gl = context.functions();
    lineTarget_ = GlFramebuffer(context);
    lineTarget_.attach(GL_COLOR_ATTACHMENT0, colors_);
    lineTarget_.attach(GL_COLOR_ATTACHMENT1, distances_);
    lineTarget_.attach(GL_DEPTH_ATTACHMENT, depth_);
    target_ = GlFramebuffer(context);
    target_.attach(GL_COLOR_ATTACHMENT0, color);
    target_.attach(GL_COLOR_ATTACHMENT1, behind_);
    target_.attach(GL_DEPTH_ATTACHMENT, depth);
    for (const GlFramebuffer* both : {&lineTarget_, &target_}) {
        gl.NamedFramebufferDrawBuffers(both->id(), GLsizei(kBoth.size()), kBoth.data());
        both->throwIfIncomplete();
    }
    picture_ = GlFramebuffer(context);
    picture_.attach(GL_COLOR_ATTACHMENT0, color);
    picture_.throwIfIncomplete();
}

void LinePass::take(GlContext& context, const ProjectedLines& lines, const CameraView& view, double raySize) {
    lines_ = GlBuffer(context, std::span(lines.lines));
    count_ = std::int64_t(lines.lines.size());
    const GlFunctions& gl = context.functions();
    const auto vector = [&](const char* name, const Vec3d& v) {
        gl.ProgramUniform3f(draw_.id(), draw_.uniform(name), float(v.x), float(v.y), float(v.z));
    };
    vector("forward", view.forward);
    vector("right", view.wide * view.right);
    vector("up", view.high * view.up);
    gl.ProgramUniform1i(draw_.id(), draw_.uniform("isParallel"), view.isParallel);
    gl.ProgramUniform1f(draw_.id(), draw_.uniform("raySize"), float(raySize));
    // With room for what is pushed back.
    const double span = 1.01 * (lines.farthestWorld - lines.nearestWorld);
    gl.ProgramUniform2f(draw_.id(), draw_.uniform("depthRange"), float(lines.nearestWorld),
                        float(span > 0 ? 1 / span : 0));
}

void LinePass::drawLines(const GlFunctions& gl, const PictureTile& tile, const Vec3i& picture) const {
    const std::array<float, 4> from = pictureFromPixel(tile, picture);
    gl.ProgramUniform4fv(draw_.id(), draw_.uniform("pictureFromPixel"), 1, from.data());
    gl.ProgramUniform4f(draw_.id(), draw_.uniform("tile"), float(tile.x),
                        float(picture.y - tile.y - tile.height), float(tile.width), float(tile.height));
    const std::array<float, 4> nothing{}, endless{kEndless, 0, 0, 0};
    const float farthest = 1;
    gl.DepthMask(GL_TRUE);
    gl.ClearNamedFramebufferfv(lineTarget_.id(), GL_COLOR, 0, nothing.data());
    gl.ClearNamedFramebufferfv(lineTarget_.id(), GL_COLOR, 1, endless.data());
    gl.ClearNamedFramebufferfv(lineTarget_.id(), GL_DEPTH, 0, &farthest);
    gl.ClearNamedFramebufferfv(target_.id(), GL_COLOR, 1, nothing.data());
    gl.Viewport(0, 0, tile.width, tile.height);
    gl.BindFramebuffer(GL_FRAMEBUFFER, lineTarget_.id());
    gl.BindVertexArray(vertices_.id());
    gl.UseProgram(draw_.id());
    gl.Enable(GL_DEPTH_TEST);
    gl.DepthFunc(GL_LEQUAL);  // the farthest place has the depth that is cleared to
    gl.Disable(GL_CULL_FACE);
    gl.Disable(GL_BLEND);
    gl.BindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, lines_.id());
    gl.DrawArraysInstanced(GL_TRIANGLES, 0, 6, GLsizei(count_));
}

void LinePass::bind(const GlFunctions& gl) const {
    gl.BindTextureUnit(3, colors_.id());
    gl.BindTextureUnit(4, distances_.id());
}

void LinePass::compose(const GlFunctions& gl) const {
    gl.BindFramebuffer(GL_FRAMEBUFFER, picture_.id());
    gl.BindVertexArray(vertices_.id());
    gl.UseProgram(compose_.id());
    gl.BindTextureUnit(0, colors_.id());
    gl.BindTextureUnit(1, behind_.id());
    gl.Disable(GL_DEPTH_TEST);
    gl.Disable(GL_CULL_FACE);
    gl.Enable(GL_BLEND);
    gl.BlendFuncSeparate(GL_ONE_MINUS_DST_ALPHA, GL_ONE, GL_ONE_MINUS_DST_ALPHA, GL_ONE);
    gl.DrawArrays(GL_TRIANGLES, 0, 3);
}

std::int64_t LinePass::deviceBytes() const {
    return lines_.bytes() + kTexelBytes * edge_ * edge_;
}

}  // namespace tessera
