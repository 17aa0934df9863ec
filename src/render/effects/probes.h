#pragma once

#include <vector>

#include "render/effect.h"
#include "tessera/focus.h"

namespace tessera {

/// What a probe is made of: a shape, or a combination of others. (TetSplat of K. Museth and S. Lombeyda,
/// 2004, has such probes.)
struct ProbeShape {
    enum Kind { plane, ball, box, unite, common, subtract };
    Kind kind = plane;
    HalfSpace half{};      ///< `plane`: what lies in the half-space
    Vec3d centerWorld{0};  ///< `ball`
    double radiusWorld = 1;
    Box3d boxWorld{};
    /// Of a combination, one at least; `subtract` takes the others from the first.
    std::vector<ProbeShape> parts{};
};

struct Probes {
    ProbeShape shape;
    bool keepsInside = false;  ///< takes away what is outside of the shape
    double opacity = 1;        ///< of the surface where the volume is cut
    bool isLit = false;
    Vec3d towardsLight{0};  ///< any length; 0: the light is at the camera
};

/// Takes a part of the volume away; where it is cut the surface has the field's colours, on both sides.
/// Throws InputError for more than 16 shapes in all, or 64 with their combinations, and for none.
Effect probesEffect(const Probes& probes);

}  // namespace tessera
