#pragma once

#include <array>

#include "tessera/vec.h"

namespace tessera {

/// A part of the picture, in rays from its top left.
struct PictureTile {
    int x = 0, y = 0, width = 0, height = 0;
};

/// Where a tile's pixels, counted from its bottom left, lie in the picture from -1 to 1, right and up: scale
/// and offset. @param picture its rays, right and down.
inline std::array<float, 4> pictureFromPixel(const PictureTile& tile, const Vec3i& picture) {
    const double wide = picture.x, high = picture.y;
    return {float(2 / wide), float(2 / high), float(2 * tile.x / wide - 1),
            float(2 * (high - tile.y - tile.height) / high - 1)};
}

}  // namespace tessera
