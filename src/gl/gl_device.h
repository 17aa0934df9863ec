#pragma once

#include <GL/glcorearb.h>

#include <cstdint>
#include <string>
#include <vector>

namespace tessera {

struct GlFunctions;

/// Where a headless context comes from.
enum class GlPlatform {
    eglDevice,       ///< EGL on an enumerated device: a real GPU first, a software device after
    eglSurfaceless,  ///< EGL_MESA_platform_surfaceless
    osmesa,          ///< Mesa's off-screen library, always software
};

/// What the implementation allows; counts and bytes as OpenGL reports them.
struct GlLimits {
    int texture2dSize = 0, texture3dSize = 0, arrayTextureLayers = 0;  ///< texels, texels, layers
    int textureBufferTexels = 0;
    int framebufferLayers = 0, framebufferWidth = 0, framebufferHeight = 0;
    int colorAttachments = 0, drawBuffers = 0;
    int varyingComponents = 0;  ///< floats from one stage to the next
    int vertexAttributes = 0;
    int textureUnits = 0;  ///< of a fragment shader
    std::int64_t storageBlockBytes = 0;
    int vertexStorageBlocks = 0, fragmentStorageBlocks = 0;  ///< shader storage blocks a stage may have
    int uniformBlockBytes = 0;
    int subpixelBits = 0;
    double minPointSize = 0, maxPointSize = 0;  ///< pixels
};

/// What one colour format can do, tried on a small texture.
struct GlFormat {
    std::string name;             ///< "r32f"
    GLenum internalFormat = 0;    ///< GL_R32F
    bool isRenderable = false;    ///< as a 2D target
    bool isLayered3d = false;     ///< all layers of a 3D texture as one layered target
    bool isLayeredArray = false;  ///< all layers of a 2D-array texture as one layered target
    bool isLayeredDepth = false;  ///< a layered 3D target together with a 2D-array DEPTH_COMPONENT32F
};

/// The device behind a context.
struct GlDeviceInfo {
    GlPlatform platform = GlPlatform::eglSurfaceless;
    std::string platformDetail;  ///< "EGL 1.5 (Mesa Project), device 1 of 1, software"
    std::string vendor, renderer, version, shadingLanguage;
    bool isSoftware = false;
    /// gl_Layer may be written by a vertex shader (GL_ARB_shader_viewport_layer_array).
    bool hasVertexShaderLayer = false;
    GlLimits limits;
    std::vector<GlFormat> formats;        ///< r8, r16, r16f, r32f and their rg and rgba kin
    std::vector<std::string> extensions;  ///< those present among the ones Tessera could use
};

/// Vendor, renderer and version: tells one driver from another.
std::string driverText(const GlDeviceInfo& info);

/// Asks the current context, and tries its formats.
GlDeviceInfo queryGlDevice(const GlFunctions& gl);

/// True for the names of Mesa's and others' software rasterisers.
bool isSoftwareRenderer(const std::string& renderer);

/// All extensions of the current context.
std::vector<std::string> glExtensions(const GlFunctions& gl);

}  // namespace tessera
