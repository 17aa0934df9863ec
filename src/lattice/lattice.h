#pragma once

#include <vector>

#include "base/vec.h"

namespace tessera {

/// A frame of sample points: lattice point (i, j, k) is the real number origin + i u + j v + k w, never its
/// rounding. Bricks use axis-parallel frames with one spacing; a cut plane is a frame of any orientation used
/// with one layer.
struct Lattice {
    Vec3d originWorld{0};
    Vec3d uWorld{1, 0, 0};
    Vec3d vWorld{0, 1, 0};
    Vec3d wWorld{0, 0, 1};

    static Lattice axisParallel(const Vec3d& originWorld, double spacingWorld) {
        return {originWorld, {spacingWorld, 0, 0}, {0, spacingWorld, 0}, {0, 0, spacingWorld}};
    }
    /// u, v and w lie along x, y and z, each with a positive length.
    bool isAxisParallel() const;
    /// Rounded world place of a lattice point.
    Vec3d worldFromIndex(const Vec3d& index) const {
        return originWorld + index.x * uWorld + index.y * vWorld + index.z * wWorld;
    }
    friend bool operator==(const Lattice&, const Lattice&) = default;
};

}  // namespace tessera
