#pragma once

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

}  // namespace tessera
