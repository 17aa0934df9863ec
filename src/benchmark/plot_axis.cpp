#include "benchmark/plot_axis.h"

#include <fmt/format.h>

#include <algorithm>

#include "benchmark/page_numbers.h"
#include "benchmark/plot_parts.h"

namespace tessera {

namespace {

constexpr double kMargin = 0.04;  // of the range, beyond the outermost values

/// 1, 2 or 5 times a power of ten, at least `least`.
double roundTickStep(double least) {
    const double power = std::pow(10, std::floor(std::log10(least)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (factor * power >= least * (1 - 1e-9)) return factor * power;
    return 10 * power;
}

std::vector<double> linearTicks(double low, double high, double most) {
    std::vector<double> values;
    const double step = roundTickStep((high - low) / std::max(most, 1.0));
    for (double i = std::ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; ++i)
        values.push_back(i * step);
    return values;
}

}  // namespace

PlotAxis::PlotAxis(const AxisSpec& spec, double from, double to)
    : unit_(spec.unit), isLinear_(spec.isLinear), asked_(spec.ticks), from_(from), to_(to) {
    if (spec.isReversed) std::swap(from_, to_);
    AxisRange range = spec.range;
    if (range.empty() || (!isLinear_ && range.low <= 0)) range = {1, 10};
    low_ = scaled(range.low), high_ = scaled(range.high);
    const double least = isLinear_ ? std::max(1e-3 * std::abs(high_), 1e-12) : 0.1;
    if (high_ - low_ < least) low_ -= least, high_ += least;
    const double margin = (high_ - low_) * kMargin;
    low_ -= margin, high_ += margin;
}

double PlotAxis::at(double value) const {
    const double share = std::clamp((scaled(value) - low_) / (high_ - low_), -0.02, 1.02);
    return from_ + (to_ - from_) * share;
}

std::vector<double> PlotAxis::roundValues(double mostTicks) const {
    if (!asked_.empty()) return asked_;
    if (isLinear_) return linearTicks(low_, high_, mostTicks);
    const double decades = high_ - low_;
    std::vector<double> values;
    if (decades < 0.7) return linearTicks(std::pow(10, low_), std::pow(10, high_), mostTicks);
    const bool hasBetween = decades * 3 <= mostTicks + 1;
    const double step = hasBetween ? 1 : std::max(1.0, std::ceil(decades / std::max(mostTicks, 1.0) - 0.2));
    for (double power = std::floor(low_ / step) * step; power <= high_; power += step)
        for (const double factor : {1.0, 2.0, 5.0})
            if (factor == 1 || hasBetween) values.push_back(factor * std::pow(10, power));
    return values;
}

std::vector<AxisTick> PlotAxis::ticks(double room) const {
    std::vector<AxisTick> ticks;
    double last = std::numeric_limits<double>::infinity();
    for (const double value : roundValues(std::abs(to_ - from_) / room)) {
        if (!holds(value) || scaled(value) < low_ || scaled(value) > high_) continue;
        if (std::abs(at(value) - last) < room * 0.8) continue;
        last = at(value);
        ticks.push_back({value, tickText(unit_, value)});
    }
    return ticks;
}

std::vector<AxisTick> PlotAxis::ticksAcross(double room, double textSize) const {
    std::vector<AxisTick> apart;
    for (AxisTick& tick : ticks(room)) {
        const double width = widthOf(tick.label, textSize);
        const bool hasRoom = apart.empty() || std::abs(at(tick.value) - at(apart.back().value)) >=
                                                  (width + widthOf(apart.back().label, textSize)) / 2 + 6;
        if (hasRoom) apart.push_back(std::move(tick));
    }
    return apart;
}

std::string tickText(AxisUnit unit, double value) {
    const auto with = [](double number, const char* name) {
        return fmt::format("{:.4g}{}{}", number, kThinSpace, name);
    };
    switch (unit) {
        case AxisUnit::time:
            if (value >= 1e3) return with(value / 1e3, "s");
            if (value >= 1) return with(value, "ms");
            return value >= 1e-3 ? with(value * 1e3, "\u00b5s") : with(value * 1e6, "ns");
        case AxisUnit::share:
            if (value > 0 && value < 1e-5) return asPower(value * 100, 1) + kThinSpace + "%";
            return with(value * 100, "%");
        case AxisUnit::amount:
            if (value >= 1e9) return with(value / 1e9, "bn");
            return value >= 1e6 ? with(value / 1e6, "M") : wholeText(value);
        case AxisUnit::times:
            return (value >= 1e4 ? wholeText(value) : fmt::format("{:.4g}", value)) + "\u00d7";
        case AxisUnit::plain:
            break;
    }
    return fmt::format("{:.4g}", value);
}

}  // namespace tessera
