#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "brick/depth.h"
#include "tessera/vec.h"

namespace tessera {

/// From where bricks are looked at.
struct Viewpoint {
    Vec3d place{0};      ///< the eye, in bricks of depth 0 from the lattice's origin
    Vec3d direction{0};  ///< of parallel rays, which have no eye; zero: rays start at `place`
};

/// An order in which no brick hides one before it: the nearest first. @param leaves disjoint bricks of any
/// depths. Returns indices into it; the same for the same leaves in any order.
std::vector<std::size_t> visibilityOrder(std::span<const DepthKey> leaves, const Viewpoint& from);

}  // namespace tessera
