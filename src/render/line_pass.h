#pragma once

#include <cstdint>
#include <vector>

#include "gl/gl_handles.h"
#include "render/picture_lines.h"
#include "render/picture_tile.h"

namespace tessera {

/// Lines that lie in a volume. They are drawn first, the nearest one for each ray: its colour, how much of
/// the pixel it covers, and how far along the ray it is. Bricks then draw what is before that and what is
/// behind it into two textures, and compose() puts the three together: right for lines that cover a part of
/// a pixel, in bricks and beside them. Of lines that cross in a pixel the one behind is lost there.
///
/// Used on the thread of its context.
class LinePass {
  public:
    /// drawLines() and compose(), and what they take.
    static constexpr int kPasses = 2, kTextures = 4;

    /// For pictures drawn in tiles of an edge, into a colour and a depth texture.
    LinePass(GlContext& context, int edge, const GlTexture& color, const GlTexture& depth);

    /// What is to be drawn from now on. @param raySize as EffectScene has it.
    void take(GlContext& context, const ProjectedLines& lines, const CameraView& view, double raySize);
    void drawLines(const GlFunctions& gl, const PictureTile& tile, const Vec3i& picture) const;
    /// What bricks draw into: attachment 0 is the picture, 1 what lies behind lines.
    const GlFramebuffer& target() const { return target_; }
    /// Lets a bricks' program see the lines: units 3 and 4.
    void bind(const GlFunctions& gl) const;
    void compose(const GlFunctions& gl) const;
    std::int64_t deviceBytes() const;

  private:
    int edge_;
    std::int64_t count_ = 0;
    GlProgram draw_, compose_;
    GlVertexArray vertices_;
    GlBuffer lines_;
    GlTexture colors_, distances_, depth_, behind_;
    GlFramebuffer lineTarget_, target_, picture_;
};

}  // namespace tessera
