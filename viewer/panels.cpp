#include "panels.h"

#include <fmt/format.h>
#include <imgui.h>
#include <imgui_stdlib.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <functional>

#include "function_editor.h"
#include "scene/colour_maps.h"
#include "view/fresh_name.h"

namespace tessera {

namespace {

using Json = SceneDocument::Json;

constexpr std::size_t kMostMessages = 8;

/// What the scene has at a key, or a value in place of it.
double numberAt(const Json& json, const char* key, double otherwise) {
    return json.contains(key) && json[key].is_number() ? json[key].get<double>() : otherwise;
}

/// Changes the scene; what it can't be is told, and stays as it was.
void change(ViewSession& session, PanelState& state, const std::function<void(Json&)>& edit,
            bool isDragged = false) {
    Json json = session.document().json();
    edit(json);
    try {
        isDragged ? session.document().drag(std::move(json)) : session.document().change(std::move(json));
        session.touch();
    } catch (const std::exception& error) {
        tell(state, error.what());
    }
}

/// A number of an object that a slider moves.
bool slider(ViewSession& session, PanelState& state, const char* label, const Json& object,
            const std::function<Json&(Json&)>& objectIn, const char* key, double low, double high,
            double otherwise, bool isLogarithmic = false) {
    double value = numberAt(object, key, otherwise);
    const bool moved = ImGui::SliderScalar(label, ImGuiDataType_Double, &value, &low, &high, "%.4g",
                                           isLogarithmic ? ImGuiSliderFlags_Logarithmic : 0);
    if (moved)
        change(
            session, state, [&](Json& json) { objectIn(json)[key] = value; }, true);
    if (ImGui::IsItemDeactivated()) session.document().endDrag();
    return ImGui::IsItemActive();
}

Json& at(Json& json, const char* key) {
    if (!json.contains(key)) json[key] = Json::object();
    return json[key];
}
Json found(const Json& json, const char* key) {
    return json.contains(key) ? json[key] : Json::object();
}

bool drawData(ViewSession& session, PanelState& state) {
    const PictureSource& source = *session.source();
    const Json& json = session.document().json();
    ImGui::TextWrapped("%s", session.path().c_str());
    if (ImGui::BeginCombo("field", source.title().c_str())) {
        for (const PictureField& field : source.fields()) {
            ImGui::PushID(&field);  // a name may be empty
            if (ImGui::Selectable(field.name.c_str()))
                change(session, state, [&](Json& to) {
                    to["field"] = field.name;
                    to.erase("component");
                    to.erase("transfer_function");
                });
            for (int c = 0; field.components > 1 && c < field.components; ++c)
                if (ImGui::Selectable(fmt::format("    {} {}", field.name, c).c_str()))
                    change(session, state, [&](Json& to) {
                        to["field"] = field.name;
                        to["component"] = c;
                        to.erase("transfer_function");
                    });
            ImGui::PopID();
        }
        ImGui::EndCombo();
    }
    ImGui::Text("values %.5g to %.5g", source.range().min, source.range().max);
    auto unit = json.contains("unit") ? json["unit"].get<std::string>() : std::string();
    if (ImGui::InputText("unit", &unit))
        change(
            session, state,
            [&](Json& to) { unit.empty() ? void(to.erase("unit")) : void(to["unit"] = unit); }, true);
    if (ImGui::IsItemDeactivated()) session.document().endDrag();
    return false;
}

bool drawFunction(ViewSession& session, PanelState& state) {
    const Scene& scene = session.document().scene();
    bool isDragged = editFunction(session);
    if (ImGui::BeginCombo("colours", scene.function.stops.empty() ? scene.function.map.c_str() : "stops")) {
        for (const std::string_view map : colourMapNames())
            if (ImGui::Selectable(std::string(map).c_str()))
                change(session, state, [&](Json& to) {
                    at(to, "transfer_function").erase("stops");
                    at(to, "transfer_function")["map"] = std::string(map);
                });
        ImGui::EndCombo();
    }
    const ValueRange& values = session.source()->range();
    const std::array<double, 2> range = shownRangeOf(scene.function, values);
    float ends[2] = {float(range[0]), float(range[1])};
    const float speed = float(values.width() / 500);
    if (scene.function.stops.empty()) {
        if (ImGui::DragFloatRange2("range", &ends[0], &ends[1], speed, 0, 0, "%.4g", "%.4g") &&
            ends[0] < ends[1])
            change(
                session, state,
                [&](Json& to) {
                    at(to, "transfer_function")["range"] = {double(ends[0]), double(ends[1])};
                },
                true);
        if (ImGui::IsItemDeactivated()) session.document().endDrag();
        isDragged = isDragged || ImGui::IsItemActive();
        bool isLogarithmic = scene.function.isLogarithmic;
        ImGui::BeginDisabled(!(range[0] > 0) && !isLogarithmic);
        if (ImGui::Checkbox("logarithmic", &isLogarithmic))
            change(session, state, [&](Json& to) { at(to, "transfer_function")["log"] = isLogarithmic; });
        ImGui::EndDisabled();
        ImGui::SameLine();
    }
    if (ImGui::Button("as at first"))
        change(session, state, [&](Json& to) { to.erase("transfer_function"); });
    const Vec3d size = session.source()->boundsWorld().size();
    const double longest = std::max({size.x, size.y, size.z});
    isDragged =
        slider(
            session, state, "layer", session.document().json(), [](Json& json) -> Json& { return json; },
            "layer", longest / 1000, longest, longest / 20, true) ||
        isDragged;
    return isDragged;
}

bool drawBricks(ViewSession& session, PanelState& state) {
    const MeshSource& mesh = *session.mesh();
    const Json bricks = found(session.document().json(), "bricks");
    const auto in = [](Json& json) -> Json& { return at(json, "bricks"); };
    const Scene& scene = session.document().scene();
    bool isDragged = false;
    bool followsView = scene.bricks.pixelsAVoxel > 0;
    if (ImGui::Checkbox("as fine as the picture shows", &followsView)) toggleViewFocus(session);
    if (followsView) isDragged = slider(session, state, "pixels a voxel", bricks, in, "view", 1, 32, 4, true);
    int points = int(std::lround(std::log2(scene.bricks.resolution)));
    const std::string shown = fmt::format("{} points", scene.bricks.resolution);
    if (ImGui::SliderInt("finest", &points, 5, 12, shown.c_str()))
        change(
            session, state, [&](Json& to) { in(to)["resolution"] = 1 << points; }, true);
    if (ImGui::IsItemDeactivated()) session.document().endDrag();
    isDragged = isDragged || ImGui::IsItemActive();
    auto megabytes = float(1e-6 * double(scene.bricks.budgetBytes));
    if (ImGui::SliderFloat("budget", &megabytes, 50, 8000, "%.0f MB", ImGuiSliderFlags_Logarithmic))
        change(
            session, state, [&](Json& to) { in(to)["budget"] = 1e6 * std::round(double(megabytes)); }, true);
    if (ImGui::IsItemDeactivated()) session.document().endDrag();
    isDragged = isDragged || ImGui::IsItemActive();
    for (std::size_t i = 0; i < scene.bricks.focus.size(); ++i) {
        ImGui::PushID(int(i));
        const Vec3d size = mesh.boundsWorld().size();
        const double longest = std::max({size.x, size.y, size.z});
        isDragged = slider(
                        session, state, "radius", bricks["focus"][i],
                        [&](Json& json) -> Json& { return in(json)["focus"][i]; }, "radius", longest / 500,
                        longest / 2, longest / 16, true) ||
                    isDragged;
        ImGui::SameLine();
        if (ImGui::SmallButton("x"))
            change(session, state, [&](Json& to) {
                in(to)["focus"].erase(i);
                if (in(to)["focus"].empty()) in(to).erase("focus");
            });
        ImGui::PopID();
    }
    ImGui::TextDisabled("double-click in the picture: the focus");
    const ScheduleProgress progress = mesh.live().scheduler().progress();
    ImGui::Text("%.0f of %.0f MB, %zu bricks", 1e-6 * double(progress.bytes),
                1e-6 * double(progress.budgetBytes), progress.leavesShown);
    return isDragged;
}

bool drawQuality(ViewSession& session, PanelState& state) {
    const auto whole = [](Json& json) -> Json& { return json; };
    const Json& json = session.document().json();
    auto frame = float(session.frameMs());
    if (ImGui::SliderFloat("frame time", &frame, 10, 500, "%.0f ms", ImGuiSliderFlags_Logarithmic))
        session.setFrameMs(double(frame));
    bool isDragged = ImGui::IsItemActive();
    isDragged = slider(session, state, "slices a voxel", json, whole, "slices", 0.5, 8, 2) || isDragged;
    const int samples = session.document().scene().samplesAPixel;
    if (ImGui::BeginCombo("rays a pixel", std::to_string(samples).c_str())) {
        for (const int n : {1, 4, 9, 16})
            if (ImGui::Selectable(std::to_string(n).c_str(), n == samples))
                change(session, state, [&](Json& to) { to["samples"] = n; });
        ImGui::EndCombo();
    }
    const auto& ground = session.document().scene().ground;
    float colour[3] = {float(ground[0]), float(ground[1]), float(ground[2])};
    if (ImGui::ColorEdit3("background", colour))
        change(
            session, state,
            [&](Json& to) {
                to["background"] = Json::array();
                for (const float c : colour) to["background"].push_back(std::clamp(double(c), 0.0, 1.0));
            },
            true);
    if (ImGui::IsItemDeactivated()) session.document().endDrag();
    bool hasLegend = session.document().scene().hasLegend;
    if (ImGui::Checkbox("legend", &hasLegend))
        change(session, state, [&](Json& to) { to["legend"] = hasLegend; });
    return isDragged;
}

/// A number that an effect takes.
struct EffectNumber {
    const char* key;
    double low, high, otherwise;
};
/// What the panel offers of an effect.
struct EffectEntry {
    const char* name;
    const char* title;
    std::vector<EffectNumber> numbers;
};

const std::vector<EffectEntry>& effectEntries() {
    static const std::vector<EffectEntry> entries{
        {"preintegration", "pre-integrated slabs", {}},
        {"shading",
         "light by the slope",
         {{"ambient", 0, 1, 0.35},
          {"diffuse", 0, 1, 0.65},
          {"specular", 0, 1, 0.2},
          {"shininess", 1, 100, 30}}},
        {"isosurfaces", "isosurfaces", {}},
        {"cuts", "cut planes with contours", {}},
        {"probes", "probe: a ball cut out", {{"opacity", 0, 1, 1}}},
        {"occlusion", "ambient occlusion", {}},
        {"shadows", "shadows", {{"strength", 0, 1, 1}}},
        {"axes", "axes", {}},
        {"scale_bar", "scale bar", {}},
        {"outline", "edges of the mesh", {{"angle", 1, 179, 30}}},
        {"bricks", "edges of bricks", {{"width", 0.5, 5, 1.5}, {"opacity", 0, 1, 0.8}}},
        {"errors", "errors of bricks", {{"strength", 0, 1, 0.8}}},
    };
    return entries;
}

/// What an effect begins with.
Json firstOptions(const ViewSession& session, const std::string& name) {
    const ValueRange& range = session.source()->range();
    const Box3d& bounds = session.source()->boundsWorld();
    const Vec3d middle = 0.5 * (bounds.min + bounds.max), size = bounds.size();
    if (name == "isosurfaces")
        return {{"surfaces", Json::array({{{"value", 0.5 * (range.min + range.max)}}})}};
    if (name == "cuts")
        return {{"planes", Json::array({{{"normal", {0, 1, 0}}, {"offset", middle.y}}})},
                {"contours", Json::object()}};
    if (name == "probes") {
        const Vec3d at = session.viewCamera().eyeWorld;
        const double longest = std::max({size.x, size.y, size.z});
        // On the side from which it is seen.
        const Vec3d towards = glm::length(at - middle) > 0 ? glm::normalize(at - middle) : Vec3d(0, 0, 1);
        const Vec3d center = glm::clamp(middle + 0.25 * longest * towards, bounds.min, bounds.max);
        return {
            {"shapes",
             Json::array(
                 {{{"sphere", {{"center", {center.x, center.y, center.z}}, {"radius", 0.25 * longest}}}}})}};
    }
    if (name == "shadows") return {{"light", {0.4, -0.6, 1}}};
    return Json::object();
}

/// How far a plane of a normal may be moved through the data.
std::array<double, 2> offsetsThrough(const Box3d& bounds, const Json& normal) {
    std::array<double, 2> range{};
    for (int a = 0; a < 3; ++a) {
        const auto n = normal[std::size_t(a)].get<double>();
        range[0] += std::min(n * bounds.min[a], n * bounds.max[a]);
        range[1] += std::max(n * bounds.min[a], n * bounds.max[a]);
    }
    return range;
}

/// Sliders of things in a list, which may be taken away and others added.
bool drawEffectParts(ViewSession& session, PanelState& state, const std::string& name, const Json& options) {
    const ValueRange& range = session.source()->range();
    const Box3d& bounds = session.source()->boundsWorld();
    bool isDragged = false;
    if (name == "isosurfaces") {
        for (std::size_t i = 0; i < options["surfaces"].size(); ++i) {
            ImGui::PushID(int(i));
            const auto in = [&](Json& json) -> Json& {
                return json["effects"]["isosurfaces"]["surfaces"][i];
            };
            isDragged = slider(session, state, "value", options["surfaces"][i], in, "value", range.min,
                               range.max, range.min) ||
                        isDragged;
            isDragged = slider(session, state, "opacity", options["surfaces"][i], in, "opacity", 0, 1, 1) ||
                        isDragged;
            ImGui::PopID();
        }
        if (options["surfaces"].size() < 16 && ImGui::SmallButton("one more"))
            change(session, state, [&](Json& to) {
                to["effects"]["isosurfaces"]["surfaces"].push_back(
                    {{"value", 0.5 * (range.min + range.max)}});
            });
    }
    if (name == "cuts") {
        for (std::size_t i = 0; i < options["planes"].size(); ++i) {
            ImGui::PushID(int(i));
            const auto in = [&](Json& json) -> Json& { return json["effects"]["cuts"]["planes"][i]; };
            const Json& plane = options["planes"][i];
            const std::array<double, 2> through = offsetsThrough(bounds, plane["normal"]);
            isDragged =
                slider(session, state, "offset", plane, in, "offset", through[0], through[1], through[0]) ||
                isDragged;
            isDragged = slider(session, state, "opacity", plane, in, "opacity", 0, 1, 1) || isDragged;
            ImGui::PopID();
        }
        bool hasContours = options.contains("contours");
        if (ImGui::Checkbox("contour lines", &hasContours))
            change(session, state, [&](Json& to) {
                Json& cuts = to["effects"]["cuts"];
                hasContours ? void(cuts["contours"] = Json::object()) : void(cuts.erase("contours"));
            });
    }
    if (name == "probes")
        for (std::size_t i = 0; i < options["shapes"].size(); ++i) {
            if (!options["shapes"][i].contains("sphere")) continue;
            ImGui::PushID(int(i));
            const Vec3d size = bounds.size();
            const double longest = std::max({size.x, size.y, size.z});
            isDragged =
                slider(
                    session, state, "radius", options["shapes"][i]["sphere"],
                    [&](Json& json) -> Json& { return json["effects"]["probes"]["shapes"][i]["sphere"]; },
                    "radius", longest / 100, longest, longest / 4) ||
                isDragged;
            ImGui::PopID();
        }
    return isDragged;
}

bool drawEffects(ViewSession& session, PanelState& state) {
    const Json effects = found(session.document().json(), "effects");
    bool isDragged = false;
    for (const EffectEntry& entry : effectEntries()) {
        // A file has no mesh of its own.
        if (std::string(entry.name) == "outline" && !session.mesh()) continue;
        if (std::string(entry.name) == "errors" && session.source()->brickErrors().empty()) continue;
        bool isOn = effects.contains(entry.name);
        ImGui::PushID(entry.name);
        if (ImGui::Checkbox(entry.title, &isOn)) toggleEffect(session, entry.name);
        if (isOn && effects.contains(entry.name)) {
            ImGui::Indent();
            const Json options = effects[entry.name];
            for (const EffectNumber& number : entry.numbers)
                isDragged = slider(
                                session, state, number.key, options,
                                [&](Json& json) -> Json& { return json["effects"][entry.name]; }, number.key,
                                number.low, number.high, number.otherwise) ||
                            isDragged;
            isDragged = drawEffectParts(session, state, entry.name, options) || isDragged;
            ImGui::Unindent();
        }
        ImGui::PopID();
    }
    return isDragged;
}

bool drawClips(ViewSession& session, PanelState& state) {
    const Json clip = found(session.document().json(), "clip");
    const Json planes = clip.contains("planes") ? clip["planes"] : Json::array();
    const Box3d& bounds = session.source()->boundsWorld();
    bool isDragged = false;
    for (std::size_t i = 0; i < planes.size(); ++i) {
        ImGui::PushID(int(i));
        const auto [low, high] = offsetsThrough(bounds, planes[i]["normal"]);
        isDragged =
            slider(
                session, state, "offset", planes[i],
                [&](Json& json) -> Json& { return json["clip"]["planes"][i]; }, "offset", low, high, low) ||
            isDragged;
        ImGui::SameLine();
        if (ImGui::SmallButton("x"))
            change(session, state, [&](Json& to) {
                to["clip"]["planes"].erase(i);
                if (to["clip"]["planes"].empty()) to["clip"].erase("planes");
                if (to["clip"].empty()) to.erase("clip");
            });
        ImGui::PopID();
    }
    const Vec3d middle = 0.5 * (bounds.min + bounds.max);
    for (int a = 0; a < 3; ++a) {
        if (a > 0) ImGui::SameLine();
        const std::string label = fmt::format("+ across {}", "xyz"[a]);
        if (planes.size() < 16 && ImGui::SmallButton(label.c_str()))
            change(session, state, [&](Json& to) {
                Json normal{0, 0, 0};
                normal[std::size_t(a)] = 1;
                if (!to.contains("clip")) to["clip"] = Json::object();
                to["clip"]["planes"].push_back({{"normal", normal}, {"offset", middle[a]}});
            });
    }
    return isDragged;
}

void drawFiles(ViewSession& session, PanelState& state) {
    ImGui::InputText("##scene", &state.scenePath);
    ImGui::SameLine();
    if (ImGui::Button("save scene")) saveScene(session, state);
    ImGui::InputText("##picture", &state.picturePath);
    ImGui::SameLine();
    if (ImGui::Button("save picture")) savePicture(session, state);
    const Json& json = session.document().json();
    ImGui::InputText("##bookmark", &state.newBookmark);
    ImGui::SameLine();
    if (ImGui::Button("bookmark")) addBookmark(session, state);
    const Json bookmarks = json.contains("bookmarks") ? json["bookmarks"] : Json::array();
    for (std::size_t i = 0; i < bookmarks.size(); ++i) {
        ImGui::PushID(int(i));
        if (ImGui::SmallButton("x"))
            change(session, state, [&](Json& to) {
                to["bookmarks"].erase(i);
                if (to["bookmarks"].empty()) to.erase("bookmarks");
            });
        ImGui::SameLine();
        if (ImGui::Selectable(bookmarks[i]["name"].get<std::string>().c_str()))
            change(session, state, [&](Json& to) { to["camera"] = bookmarks[i]["camera"]; });
        ImGui::PopID();
    }
}

}  // namespace

void tell(PanelState& state, const std::string& message) {
    if (!state.messages.empty() && state.messages.back() == message) return;
    state.messages.push_back(message);
    if (state.messages.size() > kMostMessages) state.messages.pop_front();
}

void saveScene(ViewSession& session, PanelState& state) {
    try {
        if (!state.savedScenes.contains(state.scenePath)) state.scenePath = freshName(state.scenePath);
        session.saveScene(state.scenePath);
        state.savedScenes.insert(state.scenePath);
        tell(state, state.scenePath + " is saved");
    } catch (const std::exception& error) {
        tell(state, error.what());
    }
}

void savePicture(ViewSession& session, PanelState& state) {
    try {
        const std::string path = freshName(state.picturePath);
        session.writePicture(path);
        tell(state, path + " is saved");
    } catch (const std::exception& error) {
        tell(state, error.what());
    }
}

void addBookmark(ViewSession& session, PanelState& state) {
    if (!session.source()) return;
    change(session, state, [&](Json& to) {
        const std::string name =
            state.newBookmark.empty()
                ? fmt::format("view {}", to.contains("bookmarks") ? to["bookmarks"].size() + 1 : 1)
                : state.newBookmark;
        to["bookmarks"].push_back({{"name", name}, {"camera", session.viewCamera().json()}});
    });
    state.newBookmark.clear();
}

void setFocus(ViewSession& session, const Vec3d& placeWorld) {
    Json json = session.document().json();
    Json focus{{"place", {placeWorld.x, placeWorld.y, placeWorld.z}}};
    Json& bricks = at(json, "bricks");
    if (bricks.contains("focus") && bricks["focus"][0].contains("radius"))
        focus["radius"] = bricks["focus"][0]["radius"];
    bricks["focus"] = Json::array({focus});
    session.document().change(std::move(json));
}

void toggleViewFocus(ViewSession& session) {
    Json json = session.document().json();
    Json& bricks = at(json, "bricks");
    if (bricks.contains("view"))
        bricks.erase("view");
    else
        bricks["view"] = 4;
    session.document().change(std::move(json));
    session.touch();
}

void showAll(ViewSession& session) {
    Json json = session.document().json();
    json.erase("camera");
    session.document().change(std::move(json));
    session.touch();
}

void toggleEffect(ViewSession& session, const std::string& name) {
    Json json = session.document().json();
    Json& effects = at(json, "effects");
    if (effects.contains(name))
        effects.erase(name);
    else
        effects[name] = firstOptions(session, name);
    if (effects.empty()) json.erase("effects");
    session.document().change(std::move(json));
    session.touch();
}

bool drawPanel(ViewSession& session, PanelState& state, float widthPixels, float heightPixels) {
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize({widthPixels, heightPixels});
    ImGui::Begin("Tessera", nullptr,
                 ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoBringToFrontOnFocus);
    ImGui::PushItemWidth(widthPixels * 0.58f);
    bool isDragged = false;
    SceneDocument& document = session.document();
    ImGui::BeginDisabled(!document.canUndo());
    if (ImGui::Button("undo")) document.undo();
    ImGui::EndDisabled();
    ImGui::SameLine();
    ImGui::BeginDisabled(!document.canRedo());
    if (ImGui::Button("redo")) document.redo();
    ImGui::EndDisabled();
    ImGui::SameLine();
    if (ImGui::Button("all in view")) showAll(session);
    ImGui::SameLine();
    if (ImGui::Button("help")) state.showsHelp = !state.showsHelp;
    const auto part = [&](const char* title, bool isOpenAtFirst, const auto& draw) {
        if (ImGui::CollapsingHeader(title, isOpenAtFirst ? ImGuiTreeNodeFlags_DefaultOpen : 0)) draw();
    };
    if (session.source()) {
        part("Data", true, [&] { isDragged = drawData(session, state) || isDragged; });
        part("Transfer function", true, [&] { isDragged = drawFunction(session, state) || isDragged; });
        if (session.mesh())
            part("Bricks", true, [&] { isDragged = drawBricks(session, state) || isDragged; });
        part("Effects", false, [&] { isDragged = drawEffects(session, state) || isDragged; });
        part("Clips", false, [&] { isDragged = drawClips(session, state) || isDragged; });
        part("Quality", false, [&] { isDragged = drawQuality(session, state) || isDragged; });
        part("Save", true, [&] { drawFiles(session, state); });
    }
    ImGui::PopItemWidth();
    ImGui::End();
    if (isDragged) session.touch();
    return isDragged;
}

void drawStatus(const ViewSession& session, const PanelState& state, float left, float top, float width,
                float height) {
    ImGui::SetNextWindowPos({left, top});
    ImGui::SetNextWindowSize({width, height});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {8, 4});
    ImGui::Begin("status", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoInputs);
    std::string line = session.status();
    if (state.frameMs > 0) line += fmt::format("   {:.0f} ms a picture", state.frameMs);
    if (state.frameMs > 0 && state.frameScale < 1)
        line += fmt::format(" at {:.0f} %", 100 * state.frameScale);
    if (!state.underCursor.empty()) line += "   " + state.underCursor;
    if (session.mesh() && !session.isRefined()) {
        const ScheduleProgress progress = session.mesh()->live().scheduler().progress();
        const double share = progress.leavesPlanned > 0
                                 ? double(progress.leavesShown) /
                                       double(std::max(progress.leavesPlanned, progress.leavesShown))
                                 : 0;
        ImGui::ProgressBar(float(share), {120 * ImGui::GetIO().FontGlobalScale, 0}, "");
        ImGui::SameLine();
    }
    ImGui::TextUnformatted(line.c_str());
    ImGui::End();
    ImGui::PopStyleVar();
}

void drawHelp(PanelState& state) {
    if (!state.showsHelp) return;
    ImGui::Begin("Help", &state.showsHelp, ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoCollapse);
    for (const auto& [keys, what] : {std::pair{"drag", "turn"},
                                     {"middle drag, Shift drag", "shift"},
                                     {"wheel, right drag", "nearer or further"},
                                     {"double-click", "the focus: finest bricks there"},
                                     {"W A S D, Q E", "fly"},
                                     {"arrows", "turn"},
                                     {"X Y Z", "along an axis; with Shift from the other side"},
                                     {"F", "all in view"},
                                     {"G, O", "edges of bricks, of the mesh"},
                                     {"C, P", "a cut plane, a ball cut out"},
                                     {"V", "bricks as fine as the picture shows"},
                                     {"B", "bookmark this view"},
                                     {"Ctrl Z, Ctrl Y", "undo, redo"},
                                     {"Ctrl S", "save the scene"},
                                     {"Ctrl P", "save the picture"},
                                     {"T", "light or dark"},
                                     {"Tab", "hide or show the panel"},
                                     {"H, F1", "this help"},
                                     {"Esc", "takes messages and help away"},
                                     {"Ctrl Q", "close"}}) {
        ImGui::TextUnformatted(keys);
        ImGui::SameLine(190 * ImGui::GetIO().FontGlobalScale);
        ImGui::TextUnformatted(what);
    }
    ImGui::TextDisabled("Drop a mesh, a .vdb file or a scene onto the window to open it.");
    ImGui::End();
}

}  // namespace tessera
