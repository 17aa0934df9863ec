#include "reference/format_allowance.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {

namespace {

/// Distance from |x| to the next number of `digits` significant binary digits, above the least normal one.
double ulp(double x, int digits, double leastNormal) {
    int exponent = 0;
    std::frexp(std::max(std::abs(x), leastNormal), &exponent);
    return std::ldexp(1.0, exponent - digits);
}

}  // namespace

double floatUlp(double x) {
    return ulp(x, 24, double(std::numeric_limits<float>::min()));
}

double halfUlp(double x) {
    return ulp(x, 11, 0x1p-14);
}

ValueRange finiteFloatRange(const Field& field, int component) {
    ValueRange range;
    for (std::size_t i = std::size_t(component); i < field.values.size();
         i += std::size_t(field.components)) {
        const double v = field.values[i];
        if (!std::isfinite(float(v))) continue;
        range.min = std::min(range.min, v), range.max = std::max(range.max, v);
    }
    return range;
}

FormatAllowance::FormatAllowance(SampleFormat format, const ValueRange& range)
    : format_(format), range_(range) {}

double FormatAllowance::error(std::span<const double> values) const {
    double most = 0, highest = 0;
    for (const double f : values) {
        most = std::max(most, std::abs(f));
        highest = std::max(highest, f - range_.min);
    }
    const double width = range_.width();
    switch (format_) {
        case SampleFormat::r32f:
            break;
        case SampleFormat::r16f:
            return (width > 0 ? halfUlp(highest / width) * width : 0) + 4 * floatUlp(std::max(most, highest));
        case SampleFormat::r16:
            return width / 65535 + 4 * floatUlp(std::max(most, highest));
        case SampleFormat::r8:
            return width / 255 + 4 * floatUlp(std::max(most, highest));
    }
    return 4 * floatUlp(most);
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
