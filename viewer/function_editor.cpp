#include "function_editor.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "scene/colour_maps.h"
#include "tessera/error.h"

namespace tessera {

namespace {

using Json = SceneDocument::Json;
using Points = std::vector<std::array<double, 2>>;

constexpr float kHeight = 120, kReach = 8;
/// Points of a function that the scene doesn't give.
constexpr int kFirstPoints = 17;

/// Shares of the range, with opacities.
Points pointsOf(const Scene& scene, const TransferFunction& function, const std::array<double, 2>& range) {
    if (scene.function.stops.empty() && !scene.function.opacities.empty()) return scene.function.opacities;
    Points points;
    const auto valueAt = [&](double share) {
        return scene.function.isLogarithmic && range[0] > 0 ? range[0] * std::pow(range[1] / range[0], share)
                                                            : range[0] + share * (range[1] - range[0]);
    };
    for (int i = 0; i < kFirstPoints; ++i) {
        const double share = double(i) / (kFirstPoints - 1);
        points.push_back({share, shownAt(function, valueAt(share))[3]});
    }
    return points;
}

void give(ViewSession& session, const Points& points) {
    Json json = session.document().json();
    Json list = Json::array();
    for (const auto& [share, opacity] : points) list.push_back({share, opacity});
    if (json.contains("transfer_function")) json["transfer_function"].erase("stops");
    json["transfer_function"]["opacity"] = std::move(list);
    session.document().drag(std::move(json));
    session.touch();
}

}  // namespace

bool editFunction(ViewSession& session) {
    const PictureSource& source = *session.source();
    const Scene& scene = session.document().scene();
    const std::array<double, 2> range = shownRangeOf(scene.function, source.range());
    const std::vector<double>& histogram = source.histogram(range);
    TransferFunction function;
    try {
        function = functionOf(scene.function, source.range(), histogram);
    } catch (const InputError& error) {  // such as a logarithmic scale from 0 on
        ImGui::TextWrapped("%s", error.what());
        return false;
    }
    const ImVec2 low = ImGui::GetCursorScreenPos();
    const float scale = ImGui::GetIO().FontGlobalScale;
    const ImVec2 size(ImGui::GetContentRegionAvail().x, kHeight * scale);
    ImGui::InvisibleButton("opacities", size,
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight);
    const bool isHovered = ImGui::IsItemHovered();
    ImDrawList& draw = *ImGui::GetWindowDrawList();
    draw.AddRectFilled(low, {low.x + size.x, low.y + size.y}, ImGui::GetColorU32(ImGuiCol_FrameBg), 3);
    // Logarithmic, as most of a mesh has few values.
    const double most = *std::max_element(histogram.begin(), histogram.end());
    for (std::size_t bin = 0; bin < histogram.size(); ++bin) {
        if (!(histogram[bin] > 0)) continue;
        const double high = std::max(0.0, 1 + std::log10(histogram[bin] / most) / 5);
        const float left = low.x + size.x * float(bin) / float(histogram.size());
        draw.AddRectFilled({left, low.y + size.y * float(1 - high)},
                           {left + size.x / float(histogram.size()), low.y + size.y},
                           ImGui::GetColorU32(ImGuiCol_TextDisabled, 0.5f));
    }
    Points points = pointsOf(scene, function, range);
    const auto at = [&](const std::array<double, 2>& p) {
        return ImVec2(low.x + size.x * float(p[0]), low.y + size.y * float(1 - p[1]));
    };
    const ImU32 line = ImGui::GetColorU32(ImGuiCol_PlotLinesHovered);
    draw.AddLine({low.x, at(points.front()).y}, at(points.front()), line, 2);
    draw.AddLine(at(points.back()), {low.x + size.x, at(points.back()).y}, line, 2);
    for (std::size_t i = 1; i < points.size(); ++i) draw.AddLine(at(points[i - 1]), at(points[i]), line, 2);
    for (const auto& point : points) draw.AddCircleFilled(at(point), 4 * scale, line);
    // The colours below.
    const float top = low.y + size.y + 3;
    constexpr int kColours = 64;
    for (int i = 0; i < kColours; ++i) {
        const double share = (i + 0.5) / kColours;
        const std::array<double, 3> c =
            scene.function.stops.empty() ? mappedColour(scene.function.map, share) : [&] {
                TransferFunction opaque = function;
                for (auto& stop : opaque.stops) stop.opacity = 1;
                const auto shown = shownAt(opaque, range[0] + share * (range[1] - range[0]));
                return std::array{shown[0], shown[1], shown[2]};
            }();
        draw.AddRectFilled({low.x + size.x * float(i) / kColours, top},
                           {low.x + size.x * float(i + 1) / kColours, top + 10},
                           ImGui::GetColorU32({float(c[0]), float(c[1]), float(c[2]), 1}));
    }
    ImGui::Dummy({size.x, 14});

    static int dragged = -1;
    const ImVec2 mouse = ImGui::GetIO().MousePos;
    const std::array<double, 2> here{std::clamp(double(mouse.x - low.x) / double(size.x), 0.0, 1.0),
                                     std::clamp(1 - double(mouse.y - low.y) / double(size.y), 0.0, 1.0)};
    const auto nearest = [&] {
        for (std::size_t i = 0; i < points.size(); ++i) {
            const ImVec2 p = at(points[i]);
            if (std::hypot(p.x - mouse.x, p.y - mouse.y) < kReach * scale) return int(i);
        }
        return -1;
    };
    if (isHovered && ImGui::IsMouseClicked(ImGuiMouseButton_Right) && points.size() > 1) {
        if (const int i = nearest(); i >= 0) {
            points.erase(points.begin() + i);
            give(session, points);
            session.document().endDrag();
        }
    }
    if (isHovered && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
        dragged = nearest();
        if (dragged < 0) {
            const auto after =
                std::find_if(points.begin(), points.end(), [&](const auto& p) { return p[0] > here[0]; });
            dragged = int(after - points.begin());
            points.insert(after, here);
            give(session, points);
        }
    }
    if (dragged >= 0 && !ImGui::IsMouseDown(ImGuiMouseButton_Left)) {
        dragged = -1;
        session.document().endDrag();
    }
    if (dragged >= 0 && std::size_t(dragged) < points.size()) {
        const auto i = std::size_t(dragged);
        // Points keep their order.
        const double least = i > 0 ? points[i - 1][0] : 0,
                     last = i + 1 < points.size() ? points[i + 1][0] : 1;
        const std::array<double, 2> moved{std::clamp(here[0], least, last), here[1]};
        if (moved != points[i]) {
            points[i] = moved;
            give(session, points);
        }
    }
    return dragged >= 0;
}

}  // namespace tessera
