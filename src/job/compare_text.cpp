#include "job/compare_text.h"

#include <fmt/format.h>

#include <algorithm>

#include "job/report_text.h"
#include "resample/statistic_names.h"

namespace tessera {

namespace {

using Rows = TableRows;

constexpr const char* kOfRange = "of range";  // stays with the figure before it

std::string number(double value) {
    return fmt::format("{:.3g}", value);
}

/// A difference over the field's range; the field may have none.
std::string share(double difference, double range) {
    return range > 0 ? fmt::format("{:.3g} %", difference / range * 100) : std::string("-");
}

std::string point(const Vec3i& p) {
    return fmt::format("({}, {}, {})", p.x, p.y, p.z);
}

std::string checksText(const CompareReport& report, std::size_t width) {
    Rows rows{{"algorithm", "target", "format", "covered", "holes", "spills", "wrong values", "undecided",
               "of allowed"}};
    for (const ContestantReport& c : report.contestants)
        rows.push_back({c.label, c.target, std::string(nameOf(c.format)), formatCount(c.check.covered),
                        formatCount(c.check.holes), formatCount(c.check.spills),
                        formatCount(c.check.wrongValues), formatCount(c.check.undecided),
                        fmt::format("{:.3f}", c.check.largestShare)});
    return formatTable(rows, width);
}

std::string coverageText(const CompareReport& report, std::size_t width) {
    const std::string& first = report.contestants[0].label;
    Rows rows{{"coverage", "both", "only " + first, "only this", "at the boundary", "away from it"}};
    for (std::size_t p = 0; p < report.pairs.size(); ++p) {
        const PairReport& pair = report.pairs[p];
        rows.push_back({report.contestants[p + 1].label, formatCount(pair.coveredByBoth),
                        formatCount(pair.onlyFirst), formatCount(pair.onlySecond),
                        formatCount(pair.nearBoundary), formatCount(pair.awayFromBoundary)});
    }
    return formatTable(rows, width);
}

std::string differencesText(const CompareReport& report, std::size_t width) {
    Rows rows{{"difference", "field", "on", "max", kOfRange, "99.9 %", kOfRange, "rms", kOfRange,
               "max in thick elements", kOfRange}};
    std::string places;
    for (std::size_t p = 0; p < report.pairs.size(); ++p)
        for (const ValueDifference& d : report.pairs[p].fields) {
            const std::string& label = report.contestants[p + 1].label;
            rows.push_back({label, d.name, d.location == FieldLocation::cell ? "cells" : "points",
                            number(d.max), share(d.max, d.range), number(d.p999), share(d.p999, d.range),
                            number(d.rms), share(d.rms, d.range), number(d.maxInThickElements),
                            share(d.maxInThickElements, d.range)});
            if (d.points > 0 && d.max > 0) {
                places +=
                    fmt::format("  {}, {}: largest at {}{}\n    world ({:.9g}, {:.9g}, {:.9g})\n", label,
                                d.name, point(d.worst),
                                d.worstElement < 0 ? std::string()
                                                   : fmt::format(", element {}, {:.3g} voxel thick",
                                                                 d.worstElement, d.worstThicknessVoxels),
                                d.worstWorld.x, d.worstWorld.y, d.worstWorld.z);
            }
            if (d.validityDiffers > 0)
                places += fmt::format("  {}, {}: at {} points only one of the two is finite\n", label, d.name,
                                      formatCount(d.validityDiffers));
        }
    return formatTable(rows, width, {.keys = 3, .glued = kOfRange}) + places;
}

std::string timesText(const CompareReport& report, std::size_t width) {
    Rows rows{{"milliseconds", "total", "speed-up", "bind", "active list", "generate", "upload", "render",
               "read back"}};
    const double first = report.contestants[0].times.totalMs;
    const auto ms = [](double value) { return fmt::format("{:.1f}", value); };
    for (const ContestantReport& c : report.contestants) {
        const ResampleStatistics& s = c.times.statistics;
        const bool staged = s.count(counted::elementSlicePairs) > 0;
        const auto stage = [&](double value) { return staged ? ms(value) : std::string("-"); };
        rows.push_back({c.label, ms(c.times.totalMs), fmt::format("{:.2f}", first / c.times.totalMs),
                        ms(c.bindMs), ms(s.ms(stage::bin)), stage(s.ms(stage::generate)),
                        stage(s.ms(stage::upload)), stage(s.ms(stage::render)),
                        stage(s.ms(stage::readBack))});
    }
    return formatTable(rows, width);
}

std::string countsText(const CompareReport& report, std::size_t width) {
    Rows rows{{"counts", "element-slice pairs", "polygons", "a pair", "vertices", "fragments", "uploaded",
               "read back"}};
    for (const ContestantReport& c : report.contestants) {
        const ResampleStatistics& s = c.times.statistics;
        if (s.count(counted::elementSlicePairs) == 0) continue;
        rows.push_back({c.label, formatCount(s.count(counted::elementSlicePairs)),
                        formatCount(s.count(counted::polygons)),
                        fmt::format("{:.3f}", double(s.count(counted::polygons)) /
                                                  double(s.count(counted::elementSlicePairs))),
                        formatCount(s.count(counted::vertices)), formatCount(s.count(counted::fragments)),
                        formatBytes(s.count(counted::uploadBytes)),
                        formatBytes(s.count(counted::readBackBytes))});
    }
    return rows.size() > 1 ? formatTable(rows, width) : std::string();
}

/// The point field that differs most over its range.
const ValueDifference* worstField(const PairReport& pair) {
    const ValueDifference* worst = nullptr;
    for (const ValueDifference& d : pair.fields)
        if (d.range > 0 && d.location == FieldLocation::point &&
            (!worst || d.max / d.range > worst->max / worst->range))
            worst = &d;
    return worst;
}

Json indexJson(const Vec3i& p) {
    return {p.x, p.y, p.z};
}

Json contestantJson(const ContestantReport& c, double firstMs) {
    return {{"label", c.label},
            {"target", c.target},
            {"sample_format", nameOf(c.format)},
            {"meets_contract", c.meetsContract},
            {"spill_bound_voxels", c.spillVoxels},
            {"place_bound_voxels", c.placeVoxels},
            {"check",
             {{"covered", c.check.covered},
              {"holes", c.check.holes},
              {"spills", c.check.spills},
              {"wrong_values", c.check.wrongValues},
              {"undecided", c.check.undecided},
              {"largest_share_of_allowed", c.check.largestShare},
              {"first_problem", c.check.firstProblem}}},
            {"runs", c.times.runs},
            {"bind_ms", c.bindMs},
            {"total_ms", c.times.totalMs},
            {"speed_up", firstMs / c.times.totalMs},
            {"statistics", statisticsJson(c.times.statistics)}};
}

Json differenceJson(const ValueDifference& d) {
    const auto relative = [&](double value) { return d.range > 0 ? Json(value / d.range) : Json(nullptr); };
    return {{"field", d.name},
            {"location", d.location == FieldLocation::cell ? "cell" : "point"},
            {"range", d.range},
            {"points", d.points},
            {"only_one_finite", d.validityDiffers},
            {"max", d.max},
            {"p999", d.p999},
            {"rms", d.rms},
            {"relative_max", relative(d.max)},
            {"relative_p999", relative(d.p999)},
            {"relative_rms", relative(d.rms)},
            {"max_in_thick_elements", d.maxInThickElements},
            {"relative_max_in_thick_elements", relative(d.maxInThickElements)},
            {"points_near_thin_elements", d.thinPoints},
            {"worst",
             {{"index", indexJson(d.worst)},
              {"world", {d.worstWorld.x, d.worstWorld.y, d.worstWorld.z}},
              {"element", d.worstElement},
              {"thickness_voxels", d.worstThicknessVoxels}}}};
}

}  // namespace

std::string formatGrid(const Vec3i& points) {
    return fmt::format("{} x {} x {}", points.x, points.y, points.z);
}

std::vector<std::string> disagreements(const CompareReport& report) {
    std::vector<std::string> sentences;
    for (const ContestantReport& c : report.contestants)
        if (!c.check.isGood())
            sentences.push_back(fmt::format("{} has {} holes, {} spills and {} points with wrong values: {}",
                                            c.label, formatCount(c.check.holes), formatCount(c.check.spills),
                                            formatCount(c.check.wrongValues), c.check.firstProblem));
    for (std::size_t p = 0; p < report.pairs.size(); ++p)
        if (report.pairs[p].awayFromBoundary > 0)
            sentences.push_back(fmt::format(
                "{} and {} cover different points away from the boundary: {} of them, the first {}",
                report.contestants[0].label, report.contestants[p + 1].label,
                formatCount(report.pairs[p].awayFromBoundary), point(report.pairs[p].firstAway)));
    return sentences;
}

std::string compareText(const CompareReport& report, std::size_t width) {
    std::string text = fmt::format("  lattice of {} points, spacing {:.6g}, sampled in {} {}\n",
                                   formatGrid(report.grid.points.size()), report.grid.lattice.uWorld.x,
                                   report.boxes, report.boxes == 1 ? "box" : "boxes");
    text += checksText(report, width) + "\n";
    if (!report.pairs.empty())
        text += coverageText(report, width) + "\n" + differencesText(report, width) + "\n";
    text += timesText(report, width);
    const std::string counts = countsText(report, width);
    return counts.empty() ? text : text + "\n" + counts;
}

std::string markdownHead() {
    return "| mesh, lattice | algorithm | covered | only one covers: at the boundary, away | holes, spills, "
           "wrong "
           "values | largest difference of range, in an element of thickness | in thick elements | 99.9 % | "
           "rms | "
           "ms |\n|---|---|--:|--:|--:|--:|--:|--:|--:|--:|\n";
}

std::string markdownRows(const std::string& mesh, const CompareReport& report) {
    std::string text;
    for (std::size_t c = 0; c < report.contestants.size(); ++c) {
        const ContestantReport& contestant = report.contestants[c];
        const PointCheck& check = contestant.check;
        std::string coverage = "-", largest = "-", thick = "-", p999 = "-", rms = "-";
        if (c > 0) {
            const PairReport& pair = report.pairs[c - 1];
            coverage =
                fmt::format("{}, {}", formatCount(pair.nearBoundary), formatCount(pair.awayFromBoundary));
            if (const ValueDifference* d = worstField(pair)) {
                largest =
                    fmt::format("{} ({}), {:.2g}", share(d->max, d->range), d->name, d->worstThicknessVoxels);
                thick = share(d->maxInThickElements, d->range);
                p999 = share(d->p999, d->range);
                rms = share(d->rms, d->range);
            }
        }
        text += fmt::format("| {} | {} | {} | {} | {}, {}, {} | {} | {} | {} | {} | {:.0f} |\n",
                            c == 0 ? mesh + ", " + formatGrid(report.grid.points.size()) : std::string(),
                            contestant.label, formatCount(check.covered), coverage, formatCount(check.holes),
                            formatCount(check.spills), formatCount(check.wrongValues), largest, thick, p999,
                            rms, contestant.times.totalMs);
    }
    return text;
}

Json compareJson(const CompareReport& report) {
    Json json{{"lattice",
               {{"points", indexJson(report.grid.points.size())},
                {"spacing", report.grid.lattice.uWorld.x},
                {"boxes", report.boxes}}},
              {"agrees", report.agrees()},
              {"algorithms", Json::array()},
              {"against_first", Json::array()}};
    const double first = report.contestants[0].times.totalMs;
    for (const ContestantReport& c : report.contestants)
        json["algorithms"].push_back(contestantJson(c, first));
    for (std::size_t p = 0; p < report.pairs.size(); ++p) {
        const PairReport& pair = report.pairs[p];
        Json fields = Json::array();
        for (const ValueDifference& d : pair.fields) fields.push_back(differenceJson(d));
        json["against_first"].push_back({{"label", report.contestants[p + 1].label},
                                         {"covered_by_both", pair.coveredByBoth},
                                         {"only_first", pair.onlyFirst},
                                         {"only_this", pair.onlySecond},
                                         {"near_boundary", pair.nearBoundary},
                                         {"away_from_boundary", pair.awayFromBoundary},
                                         {"fields", std::move(fields)}});
    }
    return json;
}

}  // namespace tessera
