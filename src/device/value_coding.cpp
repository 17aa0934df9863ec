#include "device/value_coding.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {

namespace {

constexpr int kLargestExponent = 60;

}  // namespace

ValueCoding::ValueCoding(const ValueRange& range, SampleFormat format) : format_(format) {
    if (range.empty()) return;
    // Far below any float the power of two itself would be infinite; such values count as zero.
    const double most = double(std::max(std::fabs(float(range.min)), std::fabs(float(range.max))));
    if (most > 0) {
        const int exponent = kLargestExponent - std::ilogb(most);
        scale_ = std::ldexp(1.0, exponent);
        inverseScale_ = std::ldexp(1.0, -exponent);
    }
    min_ = range.min;
    width_ = range.width();
    low_ = float(range.min);
    high_ = float(range.max);
}

double ValueCoding::encode(double value) const {
    if (format_ == SampleFormat::r32f) return value * scale_;
    return width_ > 0 ? (value - min_) / width_ : 0.0;
}

double ValueCoding::scale() const {
    return format_ == SampleFormat::r32f ? inverseScale_ : width_;
}

double ValueCoding::offset() const {
    return format_ == SampleFormat::r32f ? 0.0 : min_;
}

SampleMarks sampleMarks(SampleFormat format) {
    if (format == SampleFormat::r32f)
        return {-std::numeric_limits<float>::max(), std::numeric_limits<float>::max(), 0x1p100f};
    return {-1.0f, 2.0f, 1.5f};
}

}  // namespace tessera
