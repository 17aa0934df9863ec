#pragma once

#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "gl/gl_handles.h"
#include "gl/shader_text.h"

namespace tessera {

/// One stage of a program: {GL_FRAGMENT_SHADER, kFill, {kDistance}} puts the text of kDistance before that of
/// kFill, for code that several shaders share.
struct ShaderStage {
    GLenum stage = GL_VERTEX_SHADER;
    ShaderText text;
    std::vector<ShaderText> shared = {};
};

/// `#define name value` for every stage of a program.
struct ShaderDefine {
    std::string name, value = "1";
};

/// Compiles and links. Lines that begin with `#version` or `#extension` are taken out of the texts and put at
/// the top, before the defines; with no `#version` it is `#version 450 core`. Line numbers stay those of the
/// files.
/// @throws GlError "<shader>, line <n>: <message>" for every message of the driver when compilation fails.
GlProgram makeProgram(GlContext& context, std::span<const ShaderStage> stages,
                      const std::vector<ShaderDefine>& defines = {});
GlProgram makeProgram(GlContext& context, std::initializer_list<ShaderStage> stages,
                      const std::vector<ShaderDefine>& defines = {});

}  // namespace tessera
