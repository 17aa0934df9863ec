#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "gl/gl_context.h"

namespace tessera {

/// Owner of one OpenGL object of the kind that `Kind` deletes; movable, empty when made without a context.
/// It must be destroyed on its context's thread and before its context: elsewhere the object is kept, and the
/// context's next throwIfFailed() raises InternalError.
template <class Kind>
class GlHandle {
  public:
    GlHandle() = default;
    GlHandle(GlContext& context, std::uintptr_t name) : objects_(context.objects()), name_(name) {
        objects_->add();
    }
    GlHandle(GlHandle&& other) noexcept
        : objects_(std::move(other.objects_)), name_(std::exchange(other.name_, 0)) {}
    GlHandle& operator=(GlHandle&& other) noexcept {
        if (this != &other) {
            reset();
            objects_ = std::move(other.objects_);
            name_ = std::exchange(other.name_, 0);
        }
        return *this;
    }
    ~GlHandle() { reset(); }

    /// Deletes the object now.
    void reset() noexcept {
        if (objects_) objects_->remove(name_, &Kind::destroy);
        objects_.reset();
        name_ = 0;
    }
    explicit operator bool() const { return objects_ != nullptr; }
    /// OpenGL's name of the object.
    GLuint id() const { return static_cast<GLuint>(name_); }

  protected:
    const GlFunctions& gl() const { return objects_->gl; }
    std::uintptr_t rawName() const { return name_; }

  private:
    std::shared_ptr<GlObjects> objects_;
    std::uintptr_t name_ = 0;
};

/// Device memory.
class GlBuffer : public GlHandle<GlBuffer> {
  public:
    GlBuffer() = default;
    /// Immutable storage of `bytes` bytes (at least one is taken), filled from `source` when there is one.
    /// `flags` are those of glBufferStorage: GL_DYNAMIC_STORAGE_BIT, GL_MAP_WRITE_BIT, ...
    GlBuffer(GlContext& context, std::int64_t bytes, GLbitfield flags, const void* source = nullptr);
    template <class T, std::size_t N>
    GlBuffer(GlContext& context, std::span<T, N> values, GLbitfield flags = 0)
        : GlBuffer(context, static_cast<std::int64_t>(values.size_bytes()), flags, values.data()) {}

    std::int64_t bytes() const { return bytes_; }
    /// glMapNamedBufferRange; unmapped by unmap() or when the buffer goes. @throws GlError when it fails.
    void* map(std::int64_t offset, std::int64_t bytes, GLbitfield access);
    void unmap();

    static void destroy(const GlFunctions& gl, std::uintptr_t name);

  private:
    std::int64_t bytes_ = 0;
};

/// A texture with immutable storage of one mip level, not filtered, clamped to its edge.
class GlTexture : public GlHandle<GlTexture> {
  public:
    GlTexture() = default;
    /// `target` GL_TEXTURE_2D (depth 1), GL_TEXTURE_3D or GL_TEXTURE_2D_ARRAY. @throws GlError, with the
    /// size, when it is more than the device allows or has memory for.
    GlTexture(GlContext& context, GLenum target, GLenum internalFormat, int width, int height, int depth = 1);
    /// A buffer texture: a view of `buffer`, which must live as long.
    GlTexture(GlContext& context, GLenum internalFormat, const GlBuffer& buffer);

    static void destroy(const GlFunctions& gl, std::uintptr_t name);
};

class GlFramebuffer : public GlHandle<GlFramebuffer> {
  public:
    GlFramebuffer() = default;
    explicit GlFramebuffer(GlContext& context);
    /// Attaches all layers of the texture (glNamedFramebufferTexture).
    void attach(GLenum attachment, const GlTexture& texture);
    /// Attaches one layer.
    void attachLayer(GLenum attachment, const GlTexture& texture, int layer);
    /// @throws GlError with the reason when one can't draw into it.
    void throwIfIncomplete() const;

    static void destroy(const GlFunctions& gl, std::uintptr_t name);
};

class GlVertexArray : public GlHandle<GlVertexArray> {
  public:
    GlVertexArray() = default;
    explicit GlVertexArray(GlContext& context);

    static void destroy(const GlFunctions& gl, std::uintptr_t name);
};

class GlShader : public GlHandle<GlShader> {
  public:
    GlShader() = default;
    GlShader(GlContext& context, GLenum stage);

    static void destroy(const GlFunctions& gl, std::uintptr_t name);
};

class GlProgram : public GlHandle<GlProgram> {
  public:
    GlProgram() = default;
    explicit GlProgram(GlContext& context);
    /// -1 when the program has no such active uniform, as OpenGL gives it.
    GLint uniform(const char* name) const;

    static void destroy(const GlFunctions& gl, std::uintptr_t name);
};

/// A query of `target`, e.g. GL_TIME_ELAPSED or GL_SAMPLES_PASSED.
class GlQuery : public GlHandle<GlQuery> {
  public:
    GlQuery() = default;
    GlQuery(GlContext& context, GLenum target);
    void begin();
    void end();
    /// Waits for the result.
    std::uint64_t result() const;

    static void destroy(const GlFunctions& gl, std::uintptr_t name);

  private:
    GLenum target_ = 0;
};

/// Signals when the device has done everything that was asked of it before the fence was made.
class GlFence : public GlHandle<GlFence> {
  public:
    GlFence() = default;
    explicit GlFence(GlContext& context);
    /// True when it has signalled; does not wait, but flushes.
    bool isSignaled() const;
    /// Waits without limit. @throws GlError when the device fails.
    void wait() const;

    static void destroy(const GlFunctions& gl, std::uintptr_t name);
};

}  // namespace tessera
