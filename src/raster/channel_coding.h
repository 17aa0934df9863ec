#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "raster/element_shape.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

/// One component of one field, and how its values stand in a target of the device.
///
/// r32f: multiplied by a power of two that brings the largest to about 2^60, so that nothing that matters is
/// denormal on a device that flushes; exact. Other formats: (value - min) / (max - min) over the finite
/// values of the whole field.
class ChannelCoding {
  public:
    ChannelCoding(const Field& field, int component, SampleFormat format);

    /// The same coding for a part of the field's values.
    ChannelCoding on(const Field& part) const {
        ChannelCoding coding = *this;
        coding.field_ = &part;
        return coding;
    }
    const Field& field() const { return *field_; }
    int component() const { return component_; }
    bool isOfCells() const { return field_->location == FieldLocation::cell; }

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
    const Field* field_;
    int component_;
    SampleFormat format_;
    double scale_ = 1, inverseScale_ = 1;  ///< of r32f: powers of two
    double min_ = 0, width_ = 0;
    float low_ = 0, high_ = 0;
};

/// Codes of points that aren't covered, and of covered ones whose value isn't finite: `invalid` or, where the
/// device interpolates it, anything from `invalidFrom` on. r8 and r16 keep both in a target of their own.
struct SampleMarks {
    float uncovered, invalid, invalidFrom;
};
SampleMarks sampleMarks(SampleFormat format);
/// r8 and r16: no code is left for the marks.
inline bool needsCoverageTarget(SampleFormat format) {
    return format == SampleFormat::r8 || format == SampleFormat::r16;
}

/// A channel's values over an element: clamp(value + (gradient . (p - base) + start), low, high). As the
/// shaders read it.
struct ChannelRecord {
    float gradient[3];
    float start;
    float value, low, high;
    float unused = 0;
};

/// False when the device could lose a channel's values over an element to underflow; the element is then to
/// be treated as hard, in all channels of a run alike.
bool isSafeOnDevice(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element);

/// @param base relative to the shape's first voxel.
void recordChannel(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element,
                   const ElementShape& shape, const double (&base)[3], float invalid, ChannelRecord& record);

}  // namespace tessera
