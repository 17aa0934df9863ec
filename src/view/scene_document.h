#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace tessera {

/// A scene that is being edited: the JSON of its file, which is the only state, and what it was before.
class SceneDocument {
  public:
    using Json = nlohmann::ordered_json;

    SceneDocument();
    /// Throws as readScene() does. Paths in it are made absolute: it may be saved in another folder.
    static SceneDocument read(const std::string& path);

    const Json& json() const { return json_; }
    /// What it says.
    const Scene& scene() const { return scene_; }
    /// Counts the changes.
    std::size_t revision() const { return revision_; }

    /// Takes `json` in place of what there is. Where that isn't a scene throws InputError, and nothing
    /// changes. @param isStep false: goes on with what the change before has begun, as while something is
    /// dragged, so that undo() takes both back at once.
    void change(Json json, bool isStep = true);
    /// The same, and what was before is forgotten: undo() doesn't lead there.
    void restart(Json json);
    /// Ends what is being dragged: the next change is a step.
    void endDrag() { isDragged_ = false; }
    /// The same for a change while something is dragged: the first one is a step.
    void drag(Json json);

    bool canUndo() const { return at_ > 0; }
    bool canRedo() const { return at_ + 1 < steps_.size(); }
    void undo();
    void redo();

    /// Writes the scene file. Throws IoError; nothing is lost.
    void save(const std::string& path) const;

  private:
    void take(Json json);

    Json json_;
    Scene scene_;
    std::size_t revision_ = 0;
    std::vector<Json> steps_;  // the last is the newest
    std::size_t at_ = 0;       // of steps_, json_
    bool isDragged_ = false;
};

}  // namespace tessera
