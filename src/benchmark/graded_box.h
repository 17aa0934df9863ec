#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "reference/generators.h"
#include "tessera/mesh.h"

namespace tessera {

/// A jittered box whose cells grow from a corner: sizes differ tenfold along each axis.
inline TetMesh gradedBox(std::int64_t elements) {
    const int cells = std::max(2, int(std::lround(std::cbrt(double(elements) / 6))));
    TetMesh mesh = boxMesh({.cells = Vec3i(cells), .jitter = 0.2});
    for (Vec3d& p : mesh.points)
        for (int a = 0; a < 3; ++a) p[a] = (std::exp(2.3 * p[a]) - 1) / 9;
    Field field{"f", FieldLocation::point, 1, {}};
    for (const Vec3d& p : mesh.points) field.values.push_back(std::sin(7 * p.x) + p.y * p.z);
    mesh.fields.push_back(std::move(field));
    return mesh;
}

}  // namespace tessera
