#include "gl/gl_program.h"

#include <cctype>
#include <cstddef>
#include <set>

#include "tessera/error.h"

namespace tessera {

namespace {

/// A line of a shader and where it stands.
struct SourceLine {
    std::string text;
    std::string_view file;
    int number = 0;
};

/// The lines of a stage in the order in which OpenGL wants them. The driver's line numbers are mapped back by
/// this list: not every driver heeds the file number of a #line directive.
std::vector<SourceLine> assemble(const ShaderStage& stage, const std::vector<ShaderDefine>& defines) {
    SourceLine version{"#version 450 core", stage.text.name, 0};
    std::vector<SourceLine> extensions, body;
    const auto append = [&](const ShaderText& part) {
        std::string_view rest = part.text;
        for (int number = 1; !rest.empty(); ++number) {
            const std::size_t end = rest.find('\n');
            const SourceLine line{std::string(rest.substr(0, end)), part.name, number};
            if (line.text.starts_with("#version"))
                version = line;
            else if (line.text.starts_with("#extension"))
                extensions.push_back(line);
            else
                body.push_back(line);
            rest = end == std::string_view::npos ? std::string_view{} : rest.substr(end + 1);
        }
    };
    for (const ShaderText& part : stage.shared) append(part);
    append(stage.text);
    std::vector<SourceLine> lines{version};
    lines.insert(lines.end(), extensions.begin(), extensions.end());
    for (const ShaderDefine& define : defines)
        lines.push_back({"#define " + define.name + " " + define.value, "the definitions", 0});
    lines.insert(lines.end(), body.begin(), body.end());
    return lines;
}

/// A number at `at`, which moves behind it; -1 when there is none.
int takeNumber(std::string_view text, std::size_t& at) {
    if (at >= text.size() || !std::isdigit(static_cast<unsigned char>(text[at]))) return -1;
    int number = 0;
    for (; at < text.size() && std::isdigit(static_cast<unsigned char>(text[at])); ++at)
        number = number * 10 + (text[at] - '0');
    return number;
}

/// "0:12(5): error: ..." (Mesa, Intel), "0(12) : error ..." (NVIDIA) or "ERROR: 0:12: ..." (AMD) as
/// "<file>, line <n>: error: ...".
std::string namedMessage(std::string_view message, const std::vector<SourceLine>& lines) {
    std::size_t at = message.starts_with("ERROR: ") ? 7 : 0;
    if (takeNumber(message, at) < 0 || at >= message.size() || (message[at] != ':' && message[at] != '('))
        return std::string(message);
    ++at;
    const int number = takeNumber(message, at);
    if (number < 1 || static_cast<std::size_t>(number) > lines.size()) return std::string(message);
    const SourceLine& line = lines[static_cast<std::size_t>(number - 1)];
    const std::size_t words = message.find(": ", at);
    const std::string place =
        std::string(line.file) + (line.number > 0 ? ", line " + std::to_string(line.number) : "");
    return place + ": " + std::string(message.substr(words == std::string_view::npos ? at : words + 2));
}

/// The driver's log, one message after the other on one line.
std::string namedLog(std::string_view log, const std::vector<SourceLine>& lines) {
    std::string text;
    while (!log.empty()) {
        const std::size_t end = log.find('\n');
        const std::string_view message = log.substr(0, end);
        if (!message.empty() && message[0] != '\0')
            text += (text.empty() ? "" : "; ") + namedMessage(message, lines);
        log = end == std::string_view::npos ? std::string_view{} : log.substr(end + 1);
    }
    return text;
}

GlShader compile(GlContext& context, const ShaderStage& stage, const std::vector<ShaderDefine>& defines) {
    const GlFunctions& gl = context.functions();
    GlShader shader(context, stage.stage);
    const std::vector<SourceLine> lines = assemble(stage, defines);
    std::string text;
    for (const SourceLine& line : lines) text += line.text + "\n";
    const char* pointer = text.c_str();
    gl.ShaderSource(shader.id(), 1, &pointer, nullptr);
    gl.CompileShader(shader.id());
    GLint isCompiled = 0, length = 0;
    gl.GetShaderiv(shader.id(), GL_COMPILE_STATUS, &isCompiled);
    if (isCompiled) return shader;
    gl.GetShaderiv(shader.id(), GL_INFO_LOG_LENGTH, &length);
    std::string log(static_cast<std::size_t>(length), '\0');
    gl.GetShaderInfoLog(shader.id(), length, &length, log.data());
    log.resize(static_cast<std::size_t>(length));
    throw GlError("the shader " + std::string(stage.text.name) + " doesn't compile: " + namedLog(log, lines));
}

}  // namespace

GlProgram makeProgram(GlContext& context, std::span<const ShaderStage> stages,
                      const std::vector<ShaderDefine>& defines) {
    const GlFunctions& gl = context.functions();
    GlProgram program(context);
    std::vector<GlShader> shaders;
    std::string names;
    for (const ShaderStage& stage : stages) {
        shaders.push_back(compile(context, stage, defines));
        gl.AttachShader(program.id(), shaders.back().id());
        names += (names.empty() ? "" : ", ") + std::string(stage.text.name);
    }
    gl.LinkProgram(program.id());
    for (const GlShader& shader : shaders) gl.DetachShader(program.id(), shader.id());
    GLint isLinked = 0, length = 0;
    gl.GetProgramiv(program.id(), GL_LINK_STATUS, &isLinked);
    if (isLinked) return program;
    gl.GetProgramiv(program.id(), GL_INFO_LOG_LENGTH, &length);
    std::string log(static_cast<std::size_t>(length), '\0');
    gl.GetProgramInfoLog(program.id(), length, &length, log.data());
    log.resize(static_cast<std::size_t>(length));
    while (!log.empty() && std::isspace(static_cast<unsigned char>(log.back()))) log.pop_back();
    throw GlError("the program of " + names + " doesn't link: " + log);
}

GlProgram makeProgram(GlContext& context, std::initializer_list<ShaderStage> stages,
                      const std::vector<ShaderDefine>& defines) {
    return makeProgram(context, std::span(stages.begin(), stages.size()), defines);
}

}  // namespace tessera
