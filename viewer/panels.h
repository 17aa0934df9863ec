#pragma once

#include <deque>
#include <set>
#include <string>

#include "view/view_session.h"

namespace tessera {

/// What the panels remember beside the scene.
struct PanelState {
    bool isOpen = true, showsHelp = false, isLight = false;
    std::string scenePath, picturePath;
    std::set<std::string> savedScenes;  ///< by this window, which may save them again
    std::string newBookmark;
    std::deque<std::string> messages;  ///< shown until they are read
    double frameMs = 0, frameScale = 1;
    std::string underCursor;
};

/// The panel on the left. Returns whether something of it is being dragged.
bool drawPanel(ViewSession& session, PanelState& state, float widthPixels, float heightPixels);
/// A line with what is going on.
void drawStatus(const ViewSession& session, const PanelState& state, float left, float top, float width,
                float height);
void drawHelp(PanelState& state);

/// Shows a message until it is read; not twice one after the other.
void tell(PanelState& state, const std::string& message);

// What keys do too; what goes wrong is a message. Files that aren't the window's own stay: another name is
// found.
void saveScene(ViewSession& session, PanelState& state);
void savePicture(ViewSession& session, PanelState& state);
void addBookmark(ViewSession& session, PanelState& state);
void setFocus(ViewSession& session, const Vec3d& placeWorld);
/// Bricks as fine as the picture shows, or not. What is shown is a mesh.
void toggleViewFocus(ViewSession& session);
/// The camera is found so that all is in the picture.
void showAll(ViewSession& session);
/// Turns an effect on or off.
void toggleEffect(ViewSession& session, const std::string& name);

}  // namespace tessera
