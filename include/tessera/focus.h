#pragma once

#include <vector>

#include "tessera/vec.h"

namespace tessera {

/// The places p with dot(normal, p) >= offset, world units.
struct HalfSpace {
    Vec3d normalWorld{0, 0, 1};
    double offsetWorld = 0;
};

/// A place where bricks are to be fine. With h_0 the finest spacing, the spacing wished at a distance d from
/// the place is h_0 max(1, d / r): h_0 up to the distance r, and then in proportion to the distance.
struct Focus {
    /// The place: a point is a box without extent.
    Box3d boxWorld{};
    /// Distances count from the surface that lies so far around the box; with a point, that of a ball.
    double roundingWorld = 0;
    /// r, above 0.
    double radiusWorld = 1;
    /// Only where all of these hold; elsewhere nothing is wished.
    std::vector<HalfSpace> within{};

    friend bool operator==(const Focus&, const Focus&);
};

/// A point, or with `ballWorld` a ball around it.
Focus pointFocus(const Vec3d& pointWorld, double radiusWorld, double ballWorld = 0);
Focus boxFocus(const Box3d& boxWorld, double radiusWorld);

/// How a picture is taken: by rays from the eye, or by parallel ones.
struct Camera {
    /// With parallel rays the middle of the plane that they start from.
    Vec3d eyeWorld{0};
    /// Any length but 0.
    Vec3d forwardWorld{0, 0, -1};
    /// Not along `forwardWorld`.
    Vec3d upWorld{0, 1, 0};
    /// Opening angle from the lower to the upper border, in degrees, above 0 and below 180.
    double openingDegrees = 45;
    int widthPixels = 1024;
    int heightPixels = 1024;
    /// Above 0: rays are parallel, and the picture is so high; the opening doesn't count.
    double heightWorld = 0;
};

/// What a camera sees, as fine as its pixels and no finer than `finestSpacingWorld`: the distance between
/// neighbouring pixels is proportional to that from the eye. With parallel rays it is one for all, and what
/// is seen is a box without an end. Throws InputError for a camera that sees nothing.
Focus cameraFocus(const Camera& camera, double finestSpacingWorld);

}  // namespace tessera
