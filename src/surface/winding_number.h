#pragma once

#include "surface/surface.h"

namespace tessera {

/// How often a closed surface runs around a place, in double: 1 in a part that looks outwards, 0 outside and
/// in a cavity, 2 in a part within a part. In between on the surface. After: A. van Oosterom and J. Strackee,
/// The Solid Angle of a Plane Triangle, IEEE Transactions on Biomedical Engineering 1983.
double windingNumber(const Surface& surface, const Vec3d& placeWorld);

}  // namespace tessera
