#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace tessera {

/// Red, green and blue, each multiplied by the opacity, and the opacity, from 0 to 1.
using Rgba = std::array<float, 4>;

/// A picture before any ground, row by row from the top left.
struct RgbaImage {
    int width = 0;
    int height = 0;
    std::vector<Rgba> pixels;  ///< width x height

    std::size_t offset(int x, int y) const { return std::size_t(y) * std::size_t(width) + std::size_t(x); }
    const Rgba& at(int x, int y) const { return pixels[offset(x, y)]; }
    Rgba& at(int x, int y) { return pixels[offset(x, y)]; }
};

}  // namespace tessera
