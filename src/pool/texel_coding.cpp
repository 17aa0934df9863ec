#include "pool/texel_coding.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/check.h"
#include "brick/surface_distance.h"

namespace tessera {

namespace {

constexpr std::int64_t kCoverageBytes = 2;

std::size_t componentBytes(SampleFormat format) {
    switch (format) {
        case SampleFormat::r32f:
            return 4;
        case SampleFormat::r16f:
        case SampleFormat::r16:
            return 2;
        case SampleFormat::r8:
            return 1;
    }
    return 4;
}

/// The nearest of `most` steps between 0 and 1.
unsigned stepOf(float code, double most) {
    return unsigned(std::floor(std::clamp(double(code), 0.0, 1.0) * most + 0.5));
}

}  // namespace

std::uint8_t surfaceCode(float voxels) {
    const int steps = int(std::lround(std::clamp(double(voxels) / kFarFromSurface, -1.0, 1.0) * 127));
    return std::uint8_t(128 + (voxels < 0 ? std::min(steps, -1) : steps));
}

std::uint16_t halfFromFloat(float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    const auto sign = std::uint16_t(bits >> 16 & 0x8000u);
    const std::uint32_t magnitude = bits & 0x7fffffffu;
    if (magnitude > 0x7f800000u) return std::uint16_t(sign | 0x7e00u);
    if (magnitude >= 0x477ff000u) return std::uint16_t(sign | 0x7c00u);  // rounds up to infinity
    if (magnitude < 0x38800000u) {
        // Denormal as a half: steps of 2^-24. The sum rounds as the processor does, to nearest and even.
        const float shifted = std::bit_cast<float>(magnitude) + 0.5f;
        return std::uint16_t(sign | (std::bit_cast<std::uint32_t>(shifted) - 0x3f000000u));
    }
    const std::uint32_t odd = magnitude >> 13 & 1;
    return std::uint16_t(sign | ((magnitude - 0x38000000u + 0xfffu + odd) >> 13));
}

float floatFromHalf(std::uint16_t half) {
    const int exponent = half >> 10 & 31;
    const int fraction = half & 1023;
    float magnitude = std::ldexp(float(fraction), -24);
    if (exponent == 31)
        magnitude = fraction != 0 ? NAN : INFINITY;
    else if (exponent > 0)
        magnitude = std::ldexp(float(fraction + 1024), exponent - 25);
    return half & 0x8000 ? -magnitude : magnitude;
}

TexelCoding::TexelCoding(std::vector<ValueCoding> codings, SampleFormat format)
    : codings_(std::move(codings)), format_(format) {
    for (const ValueCoding& coding : codings_)
        TESSERA_CHECK(coding.format() == format_, "a coding of another format");
}

std::size_t TexelCoding::groupCount() const {
    return std::max<std::size_t>(1, (codings_.size() + kChannelsAGroup - 1) / kChannelsAGroup);
}

int TexelCoding::channelsOf(std::size_t group) const {
    return std::min(kChannelsAGroup, channels() - int(group) * kChannelsAGroup);
}

GLenum TexelCoding::pixelType() const {
    switch (format_) {
        case SampleFormat::r32f:
            return GL_FLOAT;
        case SampleFormat::r16f:
            return GL_HALF_FLOAT;
        case SampleFormat::r16:
            return GL_UNSIGNED_SHORT;
        case SampleFormat::r8:
            return GL_UNSIGNED_BYTE;
    }
    return GL_FLOAT;
}

std::int64_t TexelCoding::texelBytes(std::size_t group) const {
    return std::int64_t(componentBytes(format_)) * (channelsOf(group) <= 1 ? 1 : kChannelsAGroup);
}

std::int64_t TexelCoding::pointBytes() const {
    std::int64_t bytes = 0;
    for (std::size_t group = 0; group < groupCount(); ++group) bytes += texelBytes(group) + kCoverageBytes;
    return bytes;
}

void TexelCoding::putCode(double value, int channel, std::uint8_t* to) const {
    const auto code = float(codings_[std::size_t(channel)].encode(value));
    if (format_ == SampleFormat::r32f) {
        std::memcpy(to, &code, sizeof code);
    } else if (format_ == SampleFormat::r8) {
        *to = std::uint8_t(stepOf(code, 255));
    } else {
        const auto half =
            format_ == SampleFormat::r16f ? halfFromFloat(code) : std::uint16_t(stepOf(code, 65535));
        std::memcpy(to, &half, sizeof half);
    }
}

Texels TexelCoding::encode(const PointValues& points) const {
    const std::size_t count = points.covered.size();
    Texels texels;
    for (std::size_t group = 0; group < groupCount(); ++group) {
        const auto bytes = std::size_t(texelBytes(group));
        const int first = int(group) * kChannelsAGroup;
        std::vector<std::uint8_t>& codes = texels.codes.emplace_back(count * bytes, std::uint8_t(0));
        std::vector<std::uint8_t>& coverage = texels.coverage.emplace_back(count * kCoverageBytes);
        for (std::size_t i = 0; i < count; ++i) {
            int invalid = 0;
            for (int c = 0; c < channelsOf(group); ++c) {
                const double value = points.values[i * codings_.size() + std::size_t(first + c)];
                if (std::isfinite(value))
                    putCode(value, first + c, &codes[i * bytes + std::size_t(c) * componentBytes(format_)]);
                else
                    invalid |= 1 << c;
            }
            coverage[i * kCoverageBytes] = std::uint8_t(points.covered[i] ? 1 + invalid : 0);
            coverage[i * kCoverageBytes + 1] = surfaceCode(points.surface[i]);
        }
    }
    return texels;
}

}  // namespace tessera
