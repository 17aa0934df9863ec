#include "view/scene_document.h"

#include <filesystem>
#include <utility>

#include "files/atomic_file.h"
#include "files/input_file.h"
#include "scene/scene_file.h"

namespace tessera {

namespace {

constexpr std::size_t kMostSteps = 200;

}  // namespace

SceneDocument::SceneDocument() {
    restart({{"version", 1}});
}

SceneDocument SceneDocument::read(const std::string& path) {
    const Scene scene = readScene(path);  // strictly, with the file's name in what it says
    Json json = Json::parse(readWholeFile(path));
    const Json::json_pointer mesh("/effects/outline/mesh");
    if (json.contains(mesh)) {
        std::error_code error;
        const std::filesystem::path whole = std::filesystem::absolute(scene.outline.mesh, error);
        if (!error) json[mesh] = whole.string();
    }
    SceneDocument document;
    document.restart(std::move(json));
    return document;
}

void SceneDocument::restart(Json json) {
    take(std::move(json));
    steps_ = {json_};
    at_ = 0;
    endDrag();
}

void SceneDocument::take(Json json) {
    scene_ = sceneFrom(JsonNode::of(nlohmann::json(json), "the scene"));
    json_ = std::move(json);
    ++revision_;
}

void SceneDocument::change(Json json, bool isStep) {
    if (json == json_) return;
    take(std::move(json));
    if (isStep) {
        steps_.resize(at_ + 1);
        if (steps_.size() == kMostSteps) steps_.erase(steps_.begin());
        steps_.push_back(json_);
        at_ = steps_.size() - 1;
    } else {
        steps_.resize(at_ + 1);
        steps_[at_] = json_;
    }
}

void SceneDocument::drag(Json json) {
    if (json == json_) return;
    change(std::move(json), !std::exchange(isDragged_, true));
}

void SceneDocument::undo() {
    if (!canUndo()) return;
    endDrag();
    take(steps_[--at_]);
}

void SceneDocument::redo() {
    if (!canRedo()) return;
    endDrag();
    take(steps_[++at_]);
}

void SceneDocument::save(const std::string& path) const {
    writeFileAtomically(path, json_.dump(2) + "\n");
}

}  // namespace tessera
