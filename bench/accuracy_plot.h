#pragma once

#include <array>
#include <string>
#include <vector>

namespace tessera::bench {

struct AccuracyLine {
    std::string label, colour;  ///< colour as in SVG
    bool isDashed = false;
    std::vector<std::array<double, 2>> points;  ///< x, y, above 0
};
struct AccuracyPanel {
    std::string title;
    std::vector<AccuracyLine> lines;
};

/// Panels in two columns as an SVG document, both axes logarithmic and the same in all, with the labels of
/// the first one's lines below.
std::string accuracyPlot(const std::vector<AccuracyPanel>& panels, const std::string& xTitle,
                         const std::string& yTitle);

}  // namespace tessera::bench
