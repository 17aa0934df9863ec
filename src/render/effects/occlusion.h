#pragma once

#include <optional>

#include "render/effect.h"

namespace tessera {

/// Makes samples darker that lie in hollows: by the opacity in a sphere around them. (F. Hernell, P. Ljung,
/// A. Ynnerman, Local Ambient Occlusion in Direct Volume Rendering, 2010.)
struct Occlusion {
    std::optional<double> radiusWorld;
    double radiusVoxels = 8;  ///< without that: in spacings of the finest bricks
    double strength = 0.8;    ///< how dark a sample becomes that no light comes to, from 0 to 1
};
Effect occlusionEffect(const Occlusion& occlusion);

}  // namespace tessera
