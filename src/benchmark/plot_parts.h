#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

/// How a curve or a row is told from others: by colour, by the shape of its marks and by the dashes of its
/// line.
struct PlotStyle {
    int colour = 0;  ///< below kPlotColours
    int shape = 0;   ///< below kPlotShapes
    int dash = 0;    ///< below kPlotDashes; 0: none
    bool isHollow = false;
    bool isFaint = false;  ///< thin and grey, as one among many
};
inline constexpr int kPlotColours = 7, kPlotShapes = 8, kPlotDashes = 6;
inline constexpr int kInkColour = 6;  ///< black on white, white on black

/// The room that a picture is drawn for: texts keep their size, and everything else makes do.
struct PlotCanvas {
    double width = 620, textSize = 13;
    bool isNarrow = false;
};
inline constexpr PlotCanvas kWideCanvas{620, 13, false}, kNarrowCanvas{358, 12.5, true};

/// What stands in a picture, without its <svg> element.
struct Drawing {
    std::string svg;
    double width = 0, height = 0;
};
/// Draws one panel of a figure for any room.
using PlotPanel = std::function<Drawing(const PlotCanvas&)>;

/// Several panels that show one thing.
struct PlotFigure {
    std::string about;  ///< what it shows, for those who can't see it
    std::vector<PlotPanel> panels;
    std::string note;  ///< a line below
};

/// The rules that give the classes used in drawings their look.
enum class PlotColours { fixedOnWhite, fromPage };
std::string plotRules(PlotColours colours);
/// The variables that PlotColours::fromPage takes its colours from.
std::string plotVariables(bool onDark);

/// A picture of its own, panels in two columns.
std::string standaloneSvg(const PlotFigure& figure);
/// A picture in a page.
std::string inlineSvg(const Drawing& drawing, std::string_view cssClass, std::string_view about);

// Pieces of drawings. Classes: "t" heading, "a" of axes, "f" faint. Words are made safe here.
enum class TextAnchor { start, middle, end };
std::string svgText(double x, double y, std::string_view words, TextAnchor anchor = TextAnchor::start,
                    std::string_view cssClass = "");
std::string svgLine(double x0, double y0, double x1, double y1, std::string_view cssClass);
/// @param tip what is said of it when it is pointed at.
std::string svgMark(double x, double y, const PlotStyle& style, std::string_view tip);
/// Class names of the colour, of the line and its dashes.
std::string colourClass(const PlotStyle& style);
std::string lineClass(const PlotStyle& style);

/// Pixels that words take at most, about.
double widthOf(std::string_view words, double textSize);
/// The words that fit into so many pixels.
std::string fittedTo(const std::string& words, double pixels, double textSize);

/// Moves places apart until they are `gap` from one another and between the ends, each as near to where it
/// was as can be.
/// @param wanted ascending.
std::vector<double> spreadApart(const std::vector<double>& wanted, double gap, double low, double high);

}  // namespace tessera
