#include "tessera/transfer_function.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/text.h"
#include "tessera/error.h"

namespace tessera {

bool operator==(const TransferFunction& a, const TransferFunction& b) {
    return a.field == b.field &&
           std::equal(a.stops.begin(), a.stops.end(), b.stops.begin(), b.stops.end(),
                      [](const TransferFunction::Stop& x, const TransferFunction::Stop& y) {
                          return x.value == y.value && x.color == y.color && x.opacity == y.opacity;
                      });
}

TransferFunction::Stop between(const TransferFunction::Stop& below, const TransferFunction::Stop& above,
                               double value) {
    // In halves, as the difference of the largest numbers isn't one.
    const double t = (value / 2 - below.value / 2) / (above.value / 2 - below.value / 2);
    TransferFunction::Stop stop{.value = value};
    stop.opacity = below.opacity + t * (above.opacity - below.opacity);
    for (std::size_t c = 0; c < 3; ++c)
        stop.color[c] = below.color[c] + t * (above.color[c] - below.color[c]);
    return stop;
}

std::array<double, 4> shownAs(const TransferFunction::Stop& stop) {
    return {stop.color[0] * stop.opacity, stop.color[1] * stop.opacity, stop.color[2] * stop.opacity,
            stop.opacity};
}

std::array<double, 4> shownAt(const TransferFunction& function, double value) {
    const std::vector<TransferFunction::Stop>& stops = function.stops;
    const auto above = std::find_if(stops.begin(), stops.end(),
                                    [&](const TransferFunction::Stop& stop) { return stop.value > value; });
    if (above == stops.begin()) return shownAs(stops.front());
    if (above == stops.end()) return shownAs(stops.back());
    return shownAs(between(*(above - 1), *above, value));
}

bool showsAny(const TransferFunction& function, double low, double high) {
    if (shownAt(function, low)[3] > 0 || shownAt(function, high)[3] > 0) return true;
    return std::any_of(function.stops.begin(), function.stops.end(), [&](const TransferFunction::Stop& stop) {
        return stop.opacity > 0 && stop.value >= low && stop.value <= high;
    });
}

void checkTransferFunction(const TransferFunction& function) {
    if (function.stops.empty()) throw InputError("a transfer function needs a stop");
    const auto isShare = [](double v) { return v >= 0 && v <= 1; };
    double before = -std::numeric_limits<double>::infinity();
    for (const TransferFunction::Stop& stop : function.stops) {
        if (!std::isfinite(stop.value) || stop.value < before)
            throw InputError("the stops of a transfer function must ascend; " + shortNumber(stop.value, 6) +
                             " comes after " + shortNumber(before, 6));
        before = stop.value;
        if (!isShare(stop.opacity) || !std::all_of(stop.color.begin(), stop.color.end(), isShare))
            throw InputError(
                "opacities and colours of a transfer function lie between 0 and 1; the stop at " +
                shortNumber(stop.value, 6) + " has others");
    }
}

}  // namespace tessera
