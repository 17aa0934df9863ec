#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "device/texture_slots.h"
#include "device/value_coding.h"
#include "pool/shown_bricks.h"

namespace tessera {

/// The texels of some points, as OpenGL takes them: by group of channels, point by point.
struct Texels {
    std::vector<std::vector<std::uint8_t>> codes;     ///< TexelCoding::texelBytes(group) a point
    std::vector<std::vector<std::uint8_t>> coverage;  ///< two bytes a point
};

/// How values stand in a pool's textures: channels in groups of kChannelsAGroup, each group in a texture of
/// codes (textureFormat()) and one of coverage (GL_RG8).
///
/// A code is ValueCoding's as a float, rounded to the nearest of the format (to even for r16f). Every texel
/// holds a number that may be interpolated: outside the mesh the value of the nearest mesh point, and the
/// code 0 where a value isn't finite. So the coverage has a texture in every format. Its texel's red is 0
/// outside the mesh (PointValues::covered), else (1 + a bit a channel of the group whose value isn't finite)
/// / 255; its green is surfaceCode() / 255.
class TexelCoding {
  public:
    /// @param codings of all channels, all of this format.
    TexelCoding(std::vector<ValueCoding> codings, SampleFormat format);

    SampleFormat format() const { return format_; }
    const std::vector<ValueCoding>& codings() const { return codings_; }
    int channels() const { return int(codings_.size()); }
    /// At least one, which then holds nothing but the coverage.
    std::size_t groupCount() const;
    /// Channels in a group, 0 to 4.
    int channelsOf(std::size_t group) const;

    GLenum internalFormat(std::size_t group) const { return textureFormat(format_, channelsOf(group)); }
    GLenum pixelFormat(std::size_t group) const { return channelsOf(group) <= 1 ? GL_RED : GL_RGBA; }
    GLenum pixelType() const;
    /// Bytes of a code texel.
    std::int64_t texelBytes(std::size_t group) const;
    /// Bytes of a point in all textures.
    std::int64_t pointBytes() const;

    Texels encode(const PointValues& points) const;

  private:
    void putCode(double value, int channel, std::uint8_t* to) const;

    std::vector<ValueCoding> codings_;
    SampleFormat format_;
};

/// A signed distance from the surface (PointValues::surface) in steps of kFarFromSurface / 127 voxels: 128
/// and above in the mesh. What is below 0 isn't rounded to 0.
std::uint8_t surfaceCode(float voxels);

/// The nearest half float, to even in the middle.
std::uint16_t halfFromFloat(float value);
float floatFromHalf(std::uint16_t half);

}  // namespace tessera
