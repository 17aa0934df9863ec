#include "device/texture_slots.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "base/check.h"
#include "mesh/field_range.h"

namespace tessera {

GLenum textureFormat(SampleFormat format, int channels) {
    const bool isOne = channels <= 1;
    switch (format) {
        case SampleFormat::r32f:
            return isOne ? GL_R32F : GL_RGBA32F;
        case SampleFormat::r16f:
            return isOne ? GL_R16F : GL_RGBA16F;
        case SampleFormat::r16:
            return isOne ? GL_R16 : GL_RGBA16;
        case SampleFormat::r8:
            return isOne ? GL_R8 : GL_RGBA8;
    }
    return GL_R32F;
}

TextureSlots::TextureSlots(GlThread& thread, std::vector<ValueCoding> codings, SampleFormat format)
    : thread_(thread), codings_(std::move(codings)), format_(format) {
    for (const ValueCoding& coding : codings_)
        TESSERA_CHECK(coding.format() == format_, "a coding of another format");
}

std::size_t TextureSlots::groupCount() const {
    return std::max<std::size_t>(1, (codings_.size() + kChannelsAGroup - 1) / kChannelsAGroup);
}

int TextureSlots::channelsOf(std::size_t group) const {
    return std::min(kChannelsAGroup, int(codings_.size()) - int(group) * kChannelsAGroup);
}

void TextureSlots::upload(std::size_t boxIndex, const Block& block) {
    TESSERA_CHECK(block.channels == channels(), "a block of other channels");
    const SampleMarks marks = sampleMarks(format_);
    const bool hasCoverage = needsCoverageTexture(format_);
    const Vec3i size = block.box.size();
    for (std::size_t group = 0; group < groupCount(); ++group) {
        const int channels = channelsOf(group);
        const std::size_t components = channels <= 1 ? 1 : kChannelsAGroup;
        const std::size_t first = group * kChannelsAGroup;
        std::vector<float> codes(block.count() * components, marks.uncovered);
        std::vector<std::uint8_t> coverage(hasCoverage ? block.count() : 0);
        for (std::size_t i = 0; i < block.count(); ++i) {
            if (block.coverage[i] == 0) continue;
            // Without a channel there is nothing but the coverage.
            if (channels == 0) codes[i] = 0;
            int mask = 1;
            for (int c = 0; c < channels; ++c) {
                const float value = block.channel(int(first) + c)[i];
                const bool isFinite = std::isfinite(value);
                if (!isFinite) mask += 1 << c;
                codes[i * components + std::size_t(c)] =
                    isFinite ? float(codings_[first + std::size_t(c)].encode(double(value))) : marks.invalid;
            }
            if (hasCoverage) coverage[i] = std::uint8_t(mask);
        }
        thread_.run([&](GlContext& context) {
            const GlFunctions& gl = context.functions();
            const SlotPlace to = place(boxIndex, group);
            gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
            gl.TextureSubImage3D(to.codes->id(), 0, to.at.x, to.at.y, to.at.z, size.x, size.y, size.z,
                                 components == 1 ? GL_RED : GL_RGBA, GL_FLOAT, codes.data());
            if (hasCoverage)
                gl.TextureSubImage3D(to.coverage->id(), 0, to.at.x, to.at.y, to.at.z, size.x, size.y, size.z,
                                     GL_RED, GL_UNSIGNED_BYTE, coverage.data());
        });
    }
}

std::vector<ValueCoding> codingsOf(const TetMesh& mesh, std::span<const int> fields, SampleFormat format) {
    std::vector<ValueCoding> codings;
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        for (int c = 0; c < field.components; ++c) codings.emplace_back(finiteFloatRange(field, c), format);
    }
    return codings;
}

}  // namespace tessera
