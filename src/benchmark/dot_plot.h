#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/plot_axis.h"
#include "benchmark/plot_parts.h"

namespace tessera {

struct DotMark {
    double value = 0;
    double low = 0, high = 0;  ///< drawn where they can be told from it
    int shape = 0;
    bool isHollow = false;
    std::string tip;
    std::string label;  ///< words beside it; written for the last mark of a row
};

struct DotRow {
    std::string label;
    PlotStyle style;
    std::vector<DotMark> marks;
    std::string note;        ///< in place of marks, or after them
    bool isHeading = false;  ///< of the rows that follow
};

/// What a shape stands for.
struct DotKey {
    int shape = 0;
    bool isHollow = false;
    std::string words;
};

/// Rows with marks along one axis.
struct DotPlot {
    std::string title;
    AxisSpec x;
    std::vector<DotRow> rows;
    std::vector<DotKey> key;
    std::optional<double> level;  ///< a value to compare with
};

/// Marks of zero stand in a lane of their own where the axis can't hold them.
Drawing drawDotPlot(const DotPlot& plot, const PlotCanvas& canvas);

inline constexpr int kBarKinds = 10;  ///< the last is grey, for what has no name

struct BarPart {
    double value = 0;
    int kind = 0;  ///< the colour
    std::string tip;
};
struct BarRow {
    std::string label, total;
    PlotStyle style;
    std::vector<BarPart> parts;
};
/// Each row a whole, of parts.
struct BarPlot {
    std::string title, xTitle;
    std::vector<BarRow> rows;
    std::vector<std::pair<int, std::string>> key;  ///< kinds and their names, in order
};
Drawing drawBarPlot(const BarPlot& plot, const PlotCanvas& canvas);

}  // namespace tessera
