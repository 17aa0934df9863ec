#include "raster/channel_coding.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/field_range.h"

namespace tessera {

namespace {

constexpr int kLargestExponent = 60;
/// An r32f element whose values are all smaller than this, but not zero, may be flushed on the device.
constexpr double kSmallestCode = 0x1p-90;

bool isFloat(double value) {
    return std::isfinite(float(value));
}

float asFloat(double value) {
    constexpr double kMost = std::numeric_limits<float>::max();
    return float(std::clamp(value, -kMost, kMost));
}

/// What is zero as a float counts as zero: 1e-60 beside 1 is noise, and not worth the processor's time.
double nodeCode(const ChannelCoding& coding, double value) {
    return coding.encode(float(value) == 0 ? 0.0 : value);
}

}  // namespace

ChannelCoding::ChannelCoding(const Field& field, int component, SampleFormat format)
    : field_(&field), component_(component), format_(format) {
    const ValueRange range = finiteFloatRange(field, component);
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

double ChannelCoding::encode(double value) const {
    if (format_ == SampleFormat::r32f) return value * scale_;
    return width_ > 0 ? (value - min_) / width_ : 0.0;
}

double ChannelCoding::scale() const {
    return format_ == SampleFormat::r32f ? inverseScale_ : width_;
}

double ChannelCoding::offset() const {
    return format_ == SampleFormat::r32f ? 0.0 : min_;
}

SampleMarks sampleMarks(SampleFormat format) {
    if (format == SampleFormat::r32f)
        return {-std::numeric_limits<float>::max(), std::numeric_limits<float>::max(), 0x1p100f};
    return {-1.0f, 2.0f, 1.5f};
}

bool isSafeOnDevice(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element) {
    if (coding.isOfCells()) return true;
    double most = 0;
    for (const std::int32_t node : mesh.tets[std::size_t(element)]) {
        const double value = coding.field().at(node, coding.component());
        if (!isFloat(value)) return true;
        most = std::max(most, std::fabs(nodeCode(coding, value)));
    }
    return most == 0 || most >= kSmallestCode;
}

void recordChannel(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element,
                   const ElementShape& shape, const double (&base)[3], float invalid, ChannelRecord& record) {
    record = {};
    const auto keep = [&](double code) { record.value = record.low = record.high = float(code); };
    if (coding.isOfCells()) {
        const double value = coding.field().at(element, coding.component());
        keep(isFloat(value) ? coding.encode(double(float(value))) : double(invalid));
        return;
    }
    const auto& tet = mesh.tets[std::size_t(element)];
    double codes[4];
    record.low = std::numeric_limits<float>::infinity();
    record.high = -record.low;
    for (std::size_t k = 0; k < 4; ++k) {
        const double value = coding.field().at(tet[k], coding.component());
        if (!isFloat(value)) {
            keep(double(invalid));
            return;
        }
        codes[k] = nodeCode(coding, value);
        // The range is that of the values as floats.
        const auto rounded = float(coding.encode(double(float(value))));
        record.low = std::min(record.low, rounded);
        record.high = std::max(record.high, rounded);
    }
    double gradient[3] = {0, 0, 0}, start = 0;
    for (int k = 1; k < 4; ++k) {
        const double slope = (codes[k] - codes[0]) / shape.height[k];
        double at = shape.offset[k];
        for (int a = 0; a < 3; ++a) {
            gradient[a] += slope * shape.normal[k][a];
            at += shape.normal[k][a] * base[a];
        }
        start += slope * at;
    }
    for (int a = 0; a < 3; ++a) record.gradient[a] = asFloat(gradient[a]);
    record.start = asFloat(start);
    record.value = float(codes[0]);
}

}  // namespace tessera
