#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "device/value_coding.h"
#include "gl/gl_handles.h"
#include "gl/gl_platform.h"
#include "gl/gl_thread.h"
#include "resample/device_slots.h"

namespace tessera {

/// Channels are kept in groups of four, the components of one texel; one channel alone takes one component.
inline constexpr int kChannelsAGroup = 4;

/// Internal format of a texture for a group of `channels` channels.
GLenum textureFormat(SampleFormat format, int channels);

/// Where the samples of one box go, in one group: texel at + (x, y, z) is lattice point box.min + (x, y, z).
struct SlotPlace {
    const GlTexture* codes = nullptr;
    const GlTexture* coverage = nullptr;  ///< where needsCoverageTexture(format)
    Vec3i at{0};
};

/// Slots in 3D textures of one OpenGL context: one texture a box or one for all, as the class behind says.
class TextureSlots : public DeviceSlots {
  public:
    /// @param codings of all channels, in the order of the fields; all of one format. `thread` must outlive
    /// the slots.
    TextureSlots(GlThread& thread, std::vector<ValueCoding> codings, SampleFormat format);

    std::string_view target() const override { return nameOf(thread_.platform()); }
    SampleFormat format() const override { return format_; }
    int channels() const override { return int(codings_.size()); }
    void upload(std::size_t boxIndex, const Block& block) override;

    GlThread& thread() const { return thread_; }
    const std::vector<ValueCoding>& codings() const { return codings_; }
    /// At least one, which then holds nothing but the coverage.
    std::size_t groupCount() const;
    /// Channels in a group, 0 to 4.
    int channelsOf(std::size_t group) const;
    /// On the OpenGL thread.
    virtual SlotPlace place(std::size_t boxIndex, std::size_t group) const = 0;

  private:
    GlThread& thread_;
    std::vector<ValueCoding> codings_;
    SampleFormat format_;
};

/// The codings of some fields' channels, for slots of this format.
std::vector<ValueCoding> codingsOf(const TetMesh& mesh, std::span<const int> fields, SampleFormat format);

}  // namespace tessera
