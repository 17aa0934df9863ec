#include "raster/dispatch.h"

#include <bit>

namespace tessera {

std::string glslOf(double value) {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    return "packDouble2x32(uvec2(" + std::to_string(std::uint32_t(bits)) + "u, " +
           std::to_string(std::uint32_t(bits >> 32)) + "u))";
}

std::string glslOf(float value) {
    return "uintBitsToFloat(" + std::to_string(std::bit_cast<std::uint32_t>(value)) + "u)";
}

void grow(GlContext& context, GlBuffer& buffer, std::size_t bytes) {
    if (buffer && buffer.bytes() >= std::int64_t(bytes)) return;
    buffer = GlBuffer();  // the old one goes first, for its memory
    buffer = GlBuffer(context, std::int64_t(bytes + bytes / 4), 0);
}

void fill(GlContext& context, const GlBuffer& buffer, std::size_t bytes, GLuint word) {
    context.functions().ClearNamedBufferSubData(buffer.id(), GL_R32UI, 0, GLsizeiptr(bytes), GL_RED_INTEGER,
                                                GL_UNSIGNED_INT, &word);
}

GlProgram makeComputeProgram(GlContext& context, const ShaderText& main, std::vector<ShaderText> shared,
                             std::vector<ShaderDefine> defines) {
    defines.push_back({"GROUP_THREADS", glslOf(kGroupThreads)});
    defines.push_back({"GROUPS_A_ROW", glslOf(kGroupsARow)});
    return makeProgram(context, {{GL_COMPUTE_SHADER, main, std::move(shared)}}, defines);
}

}  // namespace tessera
