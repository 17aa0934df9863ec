#pragma once

#include "render/effect.h"

namespace tessera {

/// Shadows in the volume, of light from one direction. A pass of its own makes a grid along the light's rays
/// and goes through it layer by layer.
struct Shadows {
    Vec3d towardsLight{0, 0, 1};  ///< any length but 0
    double strength = 0.7;        ///< how dark a sample becomes that no light comes to, from 0 to 1
    int resolution = 128;         ///< cells of the grid along the longest side of the volume, 8 to 512
};
/// Throws InputError for options out of range.
Effect shadowsEffect(const Shadows& shadows);

}  // namespace tessera
