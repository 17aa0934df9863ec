#pragma once

#include <array>
#include <vector>

#include "render/effect.h"
#include "tessera/vec.h"

namespace tessera {

/// A surface where the field has one value.
struct Isosurface {
    double value = 0;
    std::array<double, 3> color{0.85, 0.85, 0.85};
    double opacity = 1;
};
/// At most 16. A surface is where the values at a slab's two planes lie on either side; it is lit.
Effect isosurfacesEffect(std::vector<Isosurface> surfaces, const Vec3d& towardsLight = Vec3d(0));

}  // namespace tessera
