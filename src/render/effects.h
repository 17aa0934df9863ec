#pragma once

#include <array>
#include <vector>

#include "render/effect.h"
#include "tessera/vec.h"

namespace tessera {

/// Light on the volume, by the slope of the values: light from one direction, as Blinn and Phong have it.
/// Where values hardly change the colour stays as it is.
struct Shading {
    Vec3d towardsLight{0};  ///< any length; 0: the light is at the camera
    double ambient = 0.35, diffuse = 0.65, specular = 0.2, shininess = 30;
};
Effect shadingEffect(const Shading& shading);

/// A surface where the field has one value.
struct Isosurface {
    double value = 0;
    std::array<double, 3> color{0.85, 0.85, 0.85};
    double opacity = 1;
};
/// At most 16. A surface is where the values at a slab's two planes lie on either side; it is lit.
Effect isosurfacesEffect(std::vector<Isosurface> surfaces, const Vec3d& towardsLight = Vec3d(0));

/// The edges of the bricks that are drawn, a colour for each depth.
struct BrickEdges {
    double widthPixels = 1.5;
    double opacity = 0.8;
};
Effect brickEdgesEffect(const BrickEdges& edges);

}  // namespace tessera
