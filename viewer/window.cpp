#include "window.h"

#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <fmt/format.h>
#include <imgui.h>

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
constexpr float kHandleReach = 9;
constexpr double kDoubleClickMs = 500;
/// A device that is lost more often than that isn't tried again.
constexpr int kMostRecoveries = 3;
constexpr std::chrono::seconds kRecoveriesWithin{10};

std::string lastError;

struct PressedKey {
    int key = 0, mods = 0;
};

double msSince(Clock::time_point then) {
    return std::chrono::duration<double, std::milli>(Clock::now() - then).count();
}

}  // namespace

// What GLFW and OpenGL have of the window.
struct Window::Screen {
    GLFWwindow* window = nullptr;
    GlFunctions gl;
    GLuint texture = 0;
    int textureWidth = 0, textureHeight = 0;
    PanelState state;

    int buttonsDown = 0;
    std::size_t inputs = 0;  ///< those that a picture at rest gives way to
    std::vector<std::string> dropped;
    std::optional<std::array<double, 2>> lastMouse;
    bool isDragging = false;
    int handle = -1;              ///< that is dragged
    Clock::time_point pressed{};  ///< the last press of the left button, and where
    double pressedX = 0, pressedY = 0;
    std::vector<PressedKey> keys;                      ///< since the last frame
    std::set<int> held;                                ///< now
    std::optional<std::array<double, 2>> doubleClick;  ///< screen coordinates
    std::vector<Clock::time_point> recoveries;
    bool hasFailed = false;

    static Screen& of(GLFWwindow* window) { return *static_cast<Screen*>(glfwGetWindowUserPointer(window)); }
    float panelWidth() const { return state.isOpen ? kPanelWidth * scale : 0; }
    float scale = 1;

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
    glfwSetErrorCallback([](int, const char* text) { lastError = text; });
    if (!glfwInit()) throw IoError("no window can be opened: " + lastError);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, GLFW_TRUE);
    GLFWwindow* window = glfwCreateWindow(options.width, options.height, "Tessera", nullptr, nullptr);
    if (!window) {
        glfwTerminate();
        throw IoError("no window with OpenGL 4.5 can be opened: " + lastError);
    }
    Screen& screen = *screen_;
    glfwSetWindowUserPointer(window, &screen);
    glfwMakeContextCurrent(window);
    glfwSwapInterval(0);
    glfwSetWindowSizeLimits(window, 480, 320, GLFW_DONT_CARE, GLFW_DONT_CARE);
    glfwSetMouseButtonCallback(window, [](GLFWwindow* w, int button, int action, int) {
        Screen& s = Screen::of(w);
        s.buttonsDown += action == GLFW_PRESS ? 1 : -1;
        ++s.inputs;
        if (button != GLFW_MOUSE_BUTTON_LEFT || action != GLFW_PRESS) return;
        // By events, as two clicks may come while one picture is drawn.
        double x = 0, y = 0;
        glfwGetCursorPos(w, &x, &y);
        const bool isSecond =
            msSince(s.pressed) < kDoubleClickMs && std::hypot(x - s.pressedX, y - s.pressedY) < kHandleReach;
        if (isSecond) s.doubleClick = {x, y};
        s.pressed = isSecond ? Clock::time_point{} : Clock::now();
        s.pressedX = x, s.pressedY = y;
    });
    glfwSetCursorPosCallback(window, [](GLFWwindow* w, double, double) {
        if (Screen::of(w).buttonsDown > 0) ++Screen::of(w).inputs;
    });
    glfwSetScrollCallback(window, [](GLFWwindow* w, double, double) { ++Screen::of(w).inputs; });
    // By events too: a key may be pressed and let go while one picture is drawn.
    glfwSetKeyCallback(window, [](GLFWwindow* w, int key, int, int action, int mods) {
        Screen& s = Screen::of(w);
        ++s.inputs;
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
    if (io.WantTextInput) return;
    for (const PressedKey& key : keys) try {
            pressKey(session, state, window, key);
        } catch (const std::exception& error) {
            tell(state, error.what());
        }
    if (!session.source()) return;
    const auto held = [&](int key) { return heldKeys.contains(key) ? 1.0 : 0.0; };
    const double step = kFlyASecond * std::min(double(io.DeltaTime), 0.2);
    const double ahead = held(GLFW_KEY_W) - held(GLFW_KEY_S), right = held(GLFW_KEY_D) - held(GLFW_KEY_A),
                 above = held(GLFW_KEY_E) - held(GLFW_KEY_Q);
    const double turn = held(GLFW_KEY_RIGHT) - held(GLFW_KEY_LEFT),
                 tilt = held(GLFW_KEY_UP) - held(GLFW_KEY_DOWN);
    if (ahead != 0 || right != 0 || above != 0)
        moveCamera(session,
                   [&](ViewCamera& camera) { camera.fly(step * ahead, step * right, step * above); });
    if (turn != 0 || tilt != 0)
        moveCamera(session, [&](ViewCamera& camera) { camera.orbit(step * turn, step * tilt); });
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

/// Draws the handles, and moves the one that is dragged. @param held the number of that one, -1: none.
/// @param onWindow pixels of the window for those of the picture. @param movedPixels the hand, of the
/// picture.
void drawHandles(ViewSession& session, ImDrawList& draw, int& held, bool isActive,
                 const std::function<ImVec2(const std::array<double, 2>&)>& onWindow,
                 const std::array<double, 2>& movedPixels) {
    const std::vector<Handle> handles = handlesOf(session);
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const double reachWorld = 0.1 * glm::length(session.source()->boundsWorld().size());
    for (std::size_t i = 0; i < handles.size(); ++i) {
        const Handle& handle = handles[i];
        const auto at = session.pixelOf(handle.placeWorld);
        if (!at) continue;
        const ImVec2 dot = onWindow(*at);
        const bool isNear = std::hypot(dot.x - mouse.x, dot.y - mouse.y) < kHandleReach;
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
        draw.AddCircleFilled(dot, 6, colour);
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

void Window::drawOnce(bool isPictureNew) {
    Screen& screen = *screen_;
    PanelState& state = screen.state;
    if (isPictureNew) showPicture();
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    state.isLight ? ImGui::StyleColorsLight() : ImGui::StyleColorsDark();
    ImGui::NewFrame();
    const ImGuiIO& io = ImGui::GetIO();
    const float left = screen.panelWidth(), wide = io.DisplaySize.x - left;
    const float bar = kStatusHeight * screen.scale, high = io.DisplaySize.y - bar;
    if (state.isOpen) drawPanel(session_, state, left, io.DisplaySize.y);
    drawStatus(session_, state, left, high, wide, bar);
    drawHelp(state);

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
    ImGui::InvisibleButton("hand", {std::max(wide, 1.0f), std::max(high, 1.0f)},
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                               ImGuiButtonFlags_MouseButtonMiddle);
    const bool isHovered = ImGui::IsItemHovered(), isActive = ImGui::IsItemActive();
    // Pixels of the picture for one of the window.
    const double dense = double(session_.width()) / std::max(double(wide), 1.0);
    const std::array<double, 2> mouse{(io.MousePos.x - left) * dense, io.MousePos.y * dense};
    if (session_.source()) {
        drawHandles(session_, draw, screen.handle, isActive,
                    [&](const std::array<double, 2>& p) {
                        return ImVec2(left + float(p[0] / dense), float(p[1] / dense));
                    },
                    {io.MouseDelta.x * dense, io.MouseDelta.y * dense});
        if (isActive && screen.handle < 0 && (io.MouseDelta.x != 0 || io.MouseDelta.y != 0)) {
            const double right = io.MouseDelta.x / std::max(double(high), 1.0),
                         down = io.MouseDelta.y / std::max(double(high), 1.0);
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
    if (!state.messages.empty()) {
        ImGui::SetNextWindowPos({left + 12, 12});
        ImGui::Begin("messages", nullptr,
                     ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_AlwaysAutoResize |
                         ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoFocusOnAppearing);
        for (const std::string& message : state.messages) ImGui::TextUnformatted(message.c_str());
        if (ImGui::SmallButton("read")) state.messages.clear();
        ImGui::End();
    }
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
}

void Window::run(const std::function<bool()>& isEnding) {
    Screen& screen = *screen_;
    PanelState& state = screen.state;
    Clock::time_point drawn{};
    std::size_t inputs = 0, pictureNumber = 0;
    bool isBusy = true;
    std::string title;
    while (!glfwWindowShouldClose(screen.window) && !isEnding()) {
        isBusy ? glfwPollEvents() : glfwWaitEventsTimeout(0.25);
        for (const std::string& path : std::exchange(screen.dropped, {})) try {
                if (path.ends_with(".json"))
                    session_.document().change(SceneDocument::read(path).json());
                else
                    session_.open(path);
            } catch (const std::exception& error) {
                tell(state, error.what());
            }
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
        ViewSession::Did did = ViewSession::Did::nothing;
        try {
            const std::size_t before = screen.inputs;
            if (!screen.hasFailed)
                did = session_.work([&] {
                    glfwPollEvents();
                    return screen.inputs != before || isEnding();
                });
        } catch (const GlError& error) {
            tell(state, error.what());
            std::erase_if(screen.recoveries,
                          [](Clock::time_point at) { return Clock::now() - at > kRecoveriesWithin; });
            screen.recoveries.push_back(Clock::now());
            screen.hasFailed = int(screen.recoveries.size()) > kMostRecoveries;
            if (!screen.hasFailed) session_.recover();
        } catch (const std::exception& error) {
            tell(state, error.what());
        }
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
        isBusy = did != ViewSession::Did::nothing || session_.isOpening();
        const bool isPictureNew = session_.pictureNumber() != pictureNumber;
        const bool isDue = isPictureNew || screen.inputs != inputs || msSince(drawn) > kIdleMs || !isBusy;
        if (isShown && isDue) {
            pictureNumber = session_.pictureNumber();
            inputs = screen.inputs;
            try {
                drawOnce(isPictureNew);
            } catch (const std::exception& error) {  // the scene has something that can't be
                ImGui::EndFrame();
                tell(state, error.what());
            }
            drawn = Clock::now();
        } else if (did == ViewSession::Did::nothing && isBusy) {
            glfwWaitEventsTimeout(0.02);  // a file is being read
        }
    }
}

}  // namespace tessera
