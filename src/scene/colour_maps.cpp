#include "scene/colour_maps.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "base/check.h"

namespace tessera {

namespace {

struct ColourMap {
    std::string_view name;
    std::vector<std::uint32_t> colours;  // 0xrrggbb, evenly spaced
};

const std::vector<ColourMap>& colourMaps() {
    static const std::vector<ColourMap> maps{
        {"viridis",
         {0x440154, 0x482878, 0x3e4989, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b,
          0xfde725}},
        {"cividis",
         {0x00224e, 0x123570, 0x3b496c, 0x575d6d, 0x707173, 0x8a8678, 0xa59c74, 0xc3b369, 0xe1cc55,
          0xfee838}},
        {"magma",
         {0x000004, 0x180f3d, 0x440f76, 0x721f81, 0x9e2f7f, 0xcd4071, 0xf1605d, 0xfd9668, 0xfeca8d,
          0xfcfdbf}},
        {"turbo",
         {0x30123b, 0x4145ab, 0x4675ed, 0x39a2fc, 0x1bcfd4, 0x24eca6, 0x61fc6c, 0xa4fc3b, 0xd1e834, 0xf3c63a,
          0xfe9b2d, 0xf36315, 0xd93806, 0xb11901, 0x7a0402}},
        {"cool-warm",
         {0x3b4cc0, 0x6788ee, 0x9abbff, 0xc9d7f0, 0xdddddd, 0xedd1c2, 0xf7a889, 0xe26952, 0xb40426}},
        {"gray", {0x000000, 0xffffff}}};
    return maps;
}

const ColourMap* findMap(std::string_view name) {
    for (const ColourMap& map : colourMaps())
        if (map.name == name) return &map;
    return nullptr;
}

}  // namespace

std::span<const std::string_view> colourMapNames() {
    static const std::vector<std::string_view> names = [] {
        std::vector<std::string_view> all;
        for (const ColourMap& map : colourMaps()) all.push_back(map.name);
        return all;
    }();
    return names;
}

bool isColourMap(std::string_view name) {
    return findMap(name) != nullptr;
}

std::array<double, 3> mappedColour(std::string_view name, double share) {
    const ColourMap* map = findMap(name);
    TESSERA_CHECK(map != nullptr, "a colour map that there isn't");
    const double at = std::clamp(share, 0.0, 1.0) * double(map->colours.size() - 1);
    const std::size_t below = std::min(std::size_t(at), map->colours.size() - 2);
    std::array<double, 3> colour{};
    for (std::size_t c = 0; c < 3; ++c) {
        const auto part = [&](std::size_t i) { return double(map->colours[i] >> (16 - 8 * c) & 255) / 255; };
        colour[c] = part(below) + (at - double(below)) * (part(below + 1) - part(below));
    }
    return colour;
}

}  // namespace tessera
