#include "import_mesh.h"

#include <fmt/format.h>

#include <utility>

#include "base/timer.h"
#include "files/json_parse.h"
#include "mesh/field_range.h"
#include "report_text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr double kSilentVolumeChange = 1e-6;

double parseShare(const std::string& option, const std::string& text) {
    const bool isPercent = text.ends_with('%');
    const std::string digits = isPercent ? text.substr(0, text.size() - 1) : text;
    const double share = parseNumbers(option, digits, 1)[0] * (isPercent ? 0.01 : 1.0);
    if (!(share >= 0 && share <= 1))
        throw InputError(
            fmt::format("{}: expected a share from 0 to 1 or 0% to 100%, got '{}'", option, text));
    return share;
}

Json countsJson(const ClassCounts& counts) {
    Json json = Json::object();
    for (std::size_t c = 0; c < kElementClasses; ++c) json[nameOf(ElementClass(c))] = counts.of[c];
    return json;
}

template <class Counts>
Json reasonsJson(const Counts& counts) {
    Json json = Json::object();
    for (std::size_t r = 0; r < kRefusals; ++r) json[nameOf(Refusal(r))] = counts[r];
    return json;
}

const char* reasonText(Refusal refusal) {
    switch (refusal) {
        case Refusal::volume:
            return "removing them would change more of the volume than "
                   "--repair-max-volume-loss allows";
        case Refusal::boundary:
            return "the boundary would move too far";
        case Refusal::quality:
            return "elements around would become degenerate";
        case Refusal::inversion:
            return "elements around would turn inside out";
        case Refusal::conformity:
            return "faces would be left without a neighbour";
        case Refusal::shape:
            break;
    }
    return "no operation fits their shape";
}

std::string operationsText(const RepairReport& r) {
    std::string text =
        fmt::format("  {} edges collapsed, {} edges, {} pairs of edges and {} faces split and collapsed",
                    formatCount(r.collapses), formatCount(r.edgeSplits), formatCount(r.edgePairSplits),
                    formatCount(r.faceSplits));
    if (r.dropped > 0)
        text += fmt::format(", {} elements at the boundary taken away", formatCount(r.dropped));
    if (r.droppedFlat > 0) text += fmt::format(", {} flat elements taken away", formatCount(r.droppedFlat));
    if (r.inverted > 0) text += fmt::format(", {} inverted elements turned", formatCount(r.inverted));
    return text +
           fmt::format(
               "\n  elements {} to {}, nodes {} to {}; volume changed by {:.2g} of itself; the boundary "
               "moved by at most {:.2g}\n",
               formatCount(r.elementsBefore), formatCount(r.elementsAfter), formatCount(r.nodesBefore),
               formatCount(r.nodesAfter), r.relativeVolumeChange(), r.boundaryDeviationWorld);
}

std::string keptText(const RepairReport& r) {
    std::string text;
    for (std::size_t k = 0; k < kRefusals; ++k)
        if (r.kept[k] > 0)
            text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", formatCount(r.kept[k]),
                                reasonText(Refusal(k)));
    return text;
}

}  // namespace

std::optional<RepairOptions> repairOptions(const RepairArguments& a) {
    if (!a.repair) return std::nullopt;
    RepairOptions options;
    if (a.aspect) options.limits.minAspect = *a.aspect;
    if (a.angle) options.limits.maxDihedralDegrees = *a.angle;
    if (!a.maxVolumeLoss.empty())
        options.maxVolumeLoss = parseShare("--repair-max-volume-loss", a.maxVolumeLoss);
    return options;
}

ImportedMesh importMesh(const std::string& path, const ReadOptions& read,
                        const std::optional<RepairOptions>& options, Session& session) {
    ImportedMesh file{session.readMesh(path, read), std::nullopt, 0};
    if (!options) return file;
    Timer timer;
    file.mesh = repair(std::move(file.mesh), *options, file.repair.emplace(), session.execution);
    file.repairMs = timer.elapsedMs();
    if (file.mesh.tets.empty())
        throw InputError(fmt::format(
            "{}: --repair leaves nothing of {} elements, all of an aspect ratio below {:g}: a smaller "
            "--repair-aspect or --repair-max-volume-loss keeps those whose volume isn't zero",
            path, file.repair->elementsBefore, options->limits.minAspect));
    return file;
}

std::string classesText(const ClassCounts& counts, const ClassLimits& limits) {
    std::string text;
    for (std::size_t c = 1; c < kElementClasses; ++c)
        if (counts.of[c] > 0)
            text += fmt::format("{}{} {}", text.empty() ? "" : ", ", formatCount(counts.of[c]),
                                nameOf(ElementClass(c)));
    if (text.empty()) return "";
    return fmt::format("  degenerate elements, of an aspect ratio below {:g}: {}\n", limits.minAspect, text);
}

Json classesJson(const ClassCounts& counts, const ClassLimits& limits) {
    return {{"min_aspect", limits.minAspect},
            {"max_dihedral_degrees", limits.maxDihedralDegrees},
            {"counts", countsJson(counts)}};
}

void showRepair(const std::string& path, const ImportedMesh& mesh,
                const std::optional<RepairOptions>& options, Session& session) {
    if (!mesh.repair) return;
    const RepairReport& r = *mesh.repair;
    std::vector<std::vector<std::string>> rows{{"class", "before", "after"}};
    for (std::size_t c = 1; c < kElementClasses; ++c)
        rows.push_back({nameOf(ElementClass(c)), formatCount(r.before.of[c]), formatCount(r.after.of[c])});
    std::string text = fmt::format("  repair of elements of an aspect ratio below {:g}, {:.0f} ms\n",
                                   options->limits.minAspect, mesh.repairMs);
    text += r.changed() ? formatTable(rows) + operationsText(r) : "  nothing to repair\n";
    if (r.keptElements() > 0)
        text +=
            fmt::format("  {} degenerate elements stay ({})\n", formatCount(r.keptElements()), keptText(r));
    session.print(text);
    if (r.keptElements() > 0)
        session.warn(fmt::format("{}: {} degenerate elements stay, with {:.2g} of the volume ({})", path,
                                 formatCount(r.keptElements()),
                                 r.volumeAfterWorld > 0 ? r.keptVolumeWorld / r.volumeAfterWorld : 0,
                                 keptText(r)));
    if (r.relativeVolumeChange() > kSilentVolumeChange)
        session.warn(fmt::format("{}: the repair changed {:.2g} of the mesh's volume", path,
                                 r.relativeVolumeChange()));
}

Json repairJson(const ImportedMesh& mesh, const std::optional<RepairOptions>& options) {
    if (!mesh.repair) return nullptr;
    const RepairReport& r = *mesh.repair;
    Json ranges = Json::array();
    const auto rangeJson = [](const ValueRange& range) {
        return range.empty() ? Json(nullptr) : Json::array({range.min, range.max});
    };
    for (const RepairReport::FieldRange& range : r.ranges)
        ranges.push_back({{"field", range.field},
                          {"component", range.component},
                          {"before", rangeJson(range.before)},
                          {"after", rangeJson(range.after)}});
    return {{"options", Json::parse(encodeRepair(options))},
            {"changed", r.changed()},
            {"ms", mesh.repairMs},
            {"elements", {r.elementsBefore, r.elementsAfter}},
            {"nodes", {r.nodesBefore, r.nodesAfter}},
            {"before", countsJson(r.before)},
            {"after", countsJson(r.after)},
            {"inverted_turned", r.inverted},
            {"operations",
             {{"edge_collapses", r.collapses},
              {"edge_splits", r.edgeSplits},
              {"edge_pair_splits", r.edgePairSplits},
              {"face_splits", r.faceSplits},
              {"dropped", r.dropped},
              {"dropped_flat", r.droppedFlat},
              {"dropped_flat_unmatched", r.unmatchedFlat}}},
            {"refused", reasonsJson(r.refused)},
            {"kept", reasonsJson(r.kept)},
            {"kept_volume", r.keptVolumeWorld},
            {"volume", {r.volumeBeforeWorld, r.volumeAfterWorld}},
            {"volume_change", r.volumeChangeWorld},
            {"boundary_deviation", r.boundaryDeviationWorld},
            {"field_ranges", ranges}};
}

std::string encodeRepair(const std::optional<RepairOptions>& options) {
    if (!options) return {};
    return Json{{"min_aspect", options->limits.minAspect},
                {"max_dihedral_degrees", options->limits.maxDihedralDegrees},
                {"max_volume_loss", options->maxVolumeLoss}}
        .dump();
}

std::optional<RepairOptions> decodeRepair(const std::string& text) {
    if (text.empty()) return std::nullopt;
    RepairOptions options;
    try {
        const Json json = parseJson<Json>(text);
        json.at("min_aspect").get_to(options.limits.minAspect);
        json.at("max_dihedral_degrees").get_to(options.limits.maxDihedralDegrees);
        json.at("max_volume_loss").get_to(options.maxVolumeLoss);
    } catch (const Json::exception&) {
        throw InputError("damaged Tessera metadata: tessera_repair is '" + text + "'");
    }
    return options;
}

}  // namespace tessera
