#include "raster/channel_coding.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mesh/field_range.h"

namespace tessera {

namespace {

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

NodeCode nodeCode(const ChannelCoding& coding, std::int32_t node) {
    const double value = coding.field().at(node, coding.component());
    if (!isFloat(value)) return {0, 0, 1};
    // What is zero as a float counts as zero: 1e-60 beside 1 is noise, and not worth the processor's time.
    // The range of an element's values is that of the values as floats. Nothing is -0: the least of 0 and -0
    // isn't the same on all processors.
    return {coding.encode(float(value) == 0 ? 0.0 : value) + 0.0,
            float(coding.encode(double(float(value)))) + 0.0f, 0};
}

float cellCode(const ChannelCoding& coding, std::int32_t element, float invalid) {
    const double value = coding.field().at(element, coding.component());
    return isFloat(value) ? float(coding.encode(double(float(value)))) : invalid;
}

bool isSafeOnDevice(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element) {
    if (coding.isOfCells()) return true;
    double most = 0;
    for (const std::int32_t node : mesh.tets[std::size_t(element)]) {
        const NodeCode code = nodeCode(coding, node);
        if (code.isInvalid) return true;
        most = std::max(most, std::fabs(code.code));
    }
    return most == 0 || most >= kSmallestCode;
}

void recordChannel(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element,
                   const ElementShape& shape, const double (&base)[3], float invalid, ChannelRecord& record) {
    record = {};
    const auto keep = [&](float code) { record.value = record.low = record.high = code; };
    if (coding.isOfCells()) return keep(cellCode(coding, element, invalid));
    const auto& tet = mesh.tets[std::size_t(element)];
    double codes[4];
    record.low = std::numeric_limits<float>::infinity();
    record.high = -record.low;
    for (std::size_t k = 0; k < 4; ++k) {
        const NodeCode code = nodeCode(coding, tet[k]);
        if (code.isInvalid) return keep(invalid);
        codes[k] = code.code;
        record.low = std::min(record.low, code.rounded);
        record.high = std::max(record.high, code.rounded);
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
