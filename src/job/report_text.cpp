#include "job/report_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "files/name_list.h"
#include "mesh/field_range.h"
#include "refine/plan.h"

namespace tessera {

namespace {

std::string place(const Vec3d& p) {
    return fmt::format("({:.9g}, {:.9g}, {:.9g})", p.x, p.y, p.z);
}

std::string percent(double share) {
    return fmt::format("{:.3g} %", share * 100);
}

std::string endText(const ValueRange& range, double value) {
    return range.empty() ? "no value" : fmt::format("{:.6g}", value);
}

void appendCount(std::string& text, std::int64_t count, const char* what) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", formatCount(count), what);
}

}  // namespace

std::string formatCount(std::int64_t count) {
    const std::string digits = std::to_string(count < 0 ? -count : count);
    std::string text(count < 0 ? 1 : 0, '-');
    for (std::size_t i = 0; i < digits.size(); ++i) {
        if (i > 0 && (digits.size() - i) % 3 == 0) text += ',';
        text += digits[i];
    }
    return text;
}

std::string formatBytes(std::int64_t bytes) {
    double value = double(bytes);
    int unit = 0;
    const char* const units[] = {"bytes", "kB", "MB", "GB", "TB"};
    while (value >= 999.5 && unit < 4) {
        value /= 1000;
        ++unit;
    }
    return unit == 0 ? fmt::format("{} bytes", bytes) : fmt::format("{:.3g} {}", value, units[unit]);
}

std::string cellsText(const ImportStatistics& s) {
    static constexpr const char* kNames[kCellKinds] = {"tetrahedra", "pyramids",    "wedges",
                                                       "hexahedra",  "voxel cells", "polyhedra"};
    const bool pureTets = s.cellsOfKind[std::size_t(CellKind::tet)] == s.cells;
    if (pureTets && s.higherOrderCells == 0) return {};
    std::string text;
    for (const CellKind kind : {CellKind::hex, CellKind::voxel, CellKind::wedge, CellKind::pyramid,
                                CellKind::polyhedron, CellKind::tet})
        appendCount(text, s.cellsOfKind[std::size_t(kind)], kNames[std::size_t(kind)]);
    if (s.higherOrderCells > 0)
        text += s.higherOrderCells == s.cells
                    ? ", of higher order and read by their corners"
                    : fmt::format(", {} of them of higher order and read by their corners",
                                  formatCount(s.higherOrderCells));
    if (!pureTets) text += fmt::format(", split into {} tetrahedra", formatCount(s.elements));
    return text + " (linear between corners; the cells' own interpolation can differ)";
}

std::string importText(const std::string& path, const ImportStatistics& s, const Box3d& bounds) {
    std::string text = fmt::format("{}: {}, {} cells, {} elements, {} nodes\n", path, s.format,
                                   formatCount(s.cells), formatCount(s.elements), formatCount(s.nodes));
    if (const std::string cells = cellsText(s); !cells.empty()) text += fmt::format("  {}\n", cells);
    text += fmt::format("  bounds {} to {}\n  edges {:.4g} to {:.4g}\n", place(bounds.min), place(bounds.max),
                        s.smallestEdgeWorld, s.largestEdgeWorld);
    std::string oddities;
    appendCount(oddities, s.skippedCells, "other cells skipped");
    appendCount(oddities, s.blankedCells, "blanked cells left out");
    appendCount(oddities, s.flat, "flat elements");
    appendCount(oddities, s.duplicate, "duplicate elements");
    appendCount(oddities, s.coincidentNodes, "coincident nodes");
    appendCount(oddities, s.nonConformingFaces, "non-conforming faces");
    if (!oddities.empty()) text += fmt::format("  {}\n", oddities);
    if (s.inverted > 0)
        text += fmt::format("  {} elements have the other orientation, which changes nothing\n",
                            formatCount(s.inverted));
    if (s.elements > 0 && s.flat == s.elements) text += "  nothing to sample: every element is flat\n";
    for (const std::string& note : s.notes) text += fmt::format("  {}\n", note);
    for (const std::string& warning : s.warnings) text += fmt::format("  warning: {}\n", warning);
    return text;
}

std::string fieldsText(const std::vector<FieldSummary>& fields, std::size_t width) {
    // A line a component: nine ranges are wider than any terminal.
    TableRows rows{{"field", "on", "components", "from", "to"}};
    for (const FieldSummary& f : fields) {
        const std::string on = f.location == "point" ? "points" : "cells";
        for (std::size_t c = 0; c < f.ranges.size(); ++c)
            rows.push_back({c == 0 ? f.name : "", c == 0 ? on : "",
                            c == 0 ? std::to_string(f.ranges.size()) : "",
                            endText(f.ranges[c], f.ranges[c].min), endText(f.ranges[c], f.ranges[c].max)});
    }
    return formatTable(rows, width);
}

std::string levelsText(const std::vector<LevelSummary>& levels, std::size_t width) {
    TableRows rows{{"level", "spacing", "bricks", "voxels", "in the mesh"}};
    LevelSummary all;
    for (const LevelSummary& l : levels) {
        rows.push_back({std::to_string(l.level), fmt::format("{:.6g}", l.spacingWorld), formatCount(l.bricks),
                        formatCount(l.storedPoints), formatCount(l.coveredPoints)});
        all.bricks += l.bricks;
        all.storedPoints += l.storedPoints;
        all.coveredPoints += l.coveredPoints;
    }
    rows.push_back(
        {"all", "", formatCount(all.bricks), formatCount(all.storedPoints), formatCount(all.coveredPoints)});
    return formatTable(rows, width);
}

/// "a 12, b 7" of the fields that have such a count.
template <class Count>
std::string countsByField(const ErrorReport& report, const Count& countOf) {
    std::vector<std::string> counts;
    for (const FieldError& f : report.fields)
        if (const std::int64_t count = countOf(f); count > 0)
            counts.push_back(fmt::format("{} {}", f.name, formatCount(count)));
    return nameList(counts);
}

std::string errorText(const ErrorReport& report, std::size_t width) {
    if (report.nodes + report.centroids == 0)
        return "  no node or centroid lies inside the bounds, so no error was measured\n";
    const char* const share = "of range";
    TableRows rows{{"error", "max", share, "99.9 %", share, "rms", share}},
        places{{"largest error of", "at"}};
    std::vector<std::string> without;
    for (const FieldError& f : report.fields) {
        if (f.samples == 0) {
            without.push_back(f.name);
            continue;
        }
        const auto ofRange = [&](double value) { return f.range == 0 ? std::string("-") : percent(value); };
        rows.push_back({f.name, fmt::format("{:.4g}", f.max), ofRange(f.relativeMax),
                        fmt::format("{:.4g}", f.p999), ofRange(f.relativeP999), fmt::format("{:.4g}", f.rms),
                        ofRange(f.relativeRms)});
        places.push_back({f.name, place(f.worstPlaceWorld)});
    }
    std::string text;
    if (rows.size() > 1) text += formatTable(rows, width, {.glued = share}) + formatTable(places, width);
    if (!without.empty())
        text += fmt::format("  without a finite value, so without an error: {}\n", nameList(without));
    text += fmt::format(
        "  measured at {} nodes and {} centroids; {} of them in cells wholly inside the mesh\n",
        formatCount(report.nodes), formatCount(report.centroids), percent(report.fullyCoveredShare));
    const std::string skipped = countsByField(report, [&](const FieldError& f) {
        return f.samples > 0 ? std::max<std::int64_t>(0, f.skippedSamples - report.incomplete) : 0;
    });
    if (!skipped.empty()) text += fmt::format("  left out, without a finite value: samples of {}\n", skipped);
    const std::string invalid = countsByField(report, [&](const FieldError& f) {
        return f.samples > 0 ? report.coveredPoints - f.validPoints : 0;
    });
    if (!invalid.empty()) text += fmt::format("  voxels in the mesh without a finite value: {}\n", invalid);
    if (report.incomplete > 0)
        text += fmt::format("  {} samples lie beside voxels that aren't there, where no error was measured\n",
                            formatCount(report.incomplete));
    if (report.outsideBricks > 0)
        text += fmt::format("  {} samples lie outside the bounds and don't count\n",
                            formatCount(report.outsideBricks));
    return text;
}

std::string stagesText(const StageTimes& t) {
    std::string text = fmt::format("  read {:.0f} ms, plan {:.0f} ms, resample {:.0f} ms, verify {:.0f} ms",
                                   t.readMs, t.planMs, t.resampleMs, t.verifyMs);
    if (t.extendMs >= 0.5) text += fmt::format(", extend {:.0f} ms", t.extendMs);
    return text + fmt::format(", write {:.0f} ms\n", t.writeMs);
}

std::string estimateText(const PlanEstimate& e, const CostPrediction& cost, std::size_t width) {
    std::string text = formatTable({{"layout", "voxels", "bytes", "predicted time"},
                                    {"levels", formatCount(e.storedPoints), formatBytes(e.levelsBytes),
                                     fmt::format("{:.2g} s", cost.levelsMs / 1000)},
                                    {"flat", formatCount(e.flatPoints), formatBytes(e.flatBytes),
                                     fmt::format("{:.2g} s", cost.flatMs / 1000)}},
                                   width);
    std::string perLevel;
    for (std::size_t l = 0; l < e.bricksPerLevel.size(); ++l)
        perLevel += fmt::format("{}{} on level {}", l ? ", " : "", formatCount(e.bricksPerLevel[l]), l);
    return text + "  bricks: " + perLevel + "\n";
}

}  // namespace tessera
