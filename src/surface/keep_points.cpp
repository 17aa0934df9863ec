#include "surface/keep_points.h"

namespace tessera {

void keepPoints(std::span<const char> isKept, Surface& surface) {
    std::vector<std::int32_t> number(isKept.size());
    std::size_t kept = 0;
    for (std::size_t p = 0; p < isKept.size(); ++p) {
        if (!isKept[p]) continue;
        number[p] = std::int32_t(kept);
        surface.points[kept] = surface.points[p];
        for (Field& field : surface.fields)
            for (std::size_t c = 0, n = std::size_t(field.components); c < n; ++c)
                field.values[kept * n + c] = field.values[p * n + c];
        ++kept;
    }
    surface.points.resize(kept);
    for (Field& field : surface.fields) field.values.resize(kept * std::size_t(field.components));
    for (auto& triangle : surface.triangles)
        for (std::int32_t& corner : triangle) corner = number[std::size_t(corner)];
}

}  // namespace tessera
