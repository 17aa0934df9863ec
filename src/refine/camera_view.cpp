#include "refine/camera_view.h"

#include <cmath>
#include <limits>
#include <numbers>

#include "tessera/error.h"

namespace tessera {

CameraView viewOf(const Camera& camera) {
    const double half = camera.openingDegrees * std::numbers::pi / 360;
    constexpr double kFar = std::numeric_limits<double>::infinity();
    const Vec3d right = glm::cross(camera.forwardWorld, camera.upWorld);
    const bool isParallel = camera.heightWorld > 0;
    if (!(isParallel || (half > 0 && half < std::numbers::pi / 2)) || !(camera.heightWorld >= 0) ||
        !(camera.heightWorld < kFar) || camera.widthPixels < 1 || camera.heightPixels < 1 ||
        !(glm::length(camera.eyeWorld) < kFar) || !(glm::length(right) > 0) || !(glm::length(right) < kFar))
        throw InputError(
            "a camera needs an opening between 0 and 180 degrees or a height, pixels, and a direction "
            "forward that isn't the one up");
    CameraView view;
    view.forward = glm::normalize(camera.forwardWorld);
    view.right = glm::normalize(right);
    view.up = glm::cross(view.right, view.forward);
    view.isParallel = isParallel;
    view.high = isParallel ? camera.heightWorld / 2 : std::tan(half);
    view.wide = view.high * camera.widthPixels / camera.heightPixels;
    return view;
}

}  // namespace tessera
