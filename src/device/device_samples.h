#pragma once

#include <memory>
#include <span>
#include <vector>

#include "device/texture_slots.h"

namespace tessera {

/// Slots that are textures of their own, one a box and group, as large as the box.
class DeviceSamples : public TextureSlots {
  public:
    /// Makes the textures; their content is undefined until the boxes are sampled. The last owner may drop
    /// them on any thread. Throws GlError when the device has no room.
    static std::shared_ptr<DeviceSamples> make(GlThread& thread, std::span<const IndexBox> boxes,
                                               std::vector<ValueCoding> codings, SampleFormat format);

    SlotPlace place(std::size_t boxIndex, std::size_t group) const override;

  private:
    struct Textures {
        GlTexture codes, coverage;
    };
    using TextureSlots::TextureSlots;
    std::vector<Textures> textures_;  // box by box, group by group
};

}  // namespace tessera
