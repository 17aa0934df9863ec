#include "tessera/focus.h"

#include <algorithm>
#include <cmath>

#include "refine/camera_view.h"

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
    const CameraView view = viewOf(camera);
    const Vec3d &forward = view.forward, &side = view.right, &up = view.up;
    const double wide = view.wide, high = view.high;
    if (view.isParallel) {
        // From so far away all that is seen is at one distance.
        const double far = 0x1p20 * camera.heightWorld, pixel = camera.heightWorld / camera.heightPixels;
        Focus focus = pointFocus(camera.eyeWorld - far * forward, far * finestSpacingWorld / pixel);
        const auto add = [&](const Vec3d& normal, double before) {
            focus.within.push_back({normal, glm::dot(normal, camera.eyeWorld) - before});
        };
        add(forward, 0);
        for (const double sign : {-1.0, 1.0}) add(sign * side, wide), add(sign * up, high);
        return focus;
    }
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
