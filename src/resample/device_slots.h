#pragma once

#include <cstddef>
#include <string_view>

#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

/// Places in device memory for samples, one for every box of a call: what BoundResampler::resampleToDevice
/// fills. A pool of bricks is one, textures that belong to single boxes are another. Nothing here names a
/// graphics interface: an algorithm on the device knows the kinds of slots it can draw into, and all others
/// upload blocks.
class DeviceSlots {
  public:
    virtual ~DeviceSlots() = default;

    /// Whose memory it is, as a device algorithm's BoundResampler::target().
    virtual std::string_view target() const = 0;
    virtual SampleFormat format() const = 0;
    /// Channels of a slot.
    virtual int channels() const = 0;

    /// Puts the samples of a box, all its points, into its slot. Values are coded by format(). Called from
    /// several threads at once. Throws GlError when the device fails.
    virtual void upload(std::size_t boxIndex, const Block& block) = 0;
};

}  // namespace tessera
