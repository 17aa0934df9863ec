#include "job/focus_trace_html.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string_view>

#include "files/html_text.h"
#include "job/focus_trace_text.h"
#include "job/report_text.h"

namespace tessera {

namespace {

constexpr const char* kStyle = R"(
body { margin: 2rem auto; padding: 0 1rem; max-width: 78rem; background: #fff; color: #222;
  font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.5rem; margin-bottom: .5rem; overflow-wrap: anywhere; }
p { max-width: 50rem; overflow-wrap: anywhere; }
svg { display: block; width: 100%; height: auto; margin: 1rem 0; }
svg text { font: 13px system-ui, "Segoe UI", "DejaVu Sans", sans-serif; fill: #333; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .8rem; font-variant-numeric: tabular-nums; }
th, td { padding: .2rem .4rem; text-align: right; white-space: nowrap; border-bottom: 1px solid #ddd; }
th { vertical-align: bottom; background: #f4f4f4; font-weight: 600; }
tr.still td { color: #888; }
)";
constexpr const char* kBetterColour = "#d95f02";
constexpr const char* kRestColour = "#1f6fb2";
constexpr const char* kMemoryColour = "#2a7d4f";

constexpr double kPlotWidth = 900, kPlotLeft = 80, kPlotRight = 880;
constexpr int kMostTicks = 10;

/// 1, 2 or 5 times a power of ten, at least `least`.
double roundStep(double least) {
    const double power = std::pow(10, std::floor(std::log10(least)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (factor * power >= least * (1 - 1e-9)) return factor * power;
    return 10 * power;
}

/// A value a step; none where there is nothing to draw.
using StepValues = std::vector<std::optional<double>>;

/// One plot over the steps, as a part of an SVG picture.
class StepPlot {
  public:
    StepPlot(std::size_t steps, double top, double bottom) : steps_(steps), top_(top), bottom_(bottom) {}

    /// Values from 0 to the most there is.
    void useLinearScale(double most) {
        const double step = roundStep(std::max(most, 1e-9) / 5);
        high_ = step * std::max(1.0, std::ceil(most / step));
        for (double value = 0; value <= high_ * (1 + 1e-9); value += step)
            addValueTick(value, fmt::format("{:g}", value));
    }
    /// Powers of ten, with the smallest and the largest value between them.
    void useLogScale(double least, double most) {
        isLog_ = true;
        low_ = std::floor(std::log10(least) + 1e-9);
        high_ = std::max(low_ + 1, std::ceil(std::log10(most) - 1e-9));
        for (double power = low_; power <= high_; ++power)
            addValueTick(std::pow(10, power), fmt::format("{:g}", std::pow(10, power)));
    }
    void addAxes(std::string_view valueLabel);
    /// Points, and lines between those of neighbouring steps. @param radius of a point.
    void addSeries(const StepValues& values, const char* colour, std::string_view what,
                   std::string_view unit);
    void addLevel(double value, const char* colour, std::string_view what);
    void addStillMarks(const std::vector<FocusStep>& steps);
    const std::string& svg() const { return svg_; }

  private:
    double x(std::size_t step) const {
        return steps_ < 2
                   ? (kPlotLeft + kPlotRight) / 2
                   : kPlotLeft + 15 + (kPlotRight - kPlotLeft - 30) * double(step) / double(steps_ - 1);
    }
    double y(double value) const {
        const double scaled = isLog_ ? std::log10(std::max(value, 1e-30)) : value;
        const double share = std::clamp((scaled - low_) / (high_ - low_), 0.0, 1.0);
        return bottom_ - (bottom_ - top_) * share;
    }
    void addValueTick(double value, const std::string& label);

    std::size_t steps_;
    double top_, bottom_, low_ = 0, high_ = 1;
    bool isLog_ = false;
    std::string svg_;
};

void StepPlot::addValueTick(double value, const std::string& label) {
    svg_ += fmt::format(
        "<line x1='{}' x2='{}' y1='{:.1f}' y2='{:.1f}' stroke='#e4e4e4'/><text x='{}' y='{:.1f}' "
        "text-anchor='end'>{}</text>\n",
        kPlotLeft, kPlotRight, y(value), y(value), kPlotLeft - 8, y(value) + 4.5, label);
}

void StepPlot::addAxes(std::string_view valueLabel) {
    const double middle = (top_ + bottom_) / 2;
    svg_ += fmt::format(
        "<path d='M{0} {1}V{2}H{3}' fill='none' stroke='#888'/>\n"
        "<text x='18' y='{4}' text-anchor='middle' transform='rotate(-90 18 {4})'>{5}</text>\n"
        "<text x='{6}' y='{7}' text-anchor='middle'>step of the path</text>\n",
        kPlotLeft, top_, bottom_, kPlotRight, middle, valueLabel, (kPlotLeft + kPlotRight) / 2, bottom_ + 40);
    const auto between = std::size_t(std::max(1.0, roundStep(double(steps_) / kMostTicks)));
    for (std::size_t step = 0; step < steps_; ++step)
        if (step == 0 || (step + 1) % between == 0)
            svg_ += fmt::format("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{}</text>\n", x(step),
                                bottom_ + 19, step + 1);
}

void StepPlot::addSeries(const StepValues& values, const char* colour, std::string_view what,
                         std::string_view unit) {
    std::string path, points;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (!values[i]) continue;
        path += fmt::format("{}{:.1f} {:.1f}", i > 0 && values[i - 1] ? "L" : "M", x(i), y(*values[i]));
        points += fmt::format(
            "<circle cx='{:.1f}' cy='{:.1f}' r='{}'><title>step {}: {} {} {}</title></circle>\n", x(i),
            y(*values[i]), steps_ > 200 ? 1.5 : 3.5, i + 1, what, shortMilliseconds(*values[i]), unit);
    }
    if (path.empty()) return;
    svg_ += fmt::format(
        "<path d='{}' fill='none' stroke='{}' stroke-width='1.5' stroke-opacity='.5'/>\n"
        "<g fill='{}'>{}</g>\n",
        path, colour, colour, points);
}

void StepPlot::addLevel(double value, const char* colour, std::string_view what) {
    svg_ += fmt::format(
        "<line x1='{0}' x2='{1}' y1='{2:.1f}' y2='{2:.1f}' stroke='{3}' stroke-dasharray='6 4'/><text "
        "x='{5}' y='{4:.1f}'>{6}</text>\n",
        kPlotLeft, kPlotRight, y(value), colour, y(value) - 5, kPlotLeft + 8, what);
}

void StepPlot::addStillMarks(const std::vector<FocusStep>& steps) {
    for (std::size_t i = 0; i < steps.size(); ++i)
        if (!steps[i].moved)
            svg_ += fmt::format(
                "<path d='M{0:.1f} {1:.1f}l-4 8h8z' fill='#999'><title>step {2}: moved too "
                "little</title></path>\n",
                x(i), bottom_ - 10, i + 1);
}

std::string legendEntry(double x, double y, const char* mark, const char* colour, const char* text) {
    return fmt::format(
        "<g transform='translate({} {})'><path d='{}' fill='{}'/><text x='12' y='4.5'>{}</text></g>\n", x, y,
        mark, colour, text);
}

std::string timesPlot(const std::vector<FocusStep>& steps, double top, double bottom) {
    constexpr const char* kDot = "M-4 0a4 4 0 1 0 8 0a4 4 0 1 0-8 0";
    StepValues better, rest;
    double least = 1e30, most = 1e-3;
    for (const FocusStep& step : steps) {
        better.push_back(step.betterMs);
        rest.push_back(step.moved ? std::optional(step.restMs) : std::nullopt);
        for (const auto& value : {better.back(), rest.back()})
            if (value) least = std::min(least, *value), most = std::max(most, *value);
    }
    StepPlot plot(steps.size(), top, bottom);
    plot.useLogScale(std::clamp(least, 1e-3, most), most);
    plot.addAxes("time (milliseconds)");
    plot.addSeries(rest, kRestColour, "at rest after", "ms");
    plot.addSeries(better, kBetterColour, "better after", "ms");
    plot.addStillMarks(steps);
    std::string svg =
        legendEntry(kPlotLeft + 10, top - 16, kDot, kBetterColour, "first better brick at the focus");
    svg += legendEntry(kPlotLeft + 250, top - 16, kDot, kRestColour, "everything at rest");
    if (std::any_of(steps.begin(), steps.end(), [](const FocusStep& s) { return !s.moved; }))
        svg += legendEntry(kPlotLeft + 410, top - 16, "M0-4l-4 8h8z", "#999",
                           "moved too little to change anything");
    return svg + plot.svg();
}

std::string memoryPlot(const std::vector<FocusStep>& steps, std::int64_t budgetBytes, double top,
                       double bottom) {
    StepValues megabytes;
    double most = 0;
    for (const FocusStep& step : steps) {
        megabytes.push_back(double(step.bytes) / 1e6);
        most = std::max(most, *megabytes.back());
    }
    const double budget = double(budgetBytes) / 1e6;
    const bool showsBudget = budget < 1.5 * most;
    StepPlot plot(steps.size(), top, bottom);
    plot.useLinearScale(showsBudget ? std::max(budget, most) : most);
    plot.addAxes("bricks in memory (MB)");
    if (showsBudget) plot.addLevel(budget, "#b22", "budget");
    plot.addSeries(megabytes, kMemoryColour, "bricks take", "MB");
    return plot.svg();
}

struct PageColumn {
    const char* heading;
    std::string (*cell)(const FocusStep&);
};

std::string plainNumber(double value) {
    return fmt::format("{:.5g}", value);
}

constexpr const char* kNoCell = "&ndash;";

const PageColumn kPageColumns[] = {
    {"x", [](const FocusStep& s) { return plainNumber(s.placeWorld.x); }},
    {"y", [](const FocusStep& s) { return plainNumber(s.placeWorld.y); }},
    {"z", [](const FocusStep& s) { return plainNumber(s.placeWorld.z); }},
    {"first better<br>(ms)",
     [](const FocusStep& s) {
         return !s.moved ? "jitter" : s.betterMs ? shortMilliseconds(*s.betterMs) : kNoCell;
     }},
    {"at rest<br>(ms)", [](const FocusStep& s) { return shortMilliseconds(s.restMs); }},
    {"bricks<br>sampled", [](const FocusStep& s) { return formatCount(s.sampled); }},
    {"bricks<br>reused", [](const FocusStep& s) { return formatCount(s.reused); }},
    {"bricks<br>dropped", [](const FocusStep& s) { return formatCount(s.dropped); }},
    {"leaves", [](const FocusStep& s) { return formatCount(s.leaves); }},
    {"voxels", [](const FocusStep& s) { return formatCount(s.voxels); }},
    {"memory", [](const FocusStep& s) { return formatBytes(s.bytes); }},
    {"spacing<br>at the focus",
     [](const FocusStep& s) { return s.spacingWorld ? plainNumber(*s.spacingWorld) : kNoCell; }},
    {"largest<br>error",
     [](const FocusStep& s) {
         return s.error.nodes > 0 ? inHtml(shareAsPercent(s.error.relativeMax)) : kNoCell;
     }},
    {"RMS<br>error",
     [](const FocusStep& s) {
         return s.error.nodes > 0 ? inHtml(shareAsPercent(s.error.relativeRms)) : kNoCell;
     }},
    {"nodes<br>compared", [](const FocusStep& s) { return formatCount(s.error.nodes); }},
};

std::string pageTable(const std::vector<FocusStep>& steps) {
    std::string text = "<div class=\"scroll\"><table>\n<thead><tr><th>step</th>";
    for (const PageColumn& column : kPageColumns) text += fmt::format("<th>{}</th>", column.heading);
    text += "</tr></thead>\n<tbody>\n";
    for (std::size_t i = 0; i < steps.size(); ++i) {
        text += fmt::format("<tr{}><td>{}</td>", steps[i].moved ? "" : " class=\"still\"", i + 1);
        for (const PageColumn& column : kPageColumns)
            text += fmt::format("<td>{}</td>", column.cell(steps[i]));
        text += "</tr>\n";
    }
    return text + "</tbody></table></div>\n";
}

std::string notesOfPage(const FocusTrace& trace) {
    std::string text =
        "<p>First better: from the move until the brick that holds the focus is shown finer than before; in "
        "the first step, until one is shown at all. A dash: it didn't become finer, as where it is as fine "
        "as it gets already. At rest: until "
        "all bricks are as fine as wished for. Reused bricks come from memory, dropped ones have left it. "
        "Lengths are in the units of the mesh.";
    if (!trace.errorField.empty())
        text += fmt::format(
            " Errors are those of {} at the mesh's nodes within the radius, at rest, over the field's range; "
            "nodes at the mesh's surface, whose cell isn't wholly inside, are left out.",
            inHtml(trace.errorField));
    return text + "</p>\n";
}

}  // namespace

std::string focusTraceHtml(const FocusTraceRequest& request, const FocusTrace& trace, const Job& job) {
    constexpr double kTimesTop = 45, kTimesBottom = 300, kMemoryTop = 375, kMemoryBottom = 535, kHeight = 585;
    const std::string mesh = inHtml(std::filesystem::path(request.input).filename().string());
    std::string page = fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width\">\n<title>A moving focus in {0}</title>\n"
        "<style>{1}</style>\n</head>\n<body>\n<h1>A moving focus in {0}</h1>\n<p>Measured: a focus that "
        "moves along {2}.</p>\n"
        "<p>In short: {3}.</p>\n",
        mesh, kStyle, inHtml(focusTraceSetup(request, trace, job)), inHtml(focusSummaryText(trace.steps)));
    page += fmt::format(
        "<svg viewBox='0 0 {} {}' role='img' aria-label='Times and memory over the steps of the path'>\n"
        "{}{}</svg>\n",
        kPlotWidth, kHeight, timesPlot(trace.steps, kTimesTop, kTimesBottom),
        memoryPlot(trace.steps, request.budgetBytes, kMemoryTop, kMemoryBottom));
    page += notesOfPage(trace) + pageTable(trace.steps);
    return page + fmt::format("<p>tessera {}</p>\n</body>\n</html>\n", TESSERA_VERSION);
}

}  // namespace tessera
