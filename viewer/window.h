#pragma once

#include <memory>
#include <string>

#include "view/view_session.h"

struct GLFWwindow;

namespace tessera {

struct WindowOptions {
    int width = 1280, height = 800;  ///< screen coordinates
    bool isLight = false;
    std::string scenePath = "scene.json", picturePath = "picture.png";  ///< where the buttons save
};

/// Opens a window that isn't shown, and draws into it: for a process that tries whether its driver can.
/// Throws IoError as Window does.
void tryWindow();

/// The window around a session: draws what it shows, and turns keys and the mouse into changes of the scene.
class Window {
  public:
    /// Throws IoError without a display, or without OpenGL 4.5 on it.
    Window(ViewSession& session, const WindowOptions& options);
    ~Window();
    Window(const Window&) = delete;
    Window& operator=(const Window&) = delete;

    /// Until the user closes it, or `isEnding` says so. Throws GlError when the window's own OpenGL device is
    /// lost; the scene is saved first.
    void run(const std::function<bool()>& isEnding);

  private:
    struct Screen;
    void showPicture();
    void drawOnce(bool isPictureNew);
    void drawInterface();
    void openDropped();
    bool drawPicture(const std::function<bool()>& isEnding);
    [[noreturn]] void giveUp();

    ViewSession& session_;
    std::unique_ptr<Screen> screen_;
};

}  // namespace tessera
