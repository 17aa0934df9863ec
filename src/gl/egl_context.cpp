#include "gl/egl_context.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>

#include <map>
#include <mutex>
#include <string_view>
#include <vector>

#include "gl/platform_context.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// True when `name` is one of the words of `list`.
bool hasWord(const char* list, std::string_view name) {
    std::string_view rest = list ? list : "";
    while (!rest.empty()) {
        const std::size_t end = rest.find(' ');
        if (rest.substr(0, end) == name) return true;
        rest = end == std::string_view::npos ? std::string_view{} : rest.substr(end + 1);
    }
    return false;
}

struct EglLibrary {
    decltype(&::eglGetProcAddress) getProcAddress = nullptr;
    decltype(&::eglQueryString) queryString = nullptr;
    decltype(&::eglInitialize) initialize = nullptr;
    decltype(&::eglBindAPI) bindApi = nullptr;
    decltype(&::eglChooseConfig) chooseConfig = nullptr;
    decltype(&::eglCreateContext) createContext = nullptr;
    decltype(&::eglDestroyContext) destroyContext = nullptr;
    decltype(&::eglMakeCurrent) makeCurrent = nullptr;
    decltype(&::eglReleaseThread) releaseThread = nullptr;
    decltype(&::eglGetError) getError = nullptr;
    PFNEGLGETPLATFORMDISPLAYEXTPROC getPlatformDisplay = nullptr;
    PFNEGLQUERYDEVICESEXTPROC queryDevices = nullptr;            // null without device enumeration
    PFNEGLQUERYDEVICESTRINGEXTPROC queryDeviceString = nullptr;  // null without device queries
    std::string clientExtensions;

    std::string lastError() const {
        constexpr const char* names[] = {
            "EGL_SUCCESS",       "EGL_NOT_INITIALIZED", "EGL_BAD_ACCESS",        "EGL_BAD_ALLOC",
            "EGL_BAD_ATTRIBUTE", "EGL_BAD_CONFIG",      "EGL_BAD_CONTEXT",       "EGL_BAD_CURRENT_SURFACE",
            "EGL_BAD_DISPLAY",   "EGL_BAD_MATCH",       "EGL_BAD_NATIVE_PIXMAP", "EGL_BAD_NATIVE_WINDOW",
            "EGL_BAD_PARAMETER", "EGL_BAD_SURFACE",     "EGL_CONTEXT_LOST"};
        const EGLint code = getError();
        const EGLint index = code - EGL_SUCCESS;
        return index >= 0 && index < static_cast<EGLint>(std::size(names)) ? names[index]
                                                                           : std::to_string(code);
    }
};

/// Never unloaded: Mesa keeps threads and exit handlers of its own.
EglLibrary loadEgl() {
    void* library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (!library) throw GlError(std::string("EGL can't be loaded: ") + dlerror());
    EglLibrary egl;
    const auto load = [&](auto& pointer, const char* name) {
        void* address = dlsym(library, name);
        if (!address) throw GlError(std::string("libEGL.so.1 lacks the function ") + name);
        pointer = reinterpret_cast<std::remove_reference_t<decltype(pointer)>>(address);
    };
    load(egl.getProcAddress, "eglGetProcAddress");
    load(egl.queryString, "eglQueryString");
    load(egl.initialize, "eglInitialize");
    load(egl.bindApi, "eglBindAPI");
    load(egl.chooseConfig, "eglChooseConfig");
    load(egl.createContext, "eglCreateContext");
    load(egl.destroyContext, "eglDestroyContext");
    load(egl.makeCurrent, "eglMakeCurrent");
    load(egl.releaseThread, "eglReleaseThread");
    load(egl.getError, "eglGetError");
    const auto extension = [&](auto& pointer, const char* name) {
        pointer = reinterpret_cast<std::remove_reference_t<decltype(pointer)>>(egl.getProcAddress(name));
    };
    const char* client = egl.queryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    egl.clientExtensions = client ? client : "";
    if (hasWord(client, "EGL_EXT_platform_base"))
        extension(egl.getPlatformDisplay, "eglGetPlatformDisplayEXT");
    const bool hasDeviceBase = hasWord(client, "EGL_EXT_device_base");
    if (hasDeviceBase || hasWord(client, "EGL_EXT_device_enumeration"))
        extension(egl.queryDevices, "eglQueryDevicesEXT");
    if (hasDeviceBase || hasWord(client, "EGL_EXT_device_query"))
        extension(egl.queryDeviceString, "eglQueryDeviceStringEXT");
    return egl;
}

const EglLibrary& eglLibrary() {
    static const EglLibrary& library = *new EglLibrary(loadEgl());  // outlives every thread
    return library;
}

/// An initialised display. Displays belong to the process and terminating one would pull down every context
/// on it, so each is initialised once and kept.
struct Display {
    EGLDisplay handle = EGL_NO_DISPLAY;
    EGLint major = 0, minor = 0;
    std::string vendor, extensions;
};

const Display& openDisplay(EGLenum platform, void* native) {
    static std::mutex mutex;
    static auto& displays = *new std::map<std::pair<EGLenum, void*>, Display>;  // outlives every thread
    const std::lock_guard lock(mutex);
    const auto found = displays.find({platform, native});
    if (found != displays.end()) return found->second;
    const EglLibrary& egl = eglLibrary();
    if (!egl.getPlatformDisplay) throw GlError("EGL has no platform displays (EGL_EXT_platform_base)");
    Display display;
    display.handle = egl.getPlatformDisplay(platform, native, nullptr);
    if (display.handle == EGL_NO_DISPLAY) throw GlError("EGL gives no display: " + egl.lastError());
    if (!egl.initialize(display.handle, &display.major, &display.minor))
        throw GlError("EGL can't initialise its display: " + egl.lastError());
    const auto text = [&](EGLint name) {
        const char* value = egl.queryString(display.handle, name);
        return std::string(value ? value : "");
    };
    display.vendor = text(EGL_VENDOR);
    display.extensions = text(EGL_EXTENSIONS);
    return displays[{platform, native}] = display;
}

class EglContext : public PlatformContext {
  public:
    EglContext(const Display& display, std::string deviceDetail, bool isSoftware, bool debug)
        : display_(display), deviceDetail_(std::move(deviceDetail)), isSoftware_(isSoftware) {
        const char* extensions = display.extensions.c_str();
        if (!hasWord(extensions, "EGL_KHR_surfaceless_context"))
            throw GlError("EGL can't make a context current without a surface (EGL_KHR_surfaceless_context)");
        if (!egl_.bindApi(EGL_OPENGL_API)) throw GlError("EGL offers no OpenGL: " + egl_.lastError());
        EGLConfig config = nullptr;  // EGL_NO_CONFIG_KHR
        if (!hasWord(extensions, "EGL_KHR_no_config_context")) config = chooseConfig();
        std::vector<EGLint> attributes{EGL_CONTEXT_MAJOR_VERSION,       4,
                                       EGL_CONTEXT_MINOR_VERSION,       5,
                                       EGL_CONTEXT_OPENGL_PROFILE_MASK, EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                       EGL_CONTEXT_OPENGL_DEBUG,        debug ? EGL_TRUE : EGL_FALSE};
        // Without it a loss can't be told.
        if (hasWord(extensions, "EGL_EXT_create_context_robustness")) {
            std::vector<EGLint> robust = attributes;
            robust.insert(robust.end(), {EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
                                         EGL_LOSE_CONTEXT_ON_RESET, EGL_NONE});
            context_ = egl_.createContext(display.handle, config, EGL_NO_CONTEXT, robust.data());
        }
        attributes.push_back(EGL_NONE);
        if (context_ == EGL_NO_CONTEXT)
            context_ = egl_.createContext(display.handle, config, EGL_NO_CONTEXT, attributes.data());
        if (context_ == EGL_NO_CONTEXT)
            throw GlError("EGL gives no OpenGL 4.5 core context: " + egl_.lastError());
    }
    ~EglContext() override { egl_.destroyContext(display_.handle, context_); }
    EglContext(const EglContext&) = delete;
    EglContext& operator=(const EglContext&) = delete;

    void makeCurrent() override {
        // The API bound is a property of the thread too.
        if (!egl_.bindApi(EGL_OPENGL_API) ||
            !egl_.makeCurrent(display_.handle, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
            throw GlError("EGL can't make its context current: " + egl_.lastError());
    }
    void releaseCurrent() noexcept override {
        egl_.makeCurrent(display_.handle, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
        egl_.releaseThread();
    }
    GlProcAddress getProcAddress(const char* name) const override { return egl_.getProcAddress(name); }
    std::string detail() const override {
        return "EGL " + std::to_string(display_.major) + "." + std::to_string(display_.minor) + " (" +
               display_.vendor + ")" + deviceDetail_;
    }
    bool isSoftwareDevice() const override { return isSoftware_; }

  private:
    EGLConfig chooseConfig() const {
        const EGLint wanted[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, EGL_PBUFFER_BIT,
                                 EGL_NONE};
        EGLConfig config = nullptr;
        EGLint count = 0;
        if (!egl_.chooseConfig(display_.handle, wanted, &config, 1, &count) || count < 1)
            throw GlError("EGL has no configuration for OpenGL");
        return config;
    }

    const EglLibrary& egl_ = eglLibrary();
    const Display& display_;
    std::string deviceDetail_;
    bool isSoftware_;
    EGLContext context_ = EGL_NO_CONTEXT;
};

struct Device {
    EGLDeviceEXT handle = nullptr;
    std::string detail;
    bool isSoftware = false;
};

/// Every device, real hardware first.
std::vector<Device> enumerateDevices() {
    const EglLibrary& egl = eglLibrary();
    if (!egl.queryDevices || !egl.queryDeviceString)
        throw GlError("EGL can't enumerate devices (EGL_EXT_device_enumeration, EGL_EXT_device_query)");
    if (!hasWord(egl.clientExtensions.c_str(), "EGL_EXT_platform_device"))
        throw GlError("EGL makes no display from a device (EGL_EXT_platform_device)");
    EGLint count = 0;
    if (!egl.queryDevices(0, nullptr, &count) || count == 0) throw GlError("EGL finds no device");
    std::vector<EGLDeviceEXT> handles(static_cast<std::size_t>(count));
    if (!egl.queryDevices(count, handles.data(), &count)) throw GlError("EGL can't list its devices");
    std::vector<Device> hardware, software;
    for (EGLint i = 0; i < count; ++i) {
        Device device{handles[static_cast<std::size_t>(i)], {}, false};
        const char* extensions = egl.queryDeviceString(device.handle, EGL_EXTENSIONS);
        device.isSoftware = hasWord(extensions, "EGL_MESA_device_software");
        device.detail = ", device " + std::to_string(i + 1) + " of " + std::to_string(count);
        if (hasWord(extensions, "EGL_EXT_device_drm"))
            if (const char* file = egl.queryDeviceString(device.handle, EGL_DRM_DEVICE_FILE_EXT))
                device.detail += std::string(", ") + file;
        if (device.isSoftware) device.detail += ", a software device";
        (device.isSoftware ? software : hardware).push_back(device);
    }
    hardware.insert(hardware.end(), software.begin(), software.end());
    return hardware;
}

}  // namespace

std::unique_ptr<PlatformContext> createEglDeviceContext(bool debug) {
    std::string reasons;
    for (const Device& device : enumerateDevices()) {
        try {
            return std::make_unique<EglContext>(openDisplay(EGL_PLATFORM_DEVICE_EXT, device.handle),
                                                device.detail, device.isSoftware, debug);
        } catch (const GlError& error) {
            reasons += (reasons.empty() ? "" : "; ") + std::string(error.what()) + device.detail;
        }
    }
    throw GlError(reasons);
}

std::unique_ptr<PlatformContext> createEglSurfacelessContext(bool debug) {
    if (!hasWord(eglLibrary().clientExtensions.c_str(), "EGL_MESA_platform_surfaceless"))
        throw GlError("EGL has no surfaceless platform (EGL_MESA_platform_surfaceless)");
    return std::make_unique<EglContext>(openDisplay(EGL_PLATFORM_SURFACELESS_MESA, nullptr), "", false,
                                        debug);
}

}  // namespace tessera
