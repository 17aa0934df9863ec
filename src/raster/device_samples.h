#pragma once

#include <memory>
#include <vector>

#include "gl/gl_handles.h"
#include "gl/gl_thread.h"
#include "raster/channel_coding.h"

namespace tessera {

/// Samples of one box that stay on the device as 3D textures: texel (x, y, z) is lattice point box.min + (x,
/// y, z). The last owner may drop them on any thread.
struct DeviceSamples {
    /// Up to four channels, in the components of one texture.
    struct Group {
        GlTexture codes;
        GlTexture
            coverage;  ///< of r8 and r16: 0 outside the mesh, else (1 + a bit a channel not finite) / 255
        int channels = 0;
    };
    /// A channel's value is scale * code + offset.
    struct Decoding {
        double scale = 1, offset = 0;
    };
    IndexBox box;
    std::vector<Group> groups;
    std::vector<Decoding> decodings;  ///< of all channels, in the order of the fields
    SampleMarks marks{};              ///< codes of points without a value; unused where there is coverage
};

/// A shared pointer whose last copy deletes the textures on the thread of their context, which must outlive
/// it.
std::shared_ptr<DeviceSamples> makeDeviceSamples(GlThread& thread);

}  // namespace tessera
