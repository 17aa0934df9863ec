#include "benchmark/xy_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "benchmark/page_numbers.h"
#include "files/html_text.h"

namespace tessera {

namespace {

constexpr double kMarkReach = 6;  // from the middle of a mark to its edge
constexpr double kLongestLabel = 196, kLongestNarrowLabel = 112;

/// The name of a curve beside its end.
struct EndLabel {
    const XySeries* series = nullptr;
    double x = 0, y = 0;  // the end
    std::string words;
};

class XyDrawing {
  public:
    XyDrawing(const XyPlot& plot, const PlotCanvas& canvas);
    Drawing draw();

  private:
    bool shows(const XyPoint& p) const { return x_.holds(p.x) && y_.holds(p.y); }
    std::vector<AxisTick> yTicks() const { return y_.ticks(canvas_.isNarrow ? 26 : 30); }
    double gapOfLabels() const { return canvas_.textSize + 2.5; }
    void drawAxes();
    void drawFront();
    void drawFrontNumbers();
    void drawLevel();
    void drawSeries(const XySeries& series);
    std::string labelIn(const XySeries& series, double pixels) const;
    std::vector<EndLabel> endsOf(bool isFaint) const;
    std::vector<EndLabel> labelsWithRoom() const;
    void drawLabels();

    const XyPlot& plot_;
    const PlotCanvas& canvas_;
    double top_, bottom_;
    PlotAxis y_;
    double left_, right_;
    PlotAxis x_;
    std::string svg_;
};

AxisSpec withValues(AxisSpec spec, const XyPlot& plot, bool isX) {
    for (const XySeries& series : plot.series)
        for (const XyPoint& p : series.points)
            if (const double value = isX ? p.x : p.y; spec.isLinear || value > 0) spec.range.include(value);
    if (!isX && plot.level) spec.range.include(*plot.level);
    return spec;
}

double gutterOf(const XyPlot& plot, const PlotCanvas& canvas) {
    double widest = 30;
    for (const XySeries& series : plot.series)
        if (!series.style.isFaint) widest = std::max(widest, widthOf(series.label, canvas.textSize));
    return std::min(widest, canvas.isNarrow ? kLongestNarrowLabel : kLongestLabel) + 22;
}

double widestOf(const std::vector<AxisTick>& ticks, double textSize) {
    double widest = 24;
    for (const AxisTick& tick : ticks) widest = std::max(widest, widthOf(tick.label, textSize));
    return widest;
}

double heightOf(const XyPlot& plot, const PlotCanvas& canvas) {
    const auto labels = std::count_if(plot.series.begin(), plot.series.end(),
                                      [](const XySeries& s) { return !s.style.isFaint; });
    return std::max(canvas.isNarrow ? 260.0 : 330.0, double(labels) * (canvas.textSize + 3));
}

XyDrawing::XyDrawing(const XyPlot& plot, const PlotCanvas& canvas)
    : plot_(plot),
      canvas_(canvas),
      top_(plot.title.empty() ? 26 : 46),
      bottom_(top_ + heightOf(plot, canvas)),
      y_(withValues(plot.y, plot, false), bottom_ - 4, top_ + 4),
      left_(widestOf(yTicks(), canvas.textSize) + 12),
      right_(canvas.width - gutterOf(plot, canvas)),
      x_(withValues(plot.x, plot, true), left_ + 6, right_ - 6) {}

void XyDrawing::drawAxes() {
    const double size = canvas_.textSize;
    if (!plot_.title.empty()) svg_ += svgText(0, size + 1, plot_.title, TextAnchor::start, "t");
    svg_ += svgText(0, top_ - 9, plot_.y.title, TextAnchor::start, "a");
    for (const AxisTick& tick : yTicks()) {
        svg_ += svgLine(left_, y_.at(tick.value), right_, y_.at(tick.value), "g");
        svg_ += svgText(left_ - 6, y_.at(tick.value) + size * 0.36, tick.label, TextAnchor::end, "a");
    }
    for (const AxisTick& tick : x_.ticksAcross(canvas_.isNarrow ? 40 : 54, size)) {
        svg_ += svgLine(x_.at(tick.value), top_, x_.at(tick.value), bottom_, "g");
        svg_ += svgText(x_.at(tick.value), bottom_ + size + 5, tick.label, TextAnchor::middle, "a");
    }
    svg_ +=
        fmt::format("<path class=\"x\" d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}\"/>\n", left_, top_, bottom_, right_);
    svg_ += svgText((left_ + right_) / 2, bottom_ + 2 * size + 11, plot_.x.title, TextAnchor::middle, "a");
}

void XyDrawing::drawFront() {
    std::string path;
    for (const auto& place : plot_.front)
        if (x_.holds(place[0]) && y_.holds(place[1]))
            path +=
                fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x_.at(place[0]), y_.at(place[1]));
    if (!path.empty()) svg_ += fmt::format("<path class=\"q\" d=\"{}\"/>\n", path);
}

void XyDrawing::drawFrontNumbers() {
    std::vector<std::array<double, 2>> taken;
    for (const XySeries& series : plot_.series) {
        for (const XyPoint& p : series.points) {
            if (p.frontNumber == 0 || !shows(p)) continue;
            const bool hasRoomBelow = y_.at(p.y) + 21 < bottom_ - 2;
            const double x = x_.at(p.x) + (hasRoomBelow ? 7 : 15), y = y_.at(p.y) + (hasRoomBelow ? 21 : 5);
            const bool isFree = std::none_of(taken.begin(), taken.end(), [&](const auto& other) {
                return std::abs(other[0] - x) < 17 && std::abs(other[1] - y) < 14;
            });
            if (!isFree) continue;
            taken.push_back({x, y});
            svg_ += svgText(x, y, std::to_string(p.frontNumber), TextAnchor::middle, "f");
        }
    }
}

void XyDrawing::drawLevel() {
    if (!plot_.level || !y_.holds(*plot_.level)) return;
    const double y = y_.at(*plot_.level);
    svg_ += svgLine(left_, y, right_, y, "r") + svgText(left_ + 6, y - 6, plot_.levelLabel);
}

void XyDrawing::drawSeries(const XySeries& series) {
    std::vector<XyPoint> points;
    std::copy_if(series.points.begin(), series.points.end(), std::back_inserter(points),
                 [&](const XyPoint& p) { return shows(p); });
    std::stable_sort(points.begin(), points.end(),
                     [&](const XyPoint& a, const XyPoint& b) { return x_.at(a.x) < x_.at(b.x); });
    std::string path, marks, fit;
    for (const XyPoint& p : points) {
        const double x = x_.at(p.x), y = y_.at(p.y);
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x, y);
        if (p.low > 0 && std::max(y_.at(p.low) - y, y - y_.at(p.high)) > (series.style.isFaint ? 2 : 4))
            marks += svgLine(x, y_.at(p.low), x, y_.at(p.high), "e");
        marks += svgMark(x, y, series.style, p.tip);
        if (p.frontNumber > 0)
            marks += fmt::format("<circle class=\"o\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"8.5\"/>\n", x, y);
    }
    for (const auto& place : series.fit)
        if (x_.holds(place[0]) && y_.holds(place[1]))
            fit += fmt::format("{}{:.1f} {:.1f}", fit.empty() ? "M" : "L", x_.at(place[0]), y_.at(place[1]));
    svg_ += fmt::format("<g class=\"{}\">", colourClass(series.style));
    if (series.isJoined && points.size() > 1)
        svg_ += fmt::format("<path class=\"{}\" d=\"{}\"><title>{}</title></path>\n", lineClass(series.style),
                            path, inHtml(series.label));
    if (!fit.empty()) svg_ += fmt::format("<path class=\"z\" d=\"{}\"/>\n", fit);
    svg_ += marks + "</g>\n";
}

std::string XyDrawing::labelIn(const XySeries& series, double pixels) const {
    const bool fits = series.shortLabel.empty() || widthOf(series.label, canvas_.textSize) <= pixels;
    return fittedTo(fits ? series.label : series.shortLabel, pixels, canvas_.textSize);
}

std::vector<EndLabel> XyDrawing::endsOf(bool isFaint) const {
    std::vector<EndLabel> ends;
    for (const XySeries& series : plot_.series) {
        if (series.style.isFaint != isFaint) continue;
        EndLabel end{&series, -1, 0, {}};
        for (const XyPoint& p : series.points)
            if (shows(p) && x_.at(p.x) > end.x) end.x = x_.at(p.x), end.y = y_.at(p.y);
        if (end.x < 0) continue;
        end.words = labelIn(series, canvas_.width - right_ - 20);
        ends.push_back(std::move(end));
    }
    return ends;
}

/// Those of faint curves only where nothing needs to be moved for them.
std::vector<EndLabel> XyDrawing::labelsWithRoom() const {
    const auto byPlace = [](const EndLabel& a, const EndLabel& b) { return a.y < b.y; };
    std::vector<EndLabel> labels = endsOf(false);
    std::stable_sort(labels.begin(), labels.end(), byPlace);
    if (canvas_.isNarrow) return labels;
    std::vector<double> wanted;
    for (const EndLabel& label : labels) wanted.push_back(label.y);
    std::vector<double> taken = spreadApart(wanted, gapOfLabels(), top_ + 4, bottom_ - 2);
    for (EndLabel& faint : endsOf(true)) {
        const bool isFree = faint.x > right_ - 30 && std::none_of(taken.begin(), taken.end(), [&](double y) {
                                return std::abs(y - faint.y) < gapOfLabels() + 1;
                            });
        if (!isFree) continue;
        taken.push_back(faint.y);
        labels.push_back(std::move(faint));
    }
    std::stable_sort(labels.begin(), labels.end(), byPlace);
    return labels;
}

void XyDrawing::drawLabels() {
    const std::vector<EndLabel> labels = labelsWithRoom();
    std::vector<double> wanted;
    for (const EndLabel& label : labels) wanted.push_back(label.y);
    const std::vector<double> places = spreadApart(wanted, gapOfLabels(), top_ + 4, bottom_ - 2);
    const double x = right_ + 18;
    for (std::size_t i = 0; i < labels.size(); ++i) {
        const EndLabel& label = labels[i];
        svg_ += fmt::format("<g class=\"{}\">", colourClass(label.series->style));
        if (x - label.x > 24 || std::abs(places[i] - label.y) > 3)
            svg_ += fmt::format("<path class=\"d\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}H{:.1f}\"/>\n",
                                label.x + kMarkReach, label.y, right_ + 12, places[i], x - 2);
        svg_ +=
            svgText(x, places[i] + canvas_.textSize * 0.36, label.words, TextAnchor::start, "c") + "</g>\n";
    }
}

Drawing XyDrawing::draw() {
    svg_ = fmt::format("<g font-size=\"{}\">\n", canvas_.textSize);
    drawAxes();
    drawFront();
    drawLevel();
    for (const bool isFaint : {true, false})
        for (const XySeries& series : plot_.series)
            if (series.style.isFaint == isFaint) drawSeries(series);
    drawFrontNumbers();
    drawLabels();
    return {svg_ + "</g>\n", canvas_.width, bottom_ + 2 * canvas_.textSize + 16};
}

}  // namespace

Drawing drawXyPlot(const XyPlot& plot, const PlotCanvas& canvas) {
    return XyDrawing(plot, canvas).draw();
}

}  // namespace tessera
