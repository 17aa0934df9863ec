#pragma once

#include <algorithm>

#include "mesh/field_range.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

/// How the values of a channel stand in device memory.
///
/// r32f: multiplied by a power of two that brings the largest to about 2^60, so that nothing that matters is
/// denormal on a device that flushes; exact. Other formats: (value - min) / (max - min) over the finite
/// values of the whole field.
class ValueCoding {
  public:
    /// @param range of the channel's finite values over the whole mesh.
    ValueCoding(const ValueRange& range, SampleFormat format);

    SampleFormat format() const { return format_; }
    /// @param value finite as a float.
    double encode(double value) const;
    float decode(float code) const {
        if (format_ == SampleFormat::r32f) return float(double(code) * inverseScale_);
        return std::clamp(float(min_ + double(code) * width_), low_, high_);
    }
    /// decode(code) is scale() * code + offset(), then rounded and limited to the field's range.
    double scale() const;
    double offset() const;

  private:
    SampleFormat format_;
    double scale_ = 1, inverseScale_ = 1;  // of r32f: powers of two
    double min_ = 0, width_ = 0;
    float low_ = 0, high_ = 0;
};

/// Codes of points that aren't covered, and of covered ones whose value isn't finite: `invalid` or, where the
/// device interpolates it, anything from `invalidFrom` on. r8 and r16 keep both in a texture of their own.
struct SampleMarks {
    float uncovered, invalid, invalidFrom;
};
SampleMarks sampleMarks(SampleFormat format);

/// r8 and r16: no code is left for the marks. A texel of the coverage is 0 outside the mesh, else (1 + a bit
/// a channel that isn't finite) / 255.
inline bool needsCoverageTexture(SampleFormat format) {
    return format == SampleFormat::r8 || format == SampleFormat::r16;
}

}  // namespace tessera
