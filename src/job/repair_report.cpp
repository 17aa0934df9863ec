#include "job/repair_report.h"

#include <fmt/format.h>

#include <vector>

#include "files/json_parse.h"
#include "job/report_text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr double kSilentVolumeChange = 1e-6;

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

void tellRepair(const std::string& path, const ImportedMesh& mesh, const Job& job) {
    if (!mesh.repairOptions) return;
    const RepairReport& r = mesh.repair;
    TableRows rows{{"class", "before", "after"}};
    for (std::size_t c = 1; c < kElementClasses; ++c)
        rows.push_back({nameOf(ElementClass(c)), formatCount(r.before.of[c]), formatCount(r.after.of[c])});
    std::string text = fmt::format("  repair of elements of an aspect ratio below {:g}, {:.0f} ms\n",
                                   mesh.repairOptions->limits.minAspect, mesh.repairMs);
    text += r.changed() ? formatTable(rows, job.textWidth) + operationsText(r) : "  nothing to repair\n";
    if (r.keptElements() > 0)
        text +=
            fmt::format("  {} degenerate elements stay ({})\n", formatCount(r.keptElements()), keptText(r));
    job.say(text);
    if (r.keptElements() > 0)
        job.warn(fmt::format("{}: {} degenerate elements stay, with {:.2g} of the volume ({})", path,
                             formatCount(r.keptElements()),
                             r.volumeAfterWorld > 0 ? r.keptVolumeWorld / r.volumeAfterWorld : 0,
                             keptText(r)));
    if (r.relativeVolumeChange() > kSilentVolumeChange)
        job.warn(fmt::format("{}: the repair changed {:.2g} of the mesh's volume", path,
                             r.relativeVolumeChange()));
}

void addRepair(Json& document, const ImportedMesh& mesh) {
    if (!mesh.repairOptions) return;
    const RepairReport& r = mesh.repair;
    Json ranges = Json::array();
    for (const RepairReport::FieldRange& range : r.ranges)
        ranges.push_back({{"field", range.field},
                          {"component", range.component},
                          {"before", rangeJson(range.before)},
                          {"after", rangeJson(range.after)}});
    document["repair"] = {{"options", Json::parse(encodeRepair(mesh.repairOptions))},
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
