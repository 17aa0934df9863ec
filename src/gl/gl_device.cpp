#include "gl/gl_device.h"

#include <algorithm>
#include <array>

#include "gl/gl_functions.h"

namespace tessera {

namespace {

constexpr std::array kExtensionsOfInterest{"GL_ARB_shader_viewport_layer_array",
                                           "GL_AMD_vertex_shader_layer",
                                           "GL_NV_viewport_array2",
                                           "GL_ARB_fragment_shader_interlock",
                                           "GL_ARB_gpu_shader_fp64",
                                           "GL_ARB_gpu_shader_int64",
                                           "GL_ARB_shader_draw_parameters",
                                           "GL_ARB_indirect_parameters",
                                           "GL_ARB_bindless_texture",
                                           "GL_ARB_sparse_texture",
                                           "GL_ARB_buffer_storage",
                                           "GL_ARB_pipeline_statistics_query",
                                           "GL_ARB_shader_ballot",
                                           "GL_NV_conservative_raster",
                                           "GL_INTEL_conservative_rasterization",
                                           "GL_EXT_texture_filter_minmax",
                                           "GL_ARB_gl_spirv",
                                           "GL_KHR_robustness"};

struct NamedFormat {
    const char* name;
    GLenum internalFormat;
};
constexpr std::array kFormats{
    NamedFormat{"r8", GL_R8},         NamedFormat{"r16", GL_R16},         NamedFormat{"r16f", GL_R16F},
    NamedFormat{"r32f", GL_R32F},     NamedFormat{"rg8", GL_RG8},         NamedFormat{"rg16", GL_RG16},
    NamedFormat{"rg16f", GL_RG16F},   NamedFormat{"rg32f", GL_RG32F},     NamedFormat{"rgba8", GL_RGBA8},
    NamedFormat{"rgba16", GL_RGBA16}, NamedFormat{"rgba16f", GL_RGBA16F}, NamedFormat{"rgba32f", GL_RGBA32F}};

std::string stringOf(const GlFunctions& gl, GLenum name) {
    const GLubyte* text = gl.GetString(name);
    return text ? reinterpret_cast<const char*>(text) : "";
}

int integerOf(const GlFunctions& gl, GLenum name) {
    GLint value = 0;
    gl.GetIntegerv(name, &value);
    return value;
}

GlLimits queryLimits(const GlFunctions& gl) {
    GlLimits limits;
    limits.texture2dSize = integerOf(gl, GL_MAX_TEXTURE_SIZE);
    limits.texture3dSize = integerOf(gl, GL_MAX_3D_TEXTURE_SIZE);
    limits.arrayTextureLayers = integerOf(gl, GL_MAX_ARRAY_TEXTURE_LAYERS);
    limits.textureBufferTexels = integerOf(gl, GL_MAX_TEXTURE_BUFFER_SIZE);
    limits.framebufferLayers = integerOf(gl, GL_MAX_FRAMEBUFFER_LAYERS);
    limits.framebufferWidth = integerOf(gl, GL_MAX_FRAMEBUFFER_WIDTH);
    limits.framebufferHeight = integerOf(gl, GL_MAX_FRAMEBUFFER_HEIGHT);
    limits.colorAttachments = integerOf(gl, GL_MAX_COLOR_ATTACHMENTS);
    limits.drawBuffers = integerOf(gl, GL_MAX_DRAW_BUFFERS);
    limits.varyingComponents = std::min(integerOf(gl, GL_MAX_VERTEX_OUTPUT_COMPONENTS),
                                        integerOf(gl, GL_MAX_FRAGMENT_INPUT_COMPONENTS));
    limits.vertexAttributes = integerOf(gl, GL_MAX_VERTEX_ATTRIBS);
    limits.textureUnits = integerOf(gl, GL_MAX_TEXTURE_IMAGE_UNITS);
    GLint64 bytes = 0;
    gl.GetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &bytes);
    limits.storageBlockBytes = bytes;
    limits.vertexStorageBlocks = integerOf(gl, GL_MAX_VERTEX_SHADER_STORAGE_BLOCKS);
    limits.fragmentStorageBlocks = integerOf(gl, GL_MAX_FRAGMENT_SHADER_STORAGE_BLOCKS);
    limits.uniformBlockBytes = integerOf(gl, GL_MAX_UNIFORM_BLOCK_SIZE);
    limits.subpixelBits = integerOf(gl, GL_SUBPIXEL_BITS);
    GLfloat points[2] = {0, 0};
    gl.GetFloatv(GL_POINT_SIZE_RANGE, points);
    limits.minPointSize = points[0];
    limits.maxPointSize = points[1];
    return limits;
}

/// A texture of 4 x 4 (x 4 layers), or none when the driver refuses it.
GLuint smallTexture(const GlFunctions& gl, GLenum target, GLenum internalFormat) {
    GLuint texture = 0;
    gl.CreateTextures(target, 1, &texture);
    if (target == GL_TEXTURE_2D)
        gl.TextureStorage2D(texture, 1, internalFormat, 4, 4);
    else
        gl.TextureStorage3D(texture, 1, internalFormat, 4, 4, 4);
    return texture;
}

bool isComplete(const GlFunctions& gl, GLuint color, GLuint depth) {
    GLuint framebuffer = 0;
    gl.CreateFramebuffers(1, &framebuffer);
    gl.NamedFramebufferTexture(framebuffer, GL_COLOR_ATTACHMENT0, color, 0);
    if (depth) gl.NamedFramebufferTexture(framebuffer, GL_DEPTH_ATTACHMENT, depth, 0);
    const bool complete =
        gl.CheckNamedFramebufferStatus(framebuffer, GL_DRAW_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;
    gl.DeleteFramebuffers(1, &framebuffer);
    return complete && gl.GetError() == GL_NO_ERROR;
}

GlFormat tryFormat(const GlFunctions& gl, const NamedFormat& format) {
    GlFormat result{format.name, format.internalFormat};
    const GLuint textures[4] = {smallTexture(gl, GL_TEXTURE_2D, format.internalFormat),
                                smallTexture(gl, GL_TEXTURE_3D, format.internalFormat),
                                smallTexture(gl, GL_TEXTURE_2D_ARRAY, format.internalFormat),
                                smallTexture(gl, GL_TEXTURE_2D_ARRAY, GL_DEPTH_COMPONENT32F)};
    if (gl.GetError() == GL_NO_ERROR) {
        result.isRenderable = isComplete(gl, textures[0], 0);
        result.isLayered3d = isComplete(gl, textures[1], 0);
        result.isLayeredArray = isComplete(gl, textures[2], 0);
        result.isLayeredDepth = isComplete(gl, textures[1], textures[3]);
    }
    gl.DeleteTextures(4, textures);
    while (gl.GetError() != GL_NO_ERROR) {
    }
    return result;
}

}  // namespace

std::vector<std::string> glExtensions(const GlFunctions& gl) {
    std::vector<std::string> names;
    const int count = integerOf(gl, GL_NUM_EXTENSIONS);
    for (int i = 0; i < count; ++i) {
        const GLubyte* name = gl.GetStringi(GL_EXTENSIONS, static_cast<GLuint>(i));
        if (name) names.emplace_back(reinterpret_cast<const char*>(name));
    }
    return names;
}

bool isSoftwareRenderer(const std::string& renderer) {
    for (const char* name : {"llvmpipe", "softpipe", "swrast", "SWR", "SwiftShader", "Software"})
        if (renderer.find(name) != std::string::npos) return true;
    return false;
}

std::string driverText(const GlDeviceInfo& info) {
    return info.vendor + ", " + info.renderer + ", " + info.version;
}

GlDeviceInfo queryGlDevice(const GlFunctions& gl) {
    GlDeviceInfo info;
    info.vendor = stringOf(gl, GL_VENDOR);
    info.renderer = stringOf(gl, GL_RENDERER);
    info.version = stringOf(gl, GL_VERSION);
    info.shadingLanguage = stringOf(gl, GL_SHADING_LANGUAGE_VERSION);
    info.isSoftware = isSoftwareRenderer(info.renderer);
    const std::vector<std::string> present = glExtensions(gl);
    for (const char* name : kExtensionsOfInterest)
        if (std::find(present.begin(), present.end(), name) != present.end())
            info.extensions.emplace_back(name);
    info.hasVertexShaderLayer =
        std::find(present.begin(), present.end(), "GL_ARB_shader_viewport_layer_array") != present.end();
    info.limits = queryLimits(gl);
    for (const NamedFormat& format : kFormats) info.formats.push_back(tryFormat(gl, format));
    return info;
}

}  // namespace tessera
