#pragma once

#include <cstdint>

#include "surface/check_surface.h"

namespace tessera {

/// Where a place lies among the shells of a surface.
struct ShellOfPlace {
    std::int32_t shell = -1;   ///< the innermost around it; -1: none
    bool isOnSurface = false;  ///< so close to it that double can't tell
};

/// By how often each shell runs around the place. After: A. van Oosterom and J. Strackee, The Solid Angle of
/// a Plane Triangle, IEEE Transactions on Biomedical Engineering 1983.
ShellOfPlace findShell(const Surface& surface, const SurfaceShells& shells, const Vec3d& placeWorld);

}  // namespace tessera
