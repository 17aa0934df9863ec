#pragma once

#include "device/value_coding.h"
#include "mesh/field_range.h"
#include "raster/element_shape.h"
#include "tessera/mesh.h"

namespace tessera {

/// One component of one field, and how its values stand in a target of the device.
class ChannelCoding : public ValueCoding {
  public:
    ChannelCoding(const Field& field, int component, SampleFormat format)
        : ValueCoding(finiteFloatRange(field, component), format), field_(&field), component_(component) {}

    /// The same coding for a part of the field's values.
    ChannelCoding on(const Field& part) const {
        ChannelCoding coding = *this;
        coding.field_ = &part;
        return coding;
    }
    const Field& field() const { return *field_; }
    int component() const { return component_; }
    bool isOfCells() const { return field_->location == FieldLocation::cell; }

  private:
    const Field* field_;
    int component_;
};

/// A channel's values over an element: clamp(value + (gradient . (p - base) + start), low, high). As the
/// shaders read it.
struct ChannelRecord {
    float gradient[3];
    float start;
    float value, low, high;
    float unused = 0;
};

/// A channel's code at a node: unrounded, and that of the value as a float.
struct NodeCode {
    double code;
    float rounded;
    std::uint32_t isInvalid;  ///< the value isn't finite as a float, and the others mean nothing
};
NodeCode nodeCode(const ChannelCoding& coding, std::int32_t node);

/// The code of a channel of cells in an element. @param invalid where the value isn't finite as a float.
float cellCode(const ChannelCoding& coding, std::int32_t element, float invalid);

/// False when the device could lose a channel's values over an element to underflow; the element is then to
/// be treated as hard, in all channels of a run alike.
bool isSafeOnDevice(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element);

/// @param base relative to the shape's first voxel.
void recordChannel(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element,
                   const ElementShape& shape, const double (&base)[3], float invalid, ChannelRecord& record);

}  // namespace tessera
