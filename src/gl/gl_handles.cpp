#include "gl/gl_handles.h"

#include <algorithm>
#include <string>

#include "tessera/error.h"

namespace tessera {

namespace {

GLuint nameOf(std::uintptr_t name) {
    return static_cast<GLuint>(name);
}

GLuint createBuffer(const GlFunctions& gl) {
    GLuint name = 0;
    gl.CreateBuffers(1, &name);
    return name;
}

GLuint createTexture(const GlFunctions& gl, GLenum target) {
    GLuint name = 0;
    gl.CreateTextures(target, 1, &name);
    return name;
}

GLuint createFramebuffer(const GlFunctions& gl) {
    GLuint name = 0;
    gl.CreateFramebuffers(1, &name);
    return name;
}

GLuint createVertexArray(const GlFunctions& gl) {
    GLuint name = 0;
    gl.CreateVertexArrays(1, &name);
    return name;
}

GLuint createQuery(const GlFunctions& gl) {
    // Not glCreateQueries: Mesa's refuses the targets of pipeline statistics.
    GLuint name = 0;
    gl.GenQueries(1, &name);
    return name;
}

GLsync syncOf(std::uintptr_t name) {
    return reinterpret_cast<GLsync>(name);
}

/// Throws as GlContext::throwIfFailed(), and says what couldn't be had.
void throwIfFailed(GlContext& context, const std::string& what) {
    try {
        context.throwIfFailed();
    } catch (const GlMemoryError& error) {
        throw GlMemoryError("no OpenGL " + what + ": " + error.what());
    } catch (const GlError& error) {
        throw GlError("no OpenGL " + what + ": " + error.what());
    }
}

std::string incompleteReason(GLenum status) {
    switch (status) {
        case GL_FRAMEBUFFER_INCOMPLETE_ATTACHMENT:
            return "an attachment can't be drawn into";
        case GL_FRAMEBUFFER_INCOMPLETE_MISSING_ATTACHMENT:
            return "nothing is attached";
        case GL_FRAMEBUFFER_INCOMPLETE_DRAW_BUFFER:
            return "a draw buffer has no attachment";
        case GL_FRAMEBUFFER_INCOMPLETE_LAYER_TARGETS:
            return "layered and flat attachments are mixed, or their kinds differ";
        case GL_FRAMEBUFFER_INCOMPLETE_MULTISAMPLE:
            return "the attachments differ in samples";
        case GL_FRAMEBUFFER_UNSUPPORTED:
            return "the driver doesn't support this combination of formats";
        default:
            return "status " + std::to_string(status);
    }
}

}  // namespace

GlBuffer::GlBuffer(GlContext& context, std::int64_t bytes, GLbitfield flags, const void* source)
    : GlHandle(context, createBuffer(context.functions())), bytes_(bytes) {
    context.throwIfFailed();
    gl().NamedBufferStorage(id(), std::max<GLsizeiptr>(bytes, 1), bytes > 0 ? source : nullptr, flags);
    throwIfFailed(context, "buffer of " + std::to_string(bytes) + " bytes");
}

void* GlBuffer::map(std::int64_t offset, std::int64_t bytes, GLbitfield access) {
    void* memory = gl().MapNamedBufferRange(id(), offset, bytes, access);
    if (!memory) throw GlError("OpenGL can't map " + std::to_string(bytes) + " bytes of a buffer");
    return memory;
}

void GlBuffer::unmap() {
    gl().UnmapNamedBuffer(id());
}

void GlBuffer::destroy(const GlFunctions& gl, std::uintptr_t name) {
    const GLuint id = nameOf(name);
    gl.DeleteBuffers(1, &id);
}

GlTexture::GlTexture(GlContext& context, GLenum target, GLenum internalFormat, int width, int height,
                     int depth)
    : GlHandle(context, createTexture(context.functions(), target)) {
    context.throwIfFailed();
    if (target == GL_TEXTURE_2D)
        gl().TextureStorage2D(id(), 1, internalFormat, width, height);
    else
        gl().TextureStorage3D(id(), 1, internalFormat, width, height, depth);
    throwIfFailed(context, "texture of " + std::to_string(width) + " x " + std::to_string(height) + " x " +
                               std::to_string(depth) + " texels");
    gl().TextureParameteri(id(), GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl().TextureParameteri(id(), GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    for (const GLenum axis : {GL_TEXTURE_WRAP_S, GL_TEXTURE_WRAP_T, GL_TEXTURE_WRAP_R})
        gl().TextureParameteri(id(), axis, GL_CLAMP_TO_EDGE);
}

GlTexture::GlTexture(GlContext& context, GLenum internalFormat, const GlBuffer& buffer)
    : GlHandle(context, createTexture(context.functions(), GL_TEXTURE_BUFFER)) {
    gl().TextureBuffer(id(), internalFormat, buffer.id());
}

void GlTexture::destroy(const GlFunctions& gl, std::uintptr_t name) {
    const GLuint id = nameOf(name);
    gl.DeleteTextures(1, &id);
}

GlFramebuffer::GlFramebuffer(GlContext& context)
    : GlHandle(context, createFramebuffer(context.functions())) {}

void GlFramebuffer::attach(GLenum attachment, const GlTexture& texture) {
    gl().NamedFramebufferTexture(id(), attachment, texture.id(), 0);
}

void GlFramebuffer::attachLayer(GLenum attachment, const GlTexture& texture, int layer) {
    gl().NamedFramebufferTextureLayer(id(), attachment, texture.id(), 0, layer);
}

void GlFramebuffer::throwIfIncomplete() const {
    const GLenum status = gl().CheckNamedFramebufferStatus(id(), GL_DRAW_FRAMEBUFFER);
    if (status != GL_FRAMEBUFFER_COMPLETE)
        throw GlError("an OpenGL framebuffer is incomplete: " + incompleteReason(status));
}

void GlFramebuffer::destroy(const GlFunctions& gl, std::uintptr_t name) {
    const GLuint id = nameOf(name);
    gl.DeleteFramebuffers(1, &id);
}

GlVertexArray::GlVertexArray(GlContext& context)
    : GlHandle(context, createVertexArray(context.functions())) {}

void GlVertexArray::destroy(const GlFunctions& gl, std::uintptr_t name) {
    const GLuint id = nameOf(name);
    gl.DeleteVertexArrays(1, &id);
}

GlShader::GlShader(GlContext& context, GLenum stage)
    : GlHandle(context, context.functions().CreateShader(stage)) {}

void GlShader::destroy(const GlFunctions& gl, std::uintptr_t name) {
    gl.DeleteShader(nameOf(name));
}

GlProgram::GlProgram(GlContext& context) : GlHandle(context, context.functions().CreateProgram()) {}

GLint GlProgram::uniform(const char* name) const {
    return gl().GetUniformLocation(id(), name);
}

void GlProgram::destroy(const GlFunctions& gl, std::uintptr_t name) {
    gl.DeleteProgram(nameOf(name));
}

GlQuery::GlQuery(GlContext& context, GLenum target)
    : GlHandle(context, createQuery(context.functions())), target_(target) {}

void GlQuery::begin() {
    gl().BeginQuery(target_, id());
}

void GlQuery::end() {
    gl().EndQuery(target_);
}

std::uint64_t GlQuery::result() const {
    GLuint64 value = 0;
    gl().GetQueryObjectui64v(id(), GL_QUERY_RESULT, &value);
    return value;
}

void GlQuery::destroy(const GlFunctions& gl, std::uintptr_t name) {
    const GLuint id = nameOf(name);
    gl.DeleteQueries(1, &id);
}

GlFence::GlFence(GlContext& context)
    : GlHandle(context, reinterpret_cast<std::uintptr_t>(
                            context.functions().FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0))) {}

bool GlFence::isSignaled() const {
    const GLenum status = gl().ClientWaitSync(syncOf(rawName()), GL_SYNC_FLUSH_COMMANDS_BIT, 0);
    return status == GL_ALREADY_SIGNALED || status == GL_CONDITION_SATISFIED;
}

void GlFence::wait() const {
    constexpr GLuint64 kSecond = 1000000000;  // nanoseconds
    for (;;) {
        const GLenum status = gl().ClientWaitSync(syncOf(rawName()), GL_SYNC_FLUSH_COMMANDS_BIT, kSecond);
        if (status == GL_ALREADY_SIGNALED || status == GL_CONDITION_SATISFIED) return;
        if (status != GL_TIMEOUT_EXPIRED) throw GlError("waiting for the OpenGL device failed");
    }
}

void GlFence::destroy(const GlFunctions& gl, std::uintptr_t name) {
    gl.DeleteSync(syncOf(name));
}

}  // namespace tessera
