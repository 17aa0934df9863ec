#include "tessera/focus.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tessera/error.h"

namespace tessera {

bool operator==(const Focus& a, const Focus& b) {
    const auto same = [](const HalfSpace& x, const HalfSpace& y) {
        return x.normalWorld == y.normalWorld && x.offsetWorld == y.offsetWorld;
    };
    return a.boxWorld.min == b.boxWorld.min && a.boxWorld.max == b.boxWorld.max &&
           a.roundingWorld == b.roundingWorld && a.radiusWorld == b.radiusWorld &&
           std::equal(a.within.begin(), a.within.end(), b.within.begin(), b.within.end(), same);
}

Focus pointFocus(const Vec3d& pointWorld, double radiusWorld, double ballWorld) {
    return {{pointWorld, pointWorld}, ballWorld, radiusWorld, {}};
}

Focus boxFocus(const Box3d& boxWorld, double radiusWorld) {
    return {boxWorld, 0, radiusWorld, {}};
}

Focus cameraFocus(const Camera& camera, double finestSpacingWorld) {
    const double half = camera.openingDegrees * std::numbers::pi / 360;
    constexpr double kFar = std::numeric_limits<double>::infinity();
    const Vec3d right = glm::cross(camera.forwardWorld, camera.upWorld);
    if (!(half > 0 && half < std::numbers::pi / 2) || camera.widthPixels < 1 || camera.heightPixels < 1 ||
        !(glm::length(camera.eyeWorld) < kFar) || !(glm::length(right) > 0) || !(glm::length(right) < kFar))
        throw InputError(
            "a camera needs an opening between 0 and 180 degrees, pixels, and a direction forward that isn't "
            "the one up");
    const Vec3d forward = glm::normalize(camera.forwardWorld), side = glm::normalize(right),
                up = glm::cross(side, forward);
    const double high = std::tan(half), wide = high * camera.widthPixels / camera.heightPixels;
    // At the distance r a pixel is as large as the finest spacing.
    Focus focus = pointFocus(camera.eyeWorld, finestSpacingWorld * camera.heightPixels / (2 * high));
    for (const Vec3d& normal :
         {forward, forward * wide - side, forward * wide + side, forward * high - up, forward * high + up}) {
        const Vec3d n = glm::normalize(normal);
        focus.within.push_back({n, glm::dot(n, camera.eyeWorld)});
    }
    return focus;
}

}  // namespace tessera
