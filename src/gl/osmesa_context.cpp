#include "gl/osmesa_context.h"

#include <dlfcn.h>

#include <array>

#include "gl/platform_context.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kDummySize = 16;  // pixels: OSMesa needs a buffer to make current; nothing is drawn into it

// As OSMesa's header has them; that header brings GL/gl.h, which goes ill with GL/glcorearb.h.
using OsmesaContextHandle = struct osmesa_context*;
constexpr int kFormat = 0x22, kDepthBits = 0x30, kProfile = 0x33, kCoreProfile = 0x34, kMajorVersion = 0x36,
              kMinorVersion = 0x37;
constexpr int kRgba = GL_RGBA;

struct OsmesaLibrary {
    OsmesaContextHandle (*createContextAttribs)(const int* attributes, OsmesaContextHandle share) = nullptr;
    void (*destroyContext)(OsmesaContextHandle context) = nullptr;
    GLboolean (*makeCurrent)(OsmesaContextHandle context, void* buffer, GLenum type, GLsizei width,
                             GLsizei height) = nullptr;
    GlProcAddress (*getProcAddress)(const char* name) = nullptr;
};

/// Never unloaded: Mesa keeps threads and exit handlers of its own.
OsmesaLibrary loadOsmesa() {
    void* library = dlopen("libOSMesa.so.8", RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (!library) throw GlError(std::string("OSMesa can't be loaded: ") + dlerror());
    OsmesaLibrary osmesa;
    const auto load = [&](auto& pointer, const char* name) {
        void* address = dlsym(library, name);
        if (!address) throw GlError(std::string("libOSMesa.so.8 lacks the function ") + name);
        pointer = reinterpret_cast<std::remove_reference_t<decltype(pointer)>>(address);
    };
    load(osmesa.createContextAttribs, "OSMesaCreateContextAttribs");
    load(osmesa.destroyContext, "OSMesaDestroyContext");
    load(osmesa.makeCurrent, "OSMesaMakeCurrent");
    load(osmesa.getProcAddress, "OSMesaGetProcAddress");
    return osmesa;
}

const OsmesaLibrary& osmesaLibrary() {
    static const OsmesaLibrary library = loadOsmesa();
    return library;
}

class OsmesaContext : public PlatformContext {
  public:
    OsmesaContext() {
        const int attributes[] = {kFormat,       kRgba, kDepthBits,    0, kProfile, kCoreProfile,
                                  kMajorVersion, 4,     kMinorVersion, 5, 0};
        context_ = library_.createContextAttribs(attributes, nullptr);
        if (!context_) throw GlError("OSMesa gives no OpenGL 4.5 core context");
    }
    ~OsmesaContext() override { library_.destroyContext(context_); }
    OsmesaContext(const OsmesaContext&) = delete;
    OsmesaContext& operator=(const OsmesaContext&) = delete;

    void makeCurrent() override {
        if (!library_.makeCurrent(context_, buffer_.data(), GL_UNSIGNED_BYTE, kDummySize, kDummySize))
            throw GlError("OSMesa can't make its context current");
    }
    void releaseCurrent() noexcept override { library_.makeCurrent(nullptr, nullptr, 0, 0, 0); }
    GlProcAddress getProcAddress(const char* name) const override { return library_.getProcAddress(name); }
    std::string detail() const override { return "OSMesa"; }
    bool isSoftwareDevice() const override { return true; }

  private:
    const OsmesaLibrary& library_ = osmesaLibrary();
    OsmesaContextHandle context_ = nullptr;
    std::array<unsigned char, 4 * kDummySize * kDummySize> buffer_{};
};

}  // namespace

std::unique_ptr<PlatformContext> createOsmesaContext() {
    return std::make_unique<OsmesaContext>();
}

}  // namespace tessera
