#pragma once

#include <cstddef>
#include <cstdint>

#include "tessera/vec.h"

namespace tessera {

/// Where the slots of a pool lie: in atlases, 3D textures of one size, each of slots.x * slots.y * slots.z
/// slots of `edge`^3 texels. Slot s is number s % slotsAnAtlas() of atlas s / slotsAnAtlas(), in the order
/// x, y, z with x the fastest, and its first texel is `edge` times its place there.
struct SlotLayout {
    int edge = 0;
    Vec3i slots{0};  ///< of an atlas, along each axis
    int atlases = 0;

    std::uint32_t slotsAnAtlas() const { return std::uint32_t(slots.x * slots.y * slots.z); }
    std::size_t capacity() const { return std::size_t(slotsAnAtlas()) * std::size_t(atlases); }
    Vec3i texels() const { return slots * edge; }

    int atlasOf(std::uint32_t slot) const { return int(slot / slotsAnAtlas()); }
    /// The slot's first texel in its atlas.
    Vec3i firstTexel(std::uint32_t slot) const {
        const int n = int(slot % slotsAnAtlas());
        return Vec3i(n % slots.x, n / slots.x % slots.y, n / (slots.x * slots.y)) * edge;
    }
};

/// What textures may be.
struct AtlasLimits {
    int texels = 2048;                           ///< along an edge
    std::int64_t bytes = std::int64_t(1) << 30;  ///< of one texture; some drivers refuse more
    int atlases = 16;                            ///< a shader has so many units to spare
};

/// The layout with the most slots whose texels take no more than the budget; few atlases, nearly cubes.
/// @param edge texels along a slot's edge. @param texelBytes of all textures of an atlas together.
/// @param largestTexelBytes of that texture whose texels are largest. Throws InputError when there is no room
/// for a slot.
SlotLayout chooseSlotLayout(int edge, std::int64_t texelBytes, std::int64_t largestTexelBytes,
                            std::int64_t budgetBytes, const AtlasLimits& limits);

}  // namespace tessera
