#pragma once

#include "tessera/focus.h"

namespace tessera {

/// A ray, world units; `direction` has length 1.
struct ViewRay {
    Vec3d originWorld, direction;
};

/// How a camera stands: three directions of length 1 at right angles, and the tangents of half its opening
/// angles, or with parallel rays half its width and height. The ray through (u, v) of the picture, each from
/// -1 to 1, right and up, runs along forward + u wide right + v high up; parallel ones run along forward from
/// the eye + u wide right + v high up.
struct CameraView {
    Vec3d forward, right, up;
    double wide = 1, high = 1;
    bool isParallel = false;

    /// Through the middle of a pixel counted from the top left.
    ViewRay rayOf(const Camera& camera, int x, int y) const { return rayOf(camera, x + 0.5, y + 0.5); }
    /// Through a place of the picture in pixels from the top left.
    ViewRay rayOf(const Camera& camera, double x, double y) const {
        const double u = 2 * x / camera.widthPixels - 1, v = 1 - 2 * y / camera.heightPixels;
        const Vec3d across = u * wide * right + v * high * up;
        if (isParallel) return {camera.eyeWorld + across, forward};
        return {camera.eyeWorld, glm::normalize(forward + across)};
    }
};

/// Throws InputError for a camera that sees nothing.
CameraView viewOf(const Camera& camera);

}  // namespace tessera
