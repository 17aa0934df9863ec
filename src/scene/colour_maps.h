#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

namespace tessera {

/// viridis, cividis, magma, turbo, cool-warm, gray.
std::span<const std::string_view> colourMapNames();
bool isColourMap(std::string_view name);
/// Red, green and blue from 0 to 1 for a share from 0 to 1, linear between ten colours or so of each map.
std::array<double, 3> mappedColour(std::string_view map, double share);

}  // namespace tessera
