#include "benchmark/dot_plot.h"

#include <fmt/format.h>

#include <algorithm>

#include "files/html_text.h"

namespace tessera {

namespace {

constexpr double kRowHeight = 24;
constexpr double kZeroLane = 46;
constexpr int kPartKinds = kBarKinds;

double labelColumn(const std::vector<std::string>& labels, const PlotCanvas& canvas) {
    double widest = 40;
    for (const std::string& label : labels) widest = std::max(widest, widthOf(label, canvas.textSize));
    return std::min(widest, canvas.isNarrow ? 128.0 : 200.0) + 12;
}

class DotDrawing {
  public:
    DotDrawing(const DotPlot& plot, const PlotCanvas& canvas);
    Drawing draw();

  private:
    double at(double value) const { return x_.holds(value) ? x_.at(value) : zero_; }
    double rowAt(std::size_t row) const { return top_ + kRowHeight * (double(row) + 0.5); }
    void drawKey();
    void drawAxis();
    void drawRow(const DotRow& row, double y);
    std::string besideMarks(const DotRow& row, double y) const;

    const DotPlot& plot_;
    const PlotCanvas& canvas_;
    bool hasZeroLane_;
    double left_, right_, zero_, keyTop_, top_, bottom_;
    PlotAxis x_;
    std::string svg_;
};

std::vector<std::string> rowLabels(const DotPlot& plot) {
    std::vector<std::string> labels;
    for (const DotRow& row : plot.rows)
        if (!row.isHeading) labels.push_back(row.label);
    return labels;
}

AxisSpec withMarks(AxisSpec spec, const DotPlot& plot) {
    for (const DotRow& row : plot.rows)
        for (const DotMark& mark : row.marks)
            for (const double value : {mark.value, mark.low, mark.high})
                if (spec.isLinear || value > 0) spec.range.include(value);
    if (plot.level) spec.range.include(*plot.level);
    return spec;
}

bool hasZeros(const DotPlot& plot) {
    if (plot.x.isLinear) return false;
    return std::any_of(plot.rows.begin(), plot.rows.end(), [](const DotRow& row) {
        return std::any_of(row.marks.begin(), row.marks.end(), [](const DotMark& m) { return m.value <= 0; });
    });
}

DotDrawing::DotDrawing(const DotPlot& plot, const PlotCanvas& canvas)
    : plot_(plot),
      canvas_(canvas),
      hasZeroLane_(hasZeros(plot)),
      left_(labelColumn(rowLabels(plot), canvas)),
      right_(canvas.width - 8),
      zero_(left_ + kZeroLane / 2),
      keyTop_(plot.title.empty() ? 4 : 26),
      top_(keyTop_ + (plot.key.empty() ? 0 : 24)),
      bottom_(top_ + kRowHeight * double(plot.rows.size())),
      x_(withMarks(plot.x, plot), left_ + (hasZeroLane_ ? kZeroLane : 0) + 8, right_ - 8) {}

void DotDrawing::drawKey() {
    double x = 8;
    for (const DotKey& key : plot_.key) {
        const PlotStyle style{kInkColour, key.shape, 0, key.isHollow, false};
        svg_ += fmt::format("<g class=\"{}\">{}</g>", colourClass(style), svgMark(x, keyTop_ + 9, style, ""));
        svg_ += svgText(x + 10, keyTop_ + 9 + canvas_.textSize * 0.36, key.words, TextAnchor::start, "a");
        x += 26 + widthOf(key.words, canvas_.textSize);
    }
}

void DotDrawing::drawAxis() {
    const double size = canvas_.textSize;
    for (const AxisTick& tick : x_.ticksAcross(canvas_.isNarrow ? 40 : 54, size)) {
        svg_ += svgLine(x_.at(tick.value), top_, x_.at(tick.value), bottom_, "g");
        svg_ += svgText(x_.at(tick.value), bottom_ + size + 4, tick.label, TextAnchor::middle, "a");
    }
    if (hasZeroLane_) {
        svg_ +=
            fmt::format("<rect class=\"p\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>\n",
                        left_, top_, kZeroLane - 4, bottom_ - top_);
        svg_ += svgText(zero_ - 2, bottom_ + size + 4, "none", TextAnchor::middle, "a");
    }
    if (plot_.level) svg_ += svgLine(x_.at(*plot_.level), top_, x_.at(*plot_.level), bottom_, "r");
    svg_ += svgLine(left_, bottom_, right_, bottom_, "x");
    svg_ += svgText(canvas_.isNarrow ? right_ : (left_ + right_) / 2, bottom_ + 2 * size + 9, plot_.x.title,
                    canvas_.isNarrow ? TextAnchor::end : TextAnchor::middle, "a");
}

std::string DotDrawing::besideMarks(const DotRow& row, double y) const {
    const double size = canvas_.textSize;
    if (row.marks.empty()) return svgText(left_ + 8, y + size * 0.36, row.note, TextAnchor::start, "f");
    double first = right_, last = left_;
    const DotMark *leftmost = nullptr, *rightmost = nullptr;
    for (const DotMark& mark : row.marks) {
        if (!leftmost || at(mark.value) < at(leftmost->value)) leftmost = &mark;
        if (!rightmost || at(mark.value) >= at(rightmost->value)) rightmost = &mark;
        first = std::min({first, at(mark.value), mark.low > 0 ? at(mark.low) : right_});
        last = std::max({last, at(mark.value), mark.high > 0 ? at(mark.high) : left_});
    }
    const auto withNote = [&](const std::string& words) {
        return row.note.empty() ? words : words + (words.empty() ? "" : ", ") + row.note;
    };
    const std::string after = withNote(rightmost->label), before = withNote(leftmost->label);
    if (!after.empty() && last + 10 + widthOf(after, size) < right_)
        return svgText(last + 10, y + size * 0.36, after, TextAnchor::start, "f");
    if (!before.empty() && first - 10 - widthOf(before, size) > left_)
        return svgText(first - 10, y + size * 0.36, before, TextAnchor::end, "f");
    return {};
}

void DotDrawing::drawRow(const DotRow& row, double y) {
    if (row.isHeading) {
        svg_ += svgText(0, y + canvas_.textSize * 0.36 + 2, row.label, TextAnchor::start, "t");
        return;
    }
    const std::string shown = fittedTo(row.label, left_ - 10, canvas_.textSize);
    svg_ += fmt::format("<g class=\"{}\">", colourClass(row.style));
    svg_ += svgText(0, y + canvas_.textSize * 0.36, shown, TextAnchor::start, "c");
    svg_ += svgLine(left_, y, right_, y, "g");
    double first = right_, last = left_;
    for (const DotMark& mark : row.marks)
        first = std::min(first, at(mark.value)), last = std::max(last, at(mark.value));
    if (row.marks.size() > 1) svg_ += svgLine(first, y, last, y, "d");
    for (const DotMark& mark : row.marks) {
        PlotStyle style = row.style;
        style.shape = mark.shape, style.isHollow = mark.isHollow, style.isFaint = false;
        if (mark.low > 0 && std::max(at(mark.value) - at(mark.low), at(mark.high) - at(mark.value)) > 4)
            svg_ += svgLine(at(mark.low), y, at(mark.high), y, "e");
        svg_ += svgMark(at(mark.value), y, style, mark.tip);
    }
    svg_ += besideMarks(row, y) + "</g>\n";
}

Drawing DotDrawing::draw() {
    svg_ = fmt::format("<g font-size=\"{}\">\n", canvas_.textSize);
    if (!plot_.title.empty()) svg_ += svgText(0, canvas_.textSize + 1, plot_.title, TextAnchor::start, "t");
    drawKey();
    drawAxis();
    for (std::size_t i = 0; i < plot_.rows.size(); ++i) drawRow(plot_.rows[i], rowAt(i));
    return {svg_ + "</g>\n", canvas_.width, bottom_ + 2 * canvas_.textSize + 16};
}

/// Names of the parts, on as many lines as they need. Returns where they end.
double drawBarKey(const BarPlot& plot, const PlotCanvas& canvas, double top, std::string& svg) {
    double x = 0, y = top;
    for (const auto& [kind, name] : plot.key) {
        const double width = 30 + widthOf(name, canvas.textSize);
        if (x > 0 && x + width > canvas.width) x = 0, y += 20;
        svg += fmt::format("<rect class=\"s{}\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"12\" height=\"12\"/>\n",
                           kind % kPartKinds, x, y);
        svg += svgText(x + 17, y + 11, name, TextAnchor::start, "a");
        x += width;
    }
    return plot.key.empty() ? top : y + 24;
}

std::string barOf(const BarRow& row, double left, double right, double y) {
    double whole = 0, before = 0;
    for (const BarPart& part : row.parts) whole += std::max(part.value, 0.0);
    std::string svg;
    for (const BarPart& part : row.parts) {
        if (whole <= 0 || part.value <= 0) continue;
        const double x0 = left + (right - left) * before / whole;
        before += part.value;
        const double x1 = left + (right - left) * before / whole;
        svg += fmt::format(
            "<rect class=\"b s{}\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" "
            "height=\"{:.1f}\"><title>{}</title></rect>\n",
            part.kind % kPartKinds, x0, y + 3, x1 - x0, kRowHeight - 6, inHtml(part.tip));
    }
    return svg;
}

}  // namespace

Drawing drawDotPlot(const DotPlot& plot, const PlotCanvas& canvas) {
    return DotDrawing(plot, canvas).draw();
}

Drawing drawBarPlot(const BarPlot& plot, const PlotCanvas& canvas) {
    const double size = canvas.textSize;
    std::vector<std::string> labels;
    double widestTotal = 30;
    for (const BarRow& row : plot.rows) {
        labels.push_back(row.label);
        widestTotal = std::max(widestTotal, widthOf(row.total, size));
    }
    const double left = labelColumn(labels, canvas), right = canvas.width - widestTotal - 10;
    std::string svg = fmt::format("<g font-size=\"{}\">\n", size);
    if (!plot.title.empty()) svg += svgText(0, size + 1, plot.title, TextAnchor::start, "t");
    double y = drawBarKey(plot, canvas, plot.title.empty() ? 4 : 28, svg);
    for (const BarRow& row : plot.rows) {
        const double middle = y + kRowHeight / 2 + size * 0.36;
        svg += fmt::format("<g class=\"{}\">{}</g>", colourClass(row.style),
                           svgText(0, middle, fittedTo(row.label, left - 10, size), TextAnchor::start, "c"));
        svg += barOf(row, left, right, y) + svgText(canvas.width, middle, row.total, TextAnchor::end);
        y += kRowHeight;
    }
    svg += svgLine(left, y, right, y, "x");
    for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0})
        if (!canvas.isNarrow || share != 0.25)
            if (!canvas.isNarrow || share != 0.75)
                svg += svgText(left + (right - left) * share, y + size + 4,
                               fmt::format("{:.0f}\u202f%", share * 100), TextAnchor::middle, "a");
    svg += svgText((left + right) / 2, y + 2 * size + 9, plot.xTitle, TextAnchor::middle, "a");
    return {svg + "</g>\n", canvas.width, y + 2 * size + 16};
}

}  // namespace tessera
