#include "accuracy_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tessera::bench {

namespace {

constexpr double kWidth = 300, kHeight = 190;  // of a panel's axes
constexpr double kLeft = 48, kTop = 26, kBesides = 16, kBelow = 34;

/// Whole decades around some values.
struct Decades {
    int first = 1000, last = -1000;

    void include(double value) {
        first = std::min(first, int(std::floor(std::log10(value))));
        last = std::max(last, int(std::ceil(std::log10(value))));
    }
    double shareAt(double value) const { return (std::log10(value) - first) / (last - first); }
};

std::string number(double value) {
    return value >= 1e5 ? fmt::format("{:g} M", value / 1e6) : fmt::format("{:g}", value);
}

std::string text(double x, double y, const std::string& words, const std::string& more) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" {}>{}</text>\n", x, y, more, words);
}

std::string stroke(double x0, double y0, double x1, double y1, const std::string& more) {
    return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", x0, y0, x1, y1,
                       more);
}

std::string lineStyle(const AccuracyLine& line) {
    return fmt::format("fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"{}", line.colour,
                       line.isDashed ? " stroke-dasharray=\"4 3\"" : "");
}

std::string panelText(const AccuracyPanel& panel, double x, double y, const Decades& across,
                      const Decades& up) {
    std::string svg = text(x, y - 8, panel.title, "font-weight=\"bold\"");
    for (int decade = across.first; decade <= across.last; ++decade) {
        const double at = x + kWidth * across.shareAt(std::pow(10, decade));
        svg += stroke(at, y, at, y + kHeight, "stroke=\"#dddddd\"");
        svg += text(at, y + kHeight + 14, number(std::pow(10, decade)), "text-anchor=\"middle\"");
    }
    for (int decade = up.first; decade <= up.last; ++decade) {
        const double at = y + kHeight * (1 - up.shareAt(std::pow(10, decade)));
        svg += stroke(x, at, x + kWidth, at, "stroke=\"#dddddd\"");
        svg += text(x - 6, at + 4, number(std::pow(10, decade)), "text-anchor=\"end\"");
    }
    for (const AccuracyLine& line : panel.lines) {
        std::string places, marks;
        for (const auto& point : line.points) {
            const double px = x + kWidth * across.shareAt(point[0]);
            const double py = y + kHeight * (1 - up.shareAt(point[1]));
            places += fmt::format("{:.1f},{:.1f} ", px, py);
            marks += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.4\" fill=\"{}\"/>\n", px, py,
                                 line.colour);
        }
        svg += fmt::format("<polyline points=\"{}\" {}/>\n", places, lineStyle(line)) + marks;
    }
    return svg;
}

}  // namespace

std::string accuracyPlot(const std::vector<AccuracyPanel>& panels, const std::string& xTitle,
                         const std::string& yTitle) {
    Decades across, up;
    for (const AccuracyPanel& panel : panels)
        for (const AccuracyLine& line : panel.lines)
            for (const auto& point : line.points) across.include(point[0]), up.include(point[1]);
    const double stepX = kLeft + kWidth + kBesides, stepY = kTop + kHeight + kBelow;
    const double rows = std::ceil(double(panels.size()) / 2), width = 2 * stepX + 14,
                 height = rows * stepY + 24;
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
        "height=\"{1:.0f}\" font-family=\"sans-serif\" font-size=\"11\">\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        width, height);
    for (std::size_t i = 0; i < panels.size(); ++i) {
        const double x = 14 + kLeft + double(i % 2) * stepX, y = kTop + double(i / 2) * stepY;
        svg += panelText(panels[i], x, y, across, up);
        svg += text(x + kWidth / 2, y + kHeight + 28, xTitle, "text-anchor=\"middle\"");
        if (i % 2 == 0)
            svg +=
                text(0, 0, yTitle,
                     fmt::format("text-anchor=\"middle\" transform=\"translate({:.1f} {:.1f}) rotate(-90)\"",
                                 x - kLeft - 2, y + kHeight / 2));
    }
    double x = 14 + kLeft;
    if (!panels.empty())
        for (const AccuracyLine& line : panels.front().lines) {
            svg += stroke(x, height - 14, x + 24, height - 14, lineStyle(line));
            svg += text(x + 30, height - 10, line.label, "");
            x += 160;
        }
    return svg + "</svg>\n";
}

}  // namespace tessera::bench
