#include "slab/channel_coding.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

}  // namespace

ChannelCoding::ChannelCoding(const Field& field, int component, SampleFormat format)
    : field_(&field), component_(component), format_(format) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t i = std::size_t(component); i < field.values.size();
         i += std::size_t(field.components)) {
        const double value = field.values[i];
        if (!isFloat(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
    }
    if (!(low <= high)) return;
    const double most = std::max(std::fabs(low), std::fabs(high));
    if (most > 0) exponent_ = kLargestExponent - std::ilogb(most);
    min_ = low;
    width_ = high - low;
    low_ = float(low);
    high_ = float(high);
}

double ChannelCoding::encode(double value) const {
    if (format_ == SampleFormat::r32f) return std::ldexp(value, exponent_);
    return width_ > 0 ? (value - min_) / width_ : 0.0;
}

float ChannelCoding::decode(float code) const {
    if (format_ == SampleFormat::r32f) return float(std::ldexp(double(code), -exponent_));
    return std::clamp(float(min_ + double(code) * width_), low_, high_);
}

double ChannelCoding::scale() const {
    return format_ == SampleFormat::r32f ? std::ldexp(1.0, -exponent_) : width_;
}

double ChannelCoding::offset() const {
    return format_ == SampleFormat::r32f ? 0.0 : min_;
}

SampleMarks sampleMarks(SampleFormat format) {
    if (format == SampleFormat::r32f)
        return {-std::numeric_limits<float>::max(), std::numeric_limits<float>::max(), 0x1p100f};
    return {-1.0f, 2.0f, 1.5f};
}

bool recordChannel(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element,
                   const ElementShape& shape, const double (&base)[3], float invalid, ChannelRecord& record) {
    record = {};
    const auto keep = [&](double code) { record.value = record.low = record.high = float(code); };
    if (coding.isOfCells()) {
        const double value = coding.field().at(element, coding.component());
        keep(isFloat(value) ? coding.encode(double(float(value))) : double(invalid));
        return true;
    }
    const auto& tet = mesh.tets[std::size_t(element)];
    double codes[4];
    record.low = std::numeric_limits<float>::infinity();
    record.high = -record.low;
    for (std::size_t k = 0; k < 4; ++k) {
        const double value = coding.field().at(tet[k], coding.component());
        if (!isFloat(value)) {
            keep(double(invalid));
            return true;
        }
        codes[k] = coding.encode(value);
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
    const double most =
        std::max({std::fabs(codes[0]), std::fabs(codes[1]), std::fabs(codes[2]), std::fabs(codes[3])});
    return most == 0 || most >= kSmallestCode;
}

}  // namespace tessera
