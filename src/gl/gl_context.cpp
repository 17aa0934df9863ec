#include "gl/gl_context.h"

#include <algorithm>

#include "base/check.h"
#include "gl/egl_context.h"
#include "gl/gl_platform.h"
#include "gl/osmesa_context.h"
#include "gl/platform_context.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::size_t kMostMessages = 16;  // a loop of failing calls must not fill memory

std::unique_ptr<PlatformContext> createPlatformContext(GlPlatform platform, bool debug) {
    switch (platform) {
        case GlPlatform::eglDevice:
            return createEglDeviceContext(debug);
        case GlPlatform::eglSurfaceless:
            return createEglSurfacelessContext(debug);
        case GlPlatform::osmesa:
            return createOsmesaContext();
    }
    throw InternalError("unknown OpenGL platform");
}

std::string errorName(GLenum error) {
    switch (error) {
        case GL_INVALID_ENUM:
            return "GL_INVALID_ENUM";
        case GL_INVALID_VALUE:
            return "GL_INVALID_VALUE";
        case GL_INVALID_OPERATION:
            return "GL_INVALID_OPERATION";
        case GL_INVALID_FRAMEBUFFER_OPERATION:
            return "GL_INVALID_FRAMEBUFFER_OPERATION";
        case GL_OUT_OF_MEMORY:
            return "GL_OUT_OF_MEMORY";
        case GL_CONTEXT_LOST:
            return "GL_CONTEXT_LOST";
        default:
            return "error " + std::to_string(error);
    }
}

/// Runs inside OpenGL calls, on the context's thread: it may not throw.
void APIENTRY collectMessage(GLenum, GLenum type, GLuint, GLenum severity, GLsizei length, const GLchar* text,
                             const void* user) {
    const bool isFailure = type == GL_DEBUG_TYPE_ERROR ||
                           (type == GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR && severity == GL_DEBUG_SEVERITY_HIGH);
    if (!isFailure) return;
    auto& messages = *static_cast<std::vector<std::string>*>(const_cast<void*>(user));
    if (messages.size() >= kMostMessages) return;
    std::string message =
        length >= 0 ? std::string(text, static_cast<std::size_t>(length)) : std::string(text);
    while (!message.empty() && (message.back() == '\n' || message.back() == '\0')) message.pop_back();
    if (std::find(messages.begin(), messages.end(), message) == messages.end())
        messages.push_back(std::move(message));
}

}  // namespace

void GlObjects::add() noexcept {
    const std::lock_guard lock(mutex_);
    ++liveCount_;
}

void GlObjects::remove(std::uintptr_t name, Deleter deleter) noexcept {
    const std::lock_guard lock(mutex_);
    if (isContextAlive_ && std::this_thread::get_id() != thread_) {
        strays_.push_back({name, deleter});
        return;
    }
    --liveCount_;
    if (isContextAlive_) deleter(gl, name);
}

std::int64_t GlObjects::liveCount() const {
    const std::lock_guard lock(mutex_);
    return liveCount_;
}

std::size_t GlObjects::deleteStrays() {
    const std::lock_guard lock(mutex_);
    const std::size_t count = strays_.size();
    for (const Stray& stray : strays_) stray.deleter(gl, stray.name);
    liveCount_ -= static_cast<std::int64_t>(count);
    strays_.clear();
    return count;
}

GlContext::GlContext(GlPlatform platform, const GlContextOptions& options)
    : platformContext_(createPlatformContext(platform, options.debug)) {
    platformContext_->makeCurrent();
    try {
        const auto getProcAddress = [&](const char* name) { return platformContext_->getProcAddress(name); };
        // libglvnd hands out an address for any name, so the version is what tells.
        const auto getInteger = reinterpret_cast<PFNGLGETINTEGERVPROC>(getProcAddress("glGetIntegerv"));
        GLint major = 0, minor = 0;
        if (getInteger) {
            getInteger(GL_MAJOR_VERSION, &major);
            getInteger(GL_MINOR_VERSION, &minor);
        }
        if (major * 10 + minor < 45)
            throw GlError("OpenGL 4.5 is needed, and the driver gives " + std::to_string(major) + "." +
                          std::to_string(minor));
        GlFunctions loaded = loadGlFunctions(getProcAddress);
        if (options.replace) options.replace(loaded);
        objects_ = std::make_shared<GlObjects>(loaded);
        info_ = queryGlDevice(functions());
        info_.platform = platform;
        info_.platformDetail = platformContext_->detail();
        info_.isSoftware = info_.isSoftware || platformContext_->isSoftwareDevice();
        listenToDebugOutput();
        resetState();
        throwIfFailed();
    } catch (...) {
        platformContext_->releaseCurrent();
        throw;
    }
}

GlContext::~GlContext() {
    objects_->deleteStrays();
    {
        const std::lock_guard lock(objects_->mutex_);
        objects_->isContextAlive_ = false;
    }
    functions().DebugMessageCallback(nullptr, nullptr);
    platformContext_->releaseCurrent();
}

void GlContext::listenToDebugOutput() {
    const GlFunctions& gl = functions();
    gl.Enable(GL_DEBUG_OUTPUT);
    gl.Enable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    gl.DebugMessageControl(GL_DONT_CARE, GL_DONT_CARE, GL_DONT_CARE, 0, nullptr, GL_FALSE);
    gl.DebugMessageControl(GL_DONT_CARE, GL_DEBUG_TYPE_ERROR, GL_DONT_CARE, 0, nullptr, GL_TRUE);
    gl.DebugMessageControl(GL_DONT_CARE, GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR, GL_DEBUG_SEVERITY_HIGH, 0, nullptr,
                           GL_TRUE);
    gl.DebugMessageCallback(collectMessage, &messages_);
}

void GlContext::throwIfFailed() {
    TESSERA_CHECK(objects_->deleteStrays() == 0, "an OpenGL object was destroyed on another thread");
    std::string text;
    bool lacksMemory = false;
    // A lost context may report the same error for ever.
    for (int i = 0; i < 16; ++i) {
        const GLenum error = functions().GetError();
        if (error == GL_NO_ERROR) break;
        lacksMemory = lacksMemory || error == GL_OUT_OF_MEMORY;
        text += (text.empty() ? "" : ", ") + errorName(error);
    }
    if (isLost()) {
        text = "the device was lost";
        lacksMemory = false;
    }
    for (const std::string& message : messages_) text += (text.empty() ? "" : ": ") + message;
    messages_.clear();
    if (lacksMemory) throw GlMemoryError("OpenGL failed: " + text);
    if (!text.empty()) throw GlError("OpenGL failed: " + text);
}

bool GlContext::isLost() noexcept {
    // It is told once.
    isLost_ = isLost_ || functions().GetGraphicsResetStatus() != GL_NO_ERROR;
    return isLost_;
}

void GlContext::discardFailures() noexcept {
    objects_->deleteStrays();
    for (int i = 0; i < 16 && functions().GetError() != GL_NO_ERROR; ++i) {
    }
    messages_.clear();
}

void GlContext::resetState() {
    const GlFunctions& gl = functions();
    for (const GLenum capability :
         {GL_BLEND, GL_DEPTH_TEST, GL_STENCIL_TEST, GL_SCISSOR_TEST, GL_CULL_FACE, GL_COLOR_LOGIC_OP,
          GL_PRIMITIVE_RESTART, GL_PRIMITIVE_RESTART_FIXED_INDEX, GL_PROGRAM_POINT_SIZE,
          GL_RASTERIZER_DISCARD, GL_DEPTH_CLAMP, GL_POLYGON_OFFSET_FILL, GL_SAMPLE_SHADING})
        gl.Disable(capability);
    gl.BlendEquation(GL_FUNC_ADD);
    gl.BlendFunc(GL_ONE, GL_ZERO);
    gl.DepthFunc(GL_LESS);
    gl.DepthMask(GL_TRUE);
    gl.DepthRange(0, 1);
    gl.ClearDepth(1);
    gl.ColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    gl.FrontFace(GL_CCW);
    gl.CullFace(GL_BACK);
    gl.PolygonMode(GL_FRONT_AND_BACK, GL_FILL);
    gl.ClipControl(GL_LOWER_LEFT, GL_NEGATIVE_ONE_TO_ONE);
    for (const GLenum direction : {GL_PACK_ALIGNMENT, GL_UNPACK_ALIGNMENT}) gl.PixelStorei(direction, 1);
    for (const GLenum name :
         {GL_PACK_ROW_LENGTH, GL_PACK_IMAGE_HEIGHT, GL_PACK_SKIP_ROWS, GL_PACK_SKIP_PIXELS,
          GL_PACK_SKIP_IMAGES, GL_UNPACK_ROW_LENGTH, GL_UNPACK_IMAGE_HEIGHT, GL_UNPACK_SKIP_ROWS,
          GL_UNPACK_SKIP_PIXELS, GL_UNPACK_SKIP_IMAGES})
        gl.PixelStorei(name, 0);
    gl.BindFramebuffer(GL_FRAMEBUFFER, 0);
    gl.BindVertexArray(0);
    gl.UseProgram(0);
    for (const GLenum target : {GL_PIXEL_PACK_BUFFER, GL_PIXEL_UNPACK_BUFFER, GL_DRAW_INDIRECT_BUFFER})
        gl.BindBuffer(target, 0);
}

}  // namespace tessera
