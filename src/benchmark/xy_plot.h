#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/plot_axis.h"
#include "benchmark/plot_parts.h"

namespace tessera {

struct XyPoint {
    double x = 0, y = 0;
    double low = 0, high = 0;  ///< of y; drawn where they can be told from it
    std::string tip;
    int frontNumber = 0;  ///< of its place on the front, from 1; 0: not on it
};

struct XySeries {
    std::string label;
    std::string shortLabel;  ///< where there is no room for the other; empty: the same
    PlotStyle style;
    std::vector<XyPoint> points;
    bool isJoined = true;
    std::vector<std::array<double, 2>> fit;  ///< a dotted line through these
};

/// Curves over two axes, with their names at their ends.
struct XyPlot {
    std::string title;
    AxisSpec x, y;
    std::vector<XySeries> series;
    std::vector<std::array<double, 2>> front;  ///< from fastest to closest: a broad line behind
    std::optional<double> level;               ///< a value of y to compare with
    std::string levelLabel;
};

Drawing drawXyPlot(const XyPlot& plot, const PlotCanvas& canvas);

}  // namespace tessera
