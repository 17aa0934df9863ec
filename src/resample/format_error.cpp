#include "resample/format_error.h"

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

double formatError(SampleFormat format, const ValueRange& range, double largest, double highest) {
    if (format == SampleFormat::r32f) return 4 * floatUlp(largest);
    const double width = range.width();
    const double rounding = 4 * floatUlp(std::max(largest, highest));
    if (format == SampleFormat::r16f) return (width > 0 ? halfUlp(highest / width) * width : 0) + rounding;
    return width / (format == SampleFormat::r16 ? 65535 : 255) + rounding;
}

}  // namespace tessera
