#include "benchmark/plot_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "benchmark/page_numbers.h"
#include "files/html_text.h"

namespace tessera {

namespace {

/// A colour on white and one on black, which people who see few colours tell apart by their lightness (after
/// M. Okabe, K. Ito, Color Universal Design, 2008; darkened or lightened until words in them can be read).
struct ColourPair {
    const char *onWhite, *onDark;
};
constexpr ColourPair kColours[kPlotColours] = {
    {"#0067a8", "#5cb8f0"}, {"#c24a00", "#ff9142"}, {"#00805e", "#35cfa2"}, {"#a83d80", "#ea93c8"},
    {"#7d5f00", "#e8c832"}, {"#5548b8", "#b0a8ff"}, {"#1b1b1b", "#f4f4f4"}};
struct NamedColour {
    const char* name;
    ColourPair pair;
};
constexpr NamedColour kGrounds[] = {{"ground", {"#ffffff", "#15181c"}}, {"ink", {"#1f2328", "#e8e8e6"}},
                                    {"soft", {"#5a6169", "#a9aeb4"}},   {"grid", {"#e3e5e8", "#2e343b"}},
                                    {"faint", {"#8a9097", "#7f868e"}},  {"front", {"#f3d98b", "#5f5220"}},
                                    {"panel", {"#f5f6f8", "#1e2329"}}};
// Parts of bars: neighbours differ in lightness.
constexpr ColourPair kParts[] = {{"#0067a8", "#5cb8f0"}, {"#9fd0f2", "#2b5f86"}, {"#c24a00", "#ff9142"},
                                 {"#f4c39a", "#85491c"}, {"#00805e", "#35cfa2"}, {"#a5dcc8", "#1f6b54"},
                                 {"#a83d80", "#ea93c8"}, {"#edc4de", "#6e3558"}, {"#7d5f00", "#e8c832"},
                                 {"#c9ccd1", "#5b626a"}};

constexpr const char* kShapes[kPlotShapes] = {
    "m-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0-9 0",
    "m-4-4h8v8h-8z",
    "m0-5.6l5.2 9.2h-10.4z",
    "m0-5.8l5.2 5.8l-5.2 5.8l-5.2-5.8z",
    "m0 5.6l5.2-9.2h-10.4z",
    "m-1.7-5h3.4v3.3h3.3v3.4h-3.3v3.3h-3.4v-3.3h-3.3v-3.4h3.3z",
    "m-5-2.8l2.2-2.2l2.8 2.8l2.8-2.8l2.2 2.2l-2.8 2.8l2.8 2.8l-2.2 2.2l-2.8-2.8l-2.8 2.8l-2.2-2.2l2.8-2.8z",
    "m-2.6-4.6h5.2l2.7 4.6l-2.7 4.6h-5.2l-2.7-4.6z"};
constexpr const char* kDashes[kPlotDashes] = {"none", "8 3", "3 2.5", "9 3 2 3", "14 4", "2 4"};

std::string rule(std::string_view selector, std::string_view declarations) {
    return fmt::format("svg {}{{{}}}\n", selector, declarations);
}

}  // namespace

std::string plotVariables(bool onDark) {
    const auto of = [&](const ColourPair& pair) { return onDark ? pair.onDark : pair.onWhite; };
    std::string css;
    for (int i = 0; i < kPlotColours; ++i) css += fmt::format("--k{}:{};", i, of(kColours[i]));
    for (std::size_t i = 0; i < std::size(kParts); ++i) css += fmt::format("--s{}:{};", i, of(kParts[i]));
    for (const NamedColour& colour : kGrounds) css += fmt::format("--{}:{};", colour.name, of(colour.pair));
    return css;
}

std::string plotRules(PlotColours colours) {
    const bool fixed = colours == PlotColours::fixedOnWhite;
    const auto named = [&](std::string_view name) -> std::string {
        if (!fixed) return fmt::format("var(--{})", name);
        for (const NamedColour& colour : kGrounds)
            if (name == colour.name) return colour.pair.onWhite;
        return "#000";
    };
    std::string css =
        rule("text", "font-family:system-ui,'Segoe UI','DejaVu Sans',sans-serif;fill:" + named("ink"));
    for (int i = 0; i < kPlotColours; ++i)
        css += rule(fmt::format(".k{}", i),
                    "color:" + (fixed ? kColours[i].onWhite : fmt::format("var(--k{})", i)));
    for (std::size_t i = 0; i < std::size(kParts); ++i)
        css += rule(fmt::format(".s{}", i),
                    "fill:" + (fixed ? kParts[i].onWhite : fmt::format("var(--s{})", i)));
    css += rule(".kf", "color:" + named("faint"));
    css += rule("text.c", "fill:currentColor") + rule(".kf text.c", "fill:" + named("soft")) +
           rule("text.t", "font-weight:600");
    css += rule("text.a", "fill:" + named("soft")) + rule("text.f", "fill:" + named("soft"));
    css += rule(".g", "stroke:" + named("grid")) + rule(".x", "fill:none;stroke:" + named("soft"));
    css += rule(".r", "stroke:" + named("ink") + ";stroke-width:1.5;stroke-dasharray:7 4");
    css += rule(".l", "fill:none;stroke:currentColor;stroke-width:2;stroke-linejoin:round");
    css += rule(".lf", "fill:none;stroke:currentColor;stroke-width:1;opacity:.65");
    css += rule(".e", "stroke:currentColor;stroke-width:1.5") +
           rule(".d", "stroke:currentColor;stroke-width:1;opacity:.7;fill:none");
    css += rule(".z", "fill:none;stroke:currentColor;stroke-width:1.2;stroke-dasharray:1.5 3");
    css += rule(".m", "fill:currentColor;stroke:" + named("ground") + ";stroke-width:.8");
    css += rule(".h", "fill:" + named("ground") + ";stroke:currentColor;stroke-width:1.8");
    css += rule(".q", "fill:none;stroke:" + named("front") +
                          ";stroke-width:9;stroke-linejoin:round;stroke-linecap:round");
    css += rule(".o", "fill:none;stroke:" + named("ink") + ";stroke-width:1.1") +
           rule(".b", "stroke:" + named("ground"));
    css += rule(".p", "fill:" + named("panel"));
    for (int i = 1; i < kPlotDashes; ++i)
        css += rule(fmt::format(".d{}", i), fmt::format("stroke-dasharray:{}", kDashes[i]));
    return css;
}

std::string inlineSvg(const Drawing& drawing, std::string_view cssClass, std::string_view about) {
    return fmt::format(
        "<svg class=\"{}\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">\n{}</svg>\n",
        cssClass, drawing.width, drawing.height, inHtml(about), drawing.svg);
}

std::string standaloneSvg(const PlotFigure& figure) {
    constexpr double kGap = 24, kEdge = 12;
    std::string body;
    double width = 0, height = kEdge;
    for (std::size_t i = 0; i < figure.panels.size(); i += 2) {
        double x = kEdge, rowHeight = 0;
        for (std::size_t j = i; j < std::min(i + 2, figure.panels.size()); ++j) {
            const Drawing drawing = figure.panels[j](kWideCanvas);
            body +=
                fmt::format("<g transform=\"translate({:.0f} {:.0f})\">\n{}</g>\n", x, height, drawing.svg);
            x += drawing.width + kGap;
            rowHeight = std::max(rowHeight, drawing.height);
        }
        width = std::max(width, x - kGap + kEdge);
        height += rowHeight + kGap;
    }
    width = std::max(width, 2 * kEdge);
    if (!figure.note.empty()) {
        body += "<g font-size=\"13\">" +
                svgText(kEdge, height, fittedTo(figure.note, width - 2 * kEdge, 13)) + "</g>\n";
        height += kGap;
    }
    return fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" "
        "height=\"{1:.0f}\" role=\"img\" aria-label=\"{2}\">\n<style>\n{3}</style>\n"
        "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n{4}</svg>\n",
        width, height, inHtml(figure.about), plotRules(PlotColours::fixedOnWhite), body);
}

std::string svgText(double x, double y, std::string_view words, TextAnchor anchor,
                    std::string_view cssClass) {
    const char* const anchors[] = {"", " text-anchor=\"middle\"", " text-anchor=\"end\""};
    const std::string named = cssClass.empty() ? "" : fmt::format(" class=\"{}\"", cssClass);
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\"{}{}>{}</text>\n", x, y, named, anchors[int(anchor)],
                       inHtml(words));
}

std::string svgLine(double x0, double y0, double x1, double y1, std::string_view cssClass) {
    return fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>\n", cssClass, x0, y0, x1, y1);
}

std::string svgMark(double x, double y, const PlotStyle& style, std::string_view tip) {
    const std::string title = tip.empty() ? "" : fmt::format("<title>{}</title>", inHtml(tip));
    if (style.isFaint)
        return fmt::format("<circle class=\"m\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.8\">{}</circle>\n", x, y,
                           title);
    return fmt::format("<path class=\"{}\" d=\"M{:.1f} {:.1f}{}\">{}</path>\n", style.isHollow ? "h" : "m", x,
                       y, kShapes[style.shape % kPlotShapes], title);
}

std::string colourClass(const PlotStyle& style) {
    return style.isFaint ? "kf" : fmt::format("k{}", style.colour % kPlotColours);
}

std::string lineClass(const PlotStyle& style) {
    if (style.isFaint) return "lf";
    return style.dash > 0 ? fmt::format("l d{}", style.dash % kPlotDashes) : "l";
}

double widthOf(std::string_view words, double textSize) {
    return double(lengthOf(words)) * textSize * 0.59;
}

std::string fittedTo(const std::string& words, double pixels, double textSize) {
    return shortenedTo(words, std::size_t(std::max(pixels / (textSize * 0.59) + 0.01, 2.0)));
}

std::vector<double> spreadApart(const std::vector<double>& wanted, double gap, double low, double high) {
    // Neighbours that would touch become one block around their mean.
    struct Touching {
        double sum;
        std::size_t count;
        double mean() const { return sum / double(count); }
    };
    std::vector<Touching> blocks;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        blocks.push_back({wanted[i] - double(i) * gap, 1});
        while (blocks.size() > 1 && blocks.back().mean() < blocks[blocks.size() - 2].mean()) {
            const Touching last = blocks.back();
            blocks.pop_back();
            blocks.back().sum += last.sum, blocks.back().count += last.count;
        }
    }
    const double highest = std::max(low, high - gap * (double(wanted.size()) - 1));
    std::vector<double> places;
    for (const Touching& block : blocks)
        for (std::size_t i = 0; i < block.count; ++i)
            places.push_back(std::clamp(block.mean(), low, highest) + double(places.size()) * gap);
    return places;
}

}  // namespace tessera
