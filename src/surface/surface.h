#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tessera/mesh.h"

namespace tessera {

/// A surface of triangles; without any scattered points. Triangles of a closed surface run counterclockwise
/// when they are seen from outside.
struct Surface {
    /// World units.
    std::vector<Vec3d> points;
    /// Point indices, each in [0, points.size()).
    std::vector<std::array<std::int32_t, 3>> triangles;
    /// At the points.
    std::vector<Field> fields;
};

/// A place that stands for the part of a volume around it, which surfaces bound.
struct RegionSeed {
    Vec3d placeWorld{0};
    /// Edge length wished for in it, world units; 0: no wish of its own.
    double sizeWorld = 0;
};

}  // namespace tessera
