#pragma once

#include "tessera/focus.h"

namespace tessera {

/// How a camera stands: three directions of length 1 at right angles, and the tangents of half its opening
/// angles. The ray through (u, v) of the picture, each from -1 to 1, right and up, runs along
/// forward + u wide right + v high up.
struct CameraView {
    Vec3d forward, right, up;
    double wide = 1, high = 1;

    /// Of the middle of a pixel counted from the top left; length 1.
    Vec3d directionOf(const Camera& camera, int x, int y) const {
        const double u = (2.0 * x + 1) / camera.widthPixels - 1, v = 1 - (2.0 * y + 1) / camera.heightPixels;
        return glm::normalize(forward + u * wide * right + v * high * up);
    }
};

/// Throws InputError for a camera that sees nothing.
CameraView viewOf(const Camera& camera);

}  // namespace tessera
