#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace tessera {

/// What the numbers of an axis are, which decides how they are written.
enum class AxisUnit { time, share, amount, plain, times };

/// Least and largest of some values.
struct AxisRange {
    double low = std::numeric_limits<double>::infinity(), high = -low;

    void include(double value) { low = std::fmin(low, value), high = std::fmax(high, value); }
    bool empty() const { return !(low <= high); }
};

/// What an axis shows. All axes are logarithmic but for those that ask for less.
struct AxisSpec {
    std::string title;
    AxisUnit unit = AxisUnit::plain;
    bool isReversed = false;
    bool isLinear = false;
    AxisRange range;            ///< to be held in any case
    std::vector<double> ticks;  ///< in place of round numbers
};

struct AxisTick {
    double value = 0;
    std::string label;
};

/// An axis laid over pixels.
class PlotAxis {
  public:
    /// @param from, to pixels of the lowest and the highest value; swapped by a reversed axis.
    PlotAxis(const AxisSpec& spec, double from, double to);
    double at(double value) const;
    bool holds(double value) const { return std::isfinite(value) && (isLinear_ || value > 0); }
    /// @param room pixels from one label's middle to the next, at least.
    std::vector<AxisTick> ticks(double room) const;
    /// The same for labels side by side.
    std::vector<AxisTick> ticksAcross(double room, double textSize) const;

  private:
    double scaled(double value) const { return isLinear_ ? value : std::log10(value); }
    std::vector<double> roundValues(double mostTicks) const;

    AxisUnit unit_;
    bool isLinear_;
    std::vector<double> asked_;
    double low_, high_;  // scaled
    double from_, to_;
};

/// A round number, as short as it is.
std::string tickText(AxisUnit unit, double value);

}  // namespace tessera
