#include "window.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <fmt/format.h>
#include <imgui.h>
#include <imgui_internal.h>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <vector>

#include "gl/gl_functions.h"
#include "panels.h"
#include "tessera/error.h"

namespace tessera {

namespace {

using Clock = std::chrono::steady_clock;
using Json = SceneDocument::Json;

constexpr float kPanelWidth = 340, kStatusHeight = 26;
/// The interface is drawn so often at least while bricks are sampled.
constexpr double kIdleMs = 120;
constexpr double kFlyASecond = 0.8;
/// From the eye to what it looks at, in sizes of the data.
constexpr double kNearest = 1e-5, kFarthest = 1e3;
/// A key or a button changes something in the first frame; what is new in the second is seen in the third.
constexpr int kFramesOfInput = 3;
constexpr float kHandleReach = 9;
constexpr double kDoubleClickMs = 500;
/// A device that is lost more often than that isn't tried again.
constexpr int kMostRecoveries = 3;
constexpr std::chrono::seconds kRecoveriesWithin{10};

std::string lastError;

struct PressedKey {
    int key = 0, mods = 0;
};

/// Of a letter that key which has it on the keyboard's layout: GLFW tells where on an American one it is.
int keyOnLayout(int key, int scancode) {
    if (key < GLFW_KEY_A || key > GLFW_KEY_Z) return key;
    const char* name = glfwGetKeyName(key, scancode);
    const bool isLetter = name && name[0] >= 'a' && name[0] <= 'z' && name[1] == 0;
    return isLetter ? GLFW_KEY_A + (name[0] - 'a') : key;
}

/// Its context is current. Throws IoError.
GLFWwindow* openWindow(int width, int height, bool isShown) {
    glfwSetErrorCallback([](int, const char* text) { lastError = text; });
    if (!glfwInit()) throw IoError("no window can be opened: " + lastError);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    glfwWindowHint(GLFW_CONTEXT_ROBUSTNESS, GLFW_LOSE_CONTEXT_ON_RESET);  // so that a loss can be told
    glfwWindowHint(GLFW_VISIBLE, isShown ? GLFW_TRUE : GLFW_FALSE);
    GLFWwindow* window = glfwCreateWindow(width, height, "Tessera", nullptr, nullptr);
    if (!window) {
        glfwTerminate();
        throw IoError("no window with OpenGL 4.5 can be opened: " + lastError);
    }
    glfwMakeContextCurrent(window);
    return window;
}

double msBetween(Clock::time_point from, Clock::time_point to) {
    return std::chrono::duration<double, std::milli>(to - from).count();
}
double msSince(Clock::time_point then) {
    return msBetween(then, Clock::now());
}

}  // namespace

void tryWindow() {
    GLFWwindow* window = openWindow(64, 64, false);
    const GlFunctions gl = loadGlFunctions([](const char* name) { return glfwGetProcAddress(name); });
    gl.ClearColor(1, 1, 1, 1);
    gl.Clear(GL_COLOR_BUFFER_BIT);
    glfwSwapBuffers(window);
    gl.Finish();
    glfwDestroyWindow(window);
    glfwTerminate();
}

// What GLFW and OpenGL have of the window.
struct Window::Screen {
    GLFWwindow* window = nullptr;
    GlFunctions gl;
    GLuint texture = 0;
    int textureWidth = 0, textureHeight = 0;
    PanelState state;

    int buttonsDown = 0;
    std::size_t inputs = 0;  ///< those that a picture at rest gives way to
    int framesDue = 0;       ///< of the interface, before the next picture, which may take seconds
    std::vector<std::string> dropped;
    std::optional<std::array<double, 2>> lastMouse;
    bool isDragging = false;
    int handle = -1;              ///< that is dragged
    Clock::time_point asked{};    ///< when all events until then had come
    Clock::time_point pressed{};  ///< the last press of the left button came then at the latest, and where
    double pressedX = 0, pressedY = 0;
    std::vector<PressedKey> keys;                      ///< since the last frame
    std::set<int> held;                                ///< now
    std::optional<std::array<double, 2>> doubleClick;  ///< screen coordinates
    std::vector<Clock::time_point> recoveries;
    bool hasFailed = false;

    static Screen& of(GLFWwindow* window) { return *static_cast<Screen*>(glfwGetWindowUserPointer(window)); }
    float panelWidth() const { return state.isOpen ? kPanelWidth * scale : 0; }
    float scale = 1;
    /// Takes what has come, or waits for something to come.
    void takeEvents(double seconds = 0) {
        seconds > 0 ? glfwWaitEventsTimeout(seconds) : glfwPollEvents();
        asked = Clock::now();
    }

    ~Screen() {
        if (window) {
            ImGui_ImplOpenGL3_Shutdown();
            ImGui_ImplGlfw_Shutdown();
            ImGui::DestroyContext();
            if (texture) gl.DeleteTextures(1, &texture);
            glfwDestroyWindow(window);
        }
        glfwTerminate();
    }
};

Window::Window(ViewSession& session, const WindowOptions& options)
    : session_(session), screen_(std::make_unique<Screen>()) {
    GLFWwindow* window = openWindow(options.width, options.height, true);
    Screen& screen = *screen_;
    glfwSetWindowUserPointer(window, &screen);
    glfwSwapInterval(0);
    glfwSetWindowSizeLimits(window, 480, 320, GLFW_DONT_CARE, GLFW_DONT_CARE);
    glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int) {
        Screen& s = Screen::of(w);
        s.buttonsDown += action == GLFW_PRESS ? 1 : -1;
        ++s.inputs;
        s.framesDue = kFramesOfInput;
        if (button != GLFW_MOUSE_BUTTON_LEFT || action != GLFW_PRESS) return;
        // By events, as two clicks may come while one picture is drawn. When is known no better than that it
        // was after the events before: what a picture takes isn't the hand's.
        double x = 0, y = 0;
        glfwGetCursorPos(w, &x, &y);
        const bool isSecond = msBetween(s.pressed, s.asked) < kDoubleClickMs &&
                              std::hypot(x - s.pressedX, y - s.pressedY) < kHandleReach * s.scale;
        if (isSecond) s.doubleClick = {x, y};
        s.pressed = isSecond ? Clock::time_point{} : Clock::now();
        s.pressedX = x, s.pressedY = y;
    });
    glfwSetCursorPosCallback(window, [](GLFWwindow* w, double, double) {
        if (Screen::of(w).buttonsDown > 0) ++Screen::of(w).inputs;
    });
    glfwSetScrollCallback(window, [](GLFWwindow* w, double, double) { ++Screen::of(w).inputs; });
    // By events too: a key may be pressed and let go while one picture is drawn.
    glfwSetKeyCallback(window, [](GLFWwindow* w, int place, int scancode, int action, int mods) {
        Screen& s = Screen::of(w);
        const int key = keyOnLayout(place, scancode);
        ++s.inputs;
        s.framesDue = kFramesOfInput;
        if (action == GLFW_PRESS) s.keys.push_back({key, mods});
        // One that began with Ctrl is no movement, whichever is let go first.
        if (action == GLFW_PRESS && (mods & GLFW_MOD_CONTROL) == 0) s.held.insert(key);
        if (action == GLFW_RELEASE) s.held.erase(key);
    });
    glfwSetFramebufferSizeCallback(window, [](GLFWwindow* w, int, int) { ++Screen::of(w).inputs; });
    glfwSetWindowCloseCallback(window, [](GLFWwindow* w) { ++Screen::of(w).inputs; });
    glfwSetDropCallback(window, [](GLFWwindow* w, int count, const char** paths) {
        for (int i = 0; i < count; ++i) Screen::of(w).dropped.emplace_back(paths[i]);
        ++Screen::of(w).inputs;
    });

    screen.gl = loadGlFunctions([](const char* name) { return glfwGetProcAddress(name); });
    IMGUI_CHECKVERSION();
    ImGui::CreateContext();
    ImGui::GetIO().IniFilename = nullptr;
    float scaleY = 1;
    glfwGetWindowContentScale(window, &screen.scale, &scaleY);
    ImGui::GetStyle().ScaleAllSizes(screen.scale);
    ImGui::GetIO().FontGlobalScale = screen.scale;
    ImGui_ImplGlfw_InitForOpenGL(window, true);
    ImGui_ImplOpenGL3_Init("#version 330 core");
    screen.window = window;
    screen.state.scenePath = options.scenePath;
    screen.state.picturePath = options.picturePath;
    screen.state.isLight = options.isLight;
}

Window::~Window() = default;

namespace {

/// Changes the camera as a drag. Nearer or further than pictures can be drawn from it doesn't go.
void moveCamera(ViewSession& session, const std::function<void(ViewCamera&)>& move) {
    ViewCamera camera = session.viewCamera();
    move(camera);
    const double away = glm::length(camera.targetWorld - camera.eyeWorld);
    const double size = glm::length(session.source()->boundsWorld().size());
    if (!(away > kNearest * size && away < kFarthest * size && camera.heightWorld < kFarthest * size)) return;
    if (camera.heightWorld > 0 && camera.heightWorld < kNearest * size) return;
    Json json = session.document().json();
    json["camera"] = camera.json();
    session.document().drag(std::move(json));
    session.touch();
}

void pressKey(ViewSession& session, PanelState& state, GLFWwindow* window, const PressedKey& pressed) {
    const bool hasShift = (pressed.mods & GLFW_MOD_SHIFT) != 0;
    if ((pressed.mods & GLFW_MOD_CONTROL) != 0) {
        switch (pressed.key) {
            case GLFW_KEY_Z:
                return hasShift ? session.document().redo() : session.document().undo();
            case GLFW_KEY_Y:
                return session.document().redo();
            case GLFW_KEY_S:
                return saveScene(session, state);
            case GLFW_KEY_P:
                return savePicture(session, state);
            case GLFW_KEY_Q:
                return glfwSetWindowShouldClose(window, GLFW_TRUE);
            default:
                return;
        }
    }
    switch (pressed.key) {
        case GLFW_KEY_H:
        case GLFW_KEY_F1:
            state.showsHelp = !state.showsHelp;
            return;
        case GLFW_KEY_T:
            state.isLight = !state.isLight;
            return;
        case GLFW_KEY_TAB:
            state.isOpen = !state.isOpen;
            return;
        case GLFW_KEY_ESCAPE:
            state.showsHelp = false;
            state.messages.clear();
            return;
        default:
            break;
    }
    if (!session.source()) return;
    Json json = session.document().json();
    switch (pressed.key) {
        case GLFW_KEY_G:
            return toggleEffect(session, "bricks");
        case GLFW_KEY_C:
            return toggleEffect(session, "cuts");
        case GLFW_KEY_P:
            return toggleEffect(session, "probes");
        case GLFW_KEY_O:
            if (session.mesh()) toggleEffect(session, "outline");
            return;
        case GLFW_KEY_B:
            return addBookmark(session, state);
        case GLFW_KEY_F:
            return showAll(session);
        case GLFW_KEY_V:
            if (session.mesh()) toggleViewFocus(session);
            return;
        case GLFW_KEY_X:
        case GLFW_KEY_Y:
        case GLFW_KEY_Z: {
            Vec3d direction(0);
            direction[pressed.key - GLFW_KEY_X] = hasShift ? -1 : 1;
            json["camera"] = {{"direction", {direction.x, direction.y, direction.z}}};
            break;
        }
        default:
            return;
    }
    session.document().change(std::move(json));
}

void handleKeys(ViewSession& session, PanelState& state, GLFWwindow* window,
                const std::vector<PressedKey>& keys, const std::set<int>& heldKeys) {
    const ImGuiIO& io = ImGui::GetIO();
    // Where text is written letters are its own, and Ctrl Z is.
    const auto isOfText = [&](const PressedKey& pressed) {
        const bool hasControl = (pressed.mods & GLFW_MOD_CONTROL) != 0;
        const bool isWindows =
            pressed.key == GLFW_KEY_S || pressed.key == GLFW_KEY_P || pressed.key == GLFW_KEY_Q;
        return io.WantTextInput && !(hasControl && isWindows);
    };
    for (const PressedKey& key : keys) try {
            if (!isOfText(key)) pressKey(session, state, window, key);
        } catch (const std::exception& error) {
            tell(state, error.what());
        }
    if (!session.source() || io.WantTextInput) return;
    const auto held = [&](int key) { return heldKeys.contains(key) ? 1.0 : 0.0; };
    const double step = kFlyASecond * std::min(double(io.DeltaTime), 0.2);
    const double ahead = held(GLFW_KEY_W) - held(GLFW_KEY_S), right = held(GLFW_KEY_D) - held(GLFW_KEY_A),
                 above = held(GLFW_KEY_E) - held(GLFW_KEY_Q);
    const double turn = held(GLFW_KEY_RIGHT) - held(GLFW_KEY_LEFT),
                 tilt = held(GLFW_KEY_UP) - held(GLFW_KEY_DOWN);
    try {
        if (ahead != 0 || right != 0 || above != 0)
            moveCamera(session,
                       [&](ViewCamera& camera) { camera.fly(step * ahead, step * right, step * above); });
        if (turn != 0 || tilt != 0)
            moveCamera(session, [&](ViewCamera& camera) { camera.orbit(step * turn, step * tilt); });
    } catch (const InputError& error) {  // the scene's camera can't be
        tell(state, error.what());
    }
    static bool wasMoving = false;
    const bool isMoving = ahead != 0 || right != 0 || above != 0 || turn != 0 || tilt != 0;
    if (wasMoving && !isMoving) session.document().endDrag();
    wasMoving = isMoving;
}

/// A dot that is dragged: a plane along its normal, or a ball's middle across the view.
struct Handle {
    nlohmann::ordered_json::json_pointer at;  // of the plane or ball in the scene
    bool isPlane = false;
    Vec3d placeWorld{0};
    Vec3d normal{0};  // of a plane
};

Vec3d vectorOf(const Json& json) {
    return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()};
}

std::vector<Handle> handlesOf(const ViewSession& session) {
    using Pointer = nlohmann::ordered_json::json_pointer;
    const Json& json = session.document().json();
    const Box3d& bounds = session.source()->boundsWorld();
    const Vec3d middle = 0.5 * (bounds.min + bounds.max);
    std::vector<Handle> handles;
    const auto addPlane = [&](const Pointer& at) {
        const Vec3d normal = vectorOf(json[at]["normal"]);
        const double offset = json[at]["offset"].get<double>();
        // The place of the plane that is nearest to the middle of the data.
        const Vec3d place = middle + (offset - glm::dot(normal, middle)) / glm::dot(normal, normal) * normal;
        handles.push_back({at, true, place, normal});
    };
    for (const char* list : {"/clip/planes", "/effects/cuts/planes"}) {
        const Pointer planes(list);
        if (!json.contains(planes)) continue;
        for (std::size_t i = 0; i < json[planes].size(); ++i) addPlane(planes / i);
    }
    const Pointer shapes("/effects/probes/shapes");
    if (json.contains(shapes))
        for (std::size_t i = 0; i < json[shapes].size(); ++i) {
            if (json[shapes][i].contains("plane")) addPlane(shapes / i / "plane");
            if (json[shapes][i].contains("sphere"))
                handles.push_back(
                    {shapes / i / "sphere", false, vectorOf(json[shapes][i]["sphere"]["center"])});
        }
    return handles;
}

/// What went wrong, until it is read.
void drawMessages(PanelState& state, float left) {
    if (state.messages.empty()) return;
    ImGui::SetNextWindowPos({left + 12, 12});
    ImGui::Begin("messages", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoFocusOnAppearing);
    for (const std::string& message : state.messages) ImGui::TextUnformatted(message.c_str());
    if (ImGui::SmallButton("read")) state.messages.clear();
    ImGui::End();
}

/// Draws the handles, and moves the one that is dragged. @param held the number of that one, -1: none.
/// @param onWindow pixels of the window for those of the picture. @param movedPixels the hand, of the
/// picture.
void drawHandles(ViewSession& session, ImDrawList& draw, int& held, bool isActive,
                 const std::function<ImVec2(const std::array<double, 2>&)>& onWindow,
                 const std::array<double, 2>& movedPixels) {
    const std::vector<Handle> handles = handlesOf(session);
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const float scale = ImGui::GetIO().FontGlobalScale;
    const double reachWorld = 0.1 * glm::length(session.source()->boundsWorld().size());
    for (std::size_t i = 0; i < handles.size(); ++i) {
        const Handle& handle = handles[i];
        const auto at = session.pixelOf(handle.placeWorld);
        if (!at) continue;
        const ImVec2 dot = onWindow(*at);
        const bool isNear = std::hypot(dot.x - mouse.x, dot.y - mouse.y) < kHandleReach * scale;
        if (isNear && ImGui::IsItemClicked(ImGuiMouseButton_Left)) held = int(i);
        const bool isHeld = held == int(i) && isActive;
        const ImU32 colour = isNear || isHeld ? IM_COL32(255, 200, 60, 255) : IM_COL32(255, 140, 0, 220);
        Json moved = session.document().json();
        if (handle.isPlane) {
            const double length = glm::length(handle.normal);
            const auto ahead = session.pixelOf(handle.placeWorld + reachWorld / length * handle.normal);
            if (!ahead) continue;
            draw.AddLine(dot, onWindow(*ahead), colour, 2);
            const double x = (*ahead)[0] - (*at)[0], y = (*ahead)[1] - (*at)[1];
            const double along = (movedPixels[0] * x + movedPixels[1] * y) / std::max(x * x + y * y, 1.0);
            Json& offset = moved[handle.at]["offset"];
            offset = offset.get<double>() + along * reachWorld * length;
        } else {
            const Vec3d place =
                session.movedTo(handle.placeWorld, (*at)[0] + movedPixels[0], (*at)[1] + movedPixels[1]);
            moved[handle.at]["center"] = {place.x, place.y, place.z};
        }
        draw.AddCircleFilled(dot, 6 * scale, colour);
        if (isHeld && (movedPixels[0] != 0 || movedPixels[1] != 0)) {
            session.document().drag(std::move(moved));
            session.touch();
        }
    }
}

}  // namespace

void Window::showPicture() {
    Screen& screen = *screen_;
    const RgbImage& picture = session_.picture();
    if (picture.width == 0) return;
    const GlFunctions& gl = screen.gl;
    if (screen.textureWidth != picture.width || screen.textureHeight != picture.height) {
        if (screen.texture) gl.DeleteTextures(1, &screen.texture);
        gl.CreateTextures(GL_TEXTURE_2D, 1, &screen.texture);
        gl.TextureStorage2D(screen.texture, 1, GL_RGB8, picture.width, picture.height);
        gl.TextureParameteri(screen.texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
        gl.TextureParameteri(screen.texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
        screen.textureWidth = picture.width, screen.textureHeight = picture.height;
    }
    gl.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
    gl.TextureSubImage2D(screen.texture, 0, 0, 0, picture.width, picture.height, GL_RGB, GL_UNSIGNED_BYTE,
                         picture.rgb.data());
}

void Window::drawInterface() {
    Screen& screen = *screen_;
    PanelState& state = screen.state;
    const ImGuiIO& io = ImGui::GetIO();
    const float left = screen.panelWidth(), wide = std::max(io.DisplaySize.x - left, 1.0f);
    const float bar = kStatusHeight * screen.scale, high = std::max(io.DisplaySize.y - bar, 1.0f);
    // What doesn't look at the scene first: it is there when that has something that can't be.
    drawMessages(state, left);
    drawHelp(state);
    if (state.isOpen) drawPanel(session_, state, left, io.DisplaySize.y);
    drawStatus(session_, state, left, high, wide, bar);

    // The picture, and what a hand does there.
    ImGui::SetNextWindowPos({left, 0});
    ImGui::SetNextWindowSize({wide, high});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
    ImGui::Begin("picture", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoBackground);
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    if (screen.texture && session_.source())
        draw.AddImage(ImTextureID(std::intptr_t(screen.texture)), {left, 0}, {left + wide, high});
    ImGui::SetCursorPos({0, 0});
    ImGui::InvisibleButton("hand", {wide, high},
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                               ImGuiButtonFlags_MouseButtonMiddle);
    const bool isHovered = ImGui::IsItemHovered(), isActive = ImGui::IsItemActive();
    // Pixels of the picture for one of the window.
    const double dense = double(session_.width()) / double(wide);
    const std::array<double, 2> mouse{(io.MousePos.x - left) * dense, io.MousePos.y * dense};
    if (session_.source()) {
        drawHandles(session_, draw, screen.handle, isActive,
                    [&](const std::array<double, 2>& p) {
                        return ImVec2(left + float(p[0] / dense), float(p[1] / dense));
                    },
                    {io.MouseDelta.x * dense, io.MouseDelta.y * dense});
        if (isActive && screen.handle < 0 && (io.MouseDelta.x != 0 || io.MouseDelta.y != 0)) {
            const double right = double(io.MouseDelta.x) / double(high),
                         down = double(io.MouseDelta.y) / double(high);
            const bool isMiddle = ImGui::IsMouseDown(ImGuiMouseButton_Middle);
            if (isMiddle || (ImGui::IsMouseDown(ImGuiMouseButton_Left) && io.KeyShift))
                moveCamera(session_, [&](ViewCamera& camera) { camera.pan(right, -down); });
            else if (ImGui::IsMouseDown(ImGuiMouseButton_Right))
                moveCamera(session_, [&](ViewCamera& camera) { camera.zoom(std::exp(-3 * down)); });
            else
                moveCamera(session_, [&](ViewCamera& camera) { camera.orbit(right, -down); });
        }
        if (ImGui::IsItemDeactivated()) {
            session_.document().endDrag();
            screen.handle = -1;
        }
        if (isHovered && io.MouseWheel != 0) {
            moveCamera(session_,
                       [&](ViewCamera& camera) { camera.zoom(std::exp(0.15 * double(io.MouseWheel))); });
            session_.document().endDrag();
        }
        if (const auto click = std::exchange(screen.doubleClick, {}); click && isHovered)
            if (const auto seen = session_.seenAt(((*click)[0] - left) * dense, (*click)[1] * dense))
                setFocus(session_, seen->placeWorld);
        if (isHovered && !isActive) {
            if (screen.lastMouse != mouse) {
                const auto seen = session_.seenAt(mouse[0], mouse[1]);
                state.underCursor =
                    seen
                        ? fmt::format("{} = {:.5g} at {:.4g}, {:.4g}, {:.4g}", session_.source()->title(),
                                      seen->value, seen->placeWorld.x, seen->placeWorld.y, seen->placeWorld.z)
                        : "";
                screen.lastMouse = mouse;
            }
        } else {
            state.underCursor.clear();
        }
    }
    ImGui::End();
    ImGui::PopStyleVar();
}

void Window::drawOnce(bool isPictureNew) {
    Screen& screen = *screen_;
    PanelState& state = screen.state;
    if (isPictureNew) showPicture();
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    state.isLight ? ImGui::StyleColorsLight() : ImGui::StyleColorsDark();
    ImGui::NewFrame();
    try {
        drawInterface();
    } catch (const std::exception& error) {  // the scene has something that can't be
        ImGui::ErrorCheckEndFrameRecover(nullptr);
        tell(state, error.what());
    }
    // After the mouse, which has moved what a key saves.
    handleKeys(session_, state, screen.window, std::exchange(screen.keys, {}), screen.held);
    ImGui::Render();
    const GlFunctions& gl = screen.gl;
    int framebufferWidth = 0, framebufferHeight = 0;
    glfwGetFramebufferSize(screen.window, &framebufferWidth, &framebufferHeight);
    gl.Viewport(0, 0, framebufferWidth, framebufferHeight);
    const float shade = state.isLight ? 0.94f : 0.1f;
    gl.ClearColor(shade, shade, shade, 1);
    gl.Clear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
    glfwSwapBuffers(screen.window);
    if (gl.GetGraphicsResetStatus() != GL_NO_ERROR) giveUp();
}

void Window::giveUp() {
    const std::string lost = "the OpenGL device of the window was lost";
    saveScene(session_, screen_->state);
    throw GlError(lost + "; " + screen_->state.messages.back());
}

/// Meshes and .vdb files first, so that a scene that comes with one is its own.
void Window::openDropped() {
    std::vector<std::string> paths = std::exchange(screen_->dropped, {});
    const auto isScene = [](const std::string& path) { return path.ends_with(".json"); };
    std::stable_partition(paths.begin(), paths.end(),
                          [&](const std::string& path) { return !isScene(path); });
    for (const std::string& path : paths) try {
            isScene(path) ? session_.useScene(SceneDocument::read(path).json()) : session_.open(path);
        } catch (const std::exception& error) {
            tell(screen_->state, error.what());
        }
}

/// A piece of the session's work; false: there was none.
bool Window::drawPicture(const std::function<bool()>& isEnding) {
    Screen& screen = *screen_;
    PanelState& state = screen.state;
    if (screen.hasFailed) return false;
    const std::size_t before = screen.inputs;
    try {
        return session_.work([&] {
            screen.takeEvents();
            return screen.inputs != before || isEnding();
        }) != ViewSession::Did::nothing;
    } catch (const GlMemoryError& error) {  // another context would have no more of it
        tell(state, error.what());
        return false;
    } catch (const GlError& error) {
        tell(state, error.what());
    } catch (const std::exception& error) {
        tell(state, error.what());
        return false;
    }
    std::erase_if(screen.recoveries,
                  [](Clock::time_point at) { return Clock::now() - at > kRecoveriesWithin; });
    screen.recoveries.push_back(Clock::now());
    screen.hasFailed = int(screen.recoveries.size()) > kMostRecoveries;
    try {
        if (!screen.hasFailed) session_.recover();
    } catch (const std::exception& error) {
        tell(state, error.what());
        screen.hasFailed = true;
    }
    if (screen.hasFailed) tell(state, "no more pictures are drawn; the scene can still be saved");
    return false;
}

void Window::run(const std::function<bool()>& isEnding) {
    Screen& screen = *screen_;
    PanelState& state = screen.state;
    Clock::time_point drawn{};
    std::size_t inputs = 0, pictureNumber = 0;
    bool isBusy = true;
    std::string title;
    while (!glfwWindowShouldClose(screen.window) && !isEnding()) {
        screen.takeEvents(isBusy ? 0 : 0.25);
        openDropped();
        int framebufferWidth = 0, framebufferHeight = 0;
        glfwGetFramebufferSize(screen.window, &framebufferWidth, &framebufferHeight);
        const bool isShown = framebufferWidth > 0 && framebufferHeight > 0 &&
                             glfwGetWindowAttrib(screen.window, GLFW_ICONIFIED) == GLFW_FALSE;
        if (isShown) {
            int windowWidth = 1, windowHeight = 1;
            glfwGetWindowSize(screen.window, &windowWidth, &windowHeight);
            const double dense = double(framebufferWidth) / std::max(windowWidth, 1);
            session_.resize(framebufferWidth - int(std::lround(screen.panelWidth() * dense)),
                            framebufferHeight - int(std::lround(kStatusHeight * screen.scale * dense)));
        }
        const bool isFrameDue = screen.framesDue > 0 && isShown;
        const bool hasWorked = !isFrameDue && drawPicture(isEnding);
        for (const std::string& message : session_.takeMessages()) tell(state, message);
        for (const FrameTime& frame : session_.takeFrames())
            state.frameMs = frame.ms, state.frameScale = frame.scale;
        // What goes on is told where the window is minimised, too.
        std::string named = std::filesystem::path(session_.path()).filename().string();
        named += named.empty() ? "Tessera" : " - Tessera";
        if (session_.isOpening())
            named = "reading - " + named;
        else if (session_.source() && !session_.isRefined())
            named = "refining - " + named;
        else if (session_.source() && !session_.hasConverged())
            named = "drawing - " + named;
        if (named != title) glfwSetWindowTitle(screen.window, (title = named).c_str());
        isBusy = hasWorked || isFrameDue || session_.isOpening();
        const bool isPictureNew = session_.pictureNumber() != pictureNumber;
        const bool isDue =
            isPictureNew || screen.inputs != inputs || msSince(drawn) > kIdleMs || !isBusy || isFrameDue;
        if (isShown && isDue) {
            pictureNumber = session_.pictureNumber();
            inputs = screen.inputs;
            screen.framesDue = std::max(0, screen.framesDue - 1);
            drawOnce(isPictureNew);
            drawn = Clock::now();
        } else if (!hasWorked && isBusy) {
            screen.takeEvents(0.02);  // a file is being read
        }
    }
}

}  // namespace tessera
