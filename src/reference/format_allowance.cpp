#include "reference/format_allowance.h"

#include <algorithm>
#include <cmath>

namespace tessera {

FormatAllowance::FormatAllowance(SampleFormat format, const ValueRange& range)
    : format_(format), range_(range) {}

double FormatAllowance::error(std::span<const double> values) const {
    double most = 0, highest = 0;
    for (const double f : values) {
        most = std::max(most, std::abs(f));
        highest = std::max(highest, f - range_.min);
    }
    return formatError(format_, range_, most, highest);
}

bool FormatAllowance::isInRange(float value, std::span<const double> values) const {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    if (!isStepped()) return value >= float(*low) && value <= float(*high);
    const double e = error(values);
    return value >= float(range_.min) && value <= float(range_.max) && double(value) >= *low - e &&
           double(value) <= *high + e;
}

bool FormatAllowance::isOwn(float value, double own) const {
    if (!isStepped()) return value == float(own);
    return isInRange(value, std::span(&own, 1));
}

}  // namespace tessera
