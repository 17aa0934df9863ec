// libEGL.so.1, libOSMesa.so.8 and libGL.so.1 as broken drivers have them, for tests that put their folders
// into LD_LIBRARY_PATH. The last one can do no more than crash when it is loaded. They hand everything on to
// the real library, TESSERA_REAL_LIBRARY, but what TESSERA_BROKEN_DRIVER names.

#include <EGL/egl.h>
#include <GL/glcorearb.h>
#include <dlfcn.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>

namespace {

bool breaks(const char* way) {
    const char* chosen = std::getenv("TESSERA_BROKEN_DRIVER");
    return chosen && std::strcmp(chosen, way) == 0;
}

void crash() {
    std::signal(SIGSEGV, SIG_DFL);  // of a sanitizer
    std::raise(SIGSEGV);
}

[[gnu::constructor]] void load() {
    if (breaks("load")) crash();
}

void beginContext() {
    if (breaks("exit")) ::_exit(0);
    while (breaks("stall")) ::pause();
}

void APIENTRY crashAtDraw(GLenum, GLint, GLsizei) {
    crash();
}

void APIENTRY drawNothing(GLenum, GLint, GLsizei) {}

PFNGLUSEPROGRAMPROC realUseProgram = nullptr;
std::atomic<int> uses{0};

void APIENTRY countUses(GLuint program) {
    ++uses;
    realUseProgram(program);
}

/// After more than a trial does.
bool isLost() {
    return uses > 8;
}

GLenum APIENTRY tellLoss() {
    return isLost() ? GL_UNKNOWN_CONTEXT_RESET : GL_NO_ERROR;
}

using Function = void (*)();

Function replacement(const char* name, Function real) {
    const auto is = [&](const char* other) { return std::strcmp(name, other) == 0; };
    if (is("glDrawArrays") && breaks("draw")) return reinterpret_cast<Function>(crashAtDraw);
    if (is("glDrawArrays") && breaks("nothing")) return reinterpret_cast<Function>(drawNothing);
    if (is("glGetGraphicsResetStatus") && breaks("lose")) return reinterpret_cast<Function>(tellLoss);
    if (is("glUseProgram") && breaks("lose")) {
        realUseProgram = reinterpret_cast<PFNGLUSEPROGRAMPROC>(real);
        return reinterpret_cast<Function>(countUses);
    }
    return real;
}

template <class Type>
Type* real(const char* name) {
    static void* library = dlopen(TESSERA_REAL_LIBRARY, RTLD_NOW | RTLD_LOCAL);
    return library ? reinterpret_cast<Type*>(dlsym(library, name)) : nullptr;
}

}  // namespace

#define HAND_ON(RESULT, NAME, PARAMETERS, ARGUMENTS)                   \
    extern "C" [[gnu::visibility("default")]] RESULT NAME PARAMETERS { \
        static auto* const function = real<RESULT PARAMETERS>(#NAME);  \
        return function ARGUMENTS;                                     \
    }

#ifdef TESSERA_BREAK_EGL
extern "C" [[gnu::visibility("default")]] Function eglGetProcAddress(const char* name) {
    static auto* const function = real<Function(const char*)>("eglGetProcAddress");
    return replacement(name, function(name));
}
extern "C" [[gnu::visibility("default")]] EGLBoolean eglInitialize(EGLDisplay display, EGLint* major,
                                                                   EGLint* minor) {
    beginContext();
    static auto* const function = real<EGLBoolean(EGLDisplay, EGLint*, EGLint*)>("eglInitialize");
    return function(display, major, minor);
}
HAND_ON(const char*, eglQueryString, (EGLDisplay display, EGLint name), (display, name))
HAND_ON(EGLBoolean, eglBindAPI, (EGLenum api), (api))
HAND_ON(EGLBoolean, eglChooseConfig,
        (EGLDisplay display, const EGLint* wanted, EGLConfig* configs, EGLint size, EGLint* count),
        (display, wanted, configs, size, count))
HAND_ON(EGLContext, eglCreateContext,
        (EGLDisplay display, EGLConfig config, EGLContext share, const EGLint* attributes),
        (display, config, share, attributes))
HAND_ON(EGLBoolean, eglDestroyContext, (EGLDisplay display, EGLContext context), (display, context))
HAND_ON(EGLBoolean, eglMakeCurrent,
        (EGLDisplay display, EGLSurface draw, EGLSurface read, EGLContext context),
        (display, draw, read, context))
HAND_ON(EGLBoolean, eglReleaseThread, (), ())
HAND_ON(EGLint, eglGetError, (), ())
#endif

#ifdef TESSERA_BREAK_OSMESA
using Context = struct osmesa_context*;
extern "C" [[gnu::visibility("default")]] Function OSMesaGetProcAddress(const char* name) {
    static auto* const function = real<Function(const char*)>("OSMesaGetProcAddress");
    return replacement(name, function(name));
}
extern "C" [[gnu::visibility("default")]] Context OSMesaCreateContextAttribs(const int* attributes,
                                                                             Context share) {
    beginContext();
    static auto* const function = real<Context(const int*, Context)>("OSMesaCreateContextAttribs");
    return function(attributes, share);
}
HAND_ON(void, OSMesaDestroyContext, (Context context), (context))
HAND_ON(GLboolean, OSMesaMakeCurrent,
        (Context context, void* buffer, GLenum type, GLsizei width, GLsizei height),
        (context, buffer, type, width, height))
#endif
