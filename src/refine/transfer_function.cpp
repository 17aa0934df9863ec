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
