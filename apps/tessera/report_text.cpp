#include "report_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tessera {

namespace {

std::string place(const Vec3d& p) {
    return fmt::format("({:.9g}, {:.9g}, {:.9g})", p.x, p.y, p.z);
}

std::string percent(double share) {
    return fmt::format("{:.3g} %", share * 100);
}

std::string rangeText(const std::vector<ValueRange>& ranges) {
    std::string text;
    for (const ValueRange& range : ranges) {
        if (!text.empty()) text += "  ";
        text += range.empty() ? "no finite value" : fmt::format("{:.6g} .. {:.6g}", range.min, range.max);
    }
    return text;
}

void appendCount(std::string& text, std::int64_t count, const char* what) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", formatCount(count), what);
}

}  // namespace

std::string formatTable(const std::vector<std::vector<std::string>>& rows) {
    std::vector<std::size_t> widths;
    for (const auto& row : rows) {
        widths.resize(std::max(widths.size(), row.size()));
        for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
    }
    std::string text;
    for (const auto& row : rows) {
        std::string line;
        for (std::size_t c = 0; c < row.size(); ++c)
            line += c == 0 ? fmt::format("  {:<{}}", row[c], widths[c])
                           : fmt::format("  {:>{}}", row[c], widths[c]);
        line.erase(line.find_last_not_of(' ') + 1);
        text += line + "\n";
    }
    return text;
}

std::string withoutControls(std::string text) {
    for (char& c : text)
        if ((static_cast<unsigned char>(c) < 0x20 && c != '\n') || c == 0x7f) c = ' ';
    return text;
}

std::string singleLine(std::string text) {
    text = withoutControls(std::move(text));
    std::replace(text.begin(), text.end(), '\n', ' ');
    text.erase(text.find_last_not_of(' ') + 1);
    return text;
}

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

std::string importText(const std::string& path, const ImportStatistics& s, const Box3d& bounds) {
    std::string text = fmt::format("{}: {}, {} cells, {} elements, {} nodes\n", path, s.format,
                                   formatCount(s.cells), formatCount(s.elements), formatCount(s.nodes));
    text += fmt::format("  bounds {} to {}, edges {:.4g} to {:.4g}\n", place(bounds.min), place(bounds.max),
                        s.smallestEdgeWorld, s.largestEdgeWorld);
    std::string oddities;
    appendCount(oddities, s.skippedCells, "other cells skipped");
    appendCount(oddities, s.blankedCells, "blanked cells left out");
    appendCount(oddities, s.flat, "flat elements");
    appendCount(oddities, s.inverted, "inverted elements");
    appendCount(oddities, s.duplicate, "duplicate elements");
    appendCount(oddities, s.coincidentNodes, "coincident nodes");
    appendCount(oddities, s.nonConformingFaces, "non-conforming faces");
    if (!oddities.empty()) text += fmt::format("  {}\n", oddities);
    if (s.elements > 0 && s.flat == s.elements) text += "  nothing to sample: every element is flat\n";
    for (const std::string& warning : s.warnings) text += fmt::format("  warning: {}\n", warning);
    return text;
}

std::string fieldsText(const std::vector<FieldSummary>& fields) {
    std::vector<std::vector<std::string>> rows{{"field", "on", "components", "range"}};
    for (const FieldSummary& f : fields)
        rows.push_back({f.name, f.location == "point" ? "points" : "cells", std::to_string(f.ranges.size()),
                        rangeText(f.ranges)});
    return formatTable(rows);
}

std::string levelsText(const std::vector<LevelSummary>& levels) {
    std::vector<std::vector<std::string>> rows{{"level", "spacing", "bricks", "voxels", "in the mesh"}};
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
    return formatTable(rows);
}

std::string errorText(const ErrorReport& report) {
    std::vector<std::vector<std::string>> rows{
        {"error", "max", "of range", "99.9 %", "of range", "rms", "of range", "worst at"}};
    for (const FieldError& f : report.fields) {
        if (f.samples == 0) {
            rows.push_back({f.name, "-", "-", "-", "-", "-", "-", "-"});
            continue;
        }
        const bool constant = f.range == 0;
        const auto share = [&](double value) { return constant ? std::string("-") : percent(value); };
        rows.push_back({f.name, fmt::format("{:.4g}", f.max), share(f.relativeMax),
                        fmt::format("{:.4g}", f.p999), share(f.relativeP999), fmt::format("{:.4g}", f.rms),
                        share(f.relativeRms), place(f.worstPlaceWorld)});
    }
    std::string text = formatTable(rows);
    text += fmt::format(
        "  measured at {} nodes and {} centroids; {} of them in cells wholly inside the mesh\n",
        formatCount(report.nodes), formatCount(report.centroids), percent(report.fullyCoveredShare));
    for (const FieldError& f : report.fields) {
        if (f.skippedSamples > 0)
            text += fmt::format("  {}: {} samples without a finite value were left out\n", f.name,
                                formatCount(f.skippedSamples));
        if (f.validPoints < report.coveredPoints)
            text += fmt::format("  {}: {} voxels in the mesh have no finite value\n", f.name,
                                formatCount(report.coveredPoints - f.validPoints));
    }
    if (report.outsideBricks > 0)
        text += fmt::format("  {} samples lie outside the bounds and don't count\n",
                            formatCount(report.outsideBricks));
    return text;
}

std::string stagesText(const StageTimes& t) {
    std::string text = fmt::format("  read {:.0f} ms, plan {:.0f} ms, resample {:.0f} ms, verify {:.0f} ms",
                                   t.readMs, t.planMs, t.resampleMs, t.verifyMs);
    if (t.extendMs > 0) text += fmt::format(", extend {:.0f} ms", t.extendMs);
    return text + fmt::format(", write {:.0f} ms\n", t.writeMs);
}

std::string estimateText(const PlanEstimate& e, double levelsMs, double flatMs) {
    std::string text = formatTable({{"layout", "voxels", "bytes", "predicted time"},
                                    {"levels", formatCount(e.storedPoints), formatBytes(e.levelsBytes),
                                     fmt::format("{:.2g} s", levelsMs / 1000)},
                                    {"flat", formatCount(e.flatPoints), formatBytes(e.flatBytes),
                                     fmt::format("{:.2g} s", flatMs / 1000)}});
    std::string perLevel;
    for (std::size_t l = 0; l < e.bricksPerLevel.size(); ++l)
        perLevel += fmt::format("{}{} on level {}", l ? ", " : "", formatCount(e.bricksPerLevel[l]), l);
    return text + "  bricks: " + perLevel + "\n";
}

}  // namespace tessera
