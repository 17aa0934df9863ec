#include "gl/gl_functions.h"

#include <string>

#include "tessera/error.h"

namespace tessera {

GlFunctions loadGlFunctions(const std::function<GlProcAddress(const char*)>& getProcAddress) {
    GlFunctions gl;
    const auto load = [&](auto& pointer, const char* name) {
        const GlProcAddress address = getProcAddress(name);
        if (!address) throw GlError(std::string("the OpenGL driver lacks the function ") + name);
        pointer = reinterpret_cast<std::remove_reference_t<decltype(pointer)>>(address);
    };
#define TESSERA_GL_LOAD(TYPE, NAME) load(gl.NAME, "gl" #NAME);
    TESSERA_GL_FUNCTIONS(TESSERA_GL_LOAD)
#undef TESSERA_GL_LOAD
    return gl;
}

}  // namespace tessera
