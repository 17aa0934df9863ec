#include "resample/check_lattice.h"

#include <cmath>
#include <limits>

#include "base/text.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kIndexLimit = 1 << 30;

}  // namespace

void checkSpacing(double spacingWorld) {
    if (isPossibleSpacing(spacingWorld)) return;
    throw InputError("a spacing of " + shortNumber(spacingWorld, 6) + " is too " +
                     (spacingWorld < 1 ? "small" : "large") + " for coordinates to be resolved: those from " +
                     shortNumber(kLeastSpacing, 6) + " to " + shortNumber(kLargestSpacing, 6) +
                     " can be computed with; give the mesh other units");
}

void checkLattice(const Lattice& lattice, std::span<const IndexBox> boxes) {
    const Vec3d* steps[3] = {&lattice.uWorld, &lattice.vWorld, &lattice.wWorld};
    for (int a = 0; a < 3; ++a) {
        const double length = std::hypot(steps[a]->x, steps[a]->y, steps[a]->z);
        if (!(length > 0) || !std::isfinite(length) || !std::isfinite(lattice.originWorld[a]))
            throw InputError("the lattice's origin must be finite and its spacing positive and finite");
        checkSpacing(length);
    }
    const double volume = glm::dot(lattice.uWorld, glm::cross(lattice.vWorld, lattice.wWorld));
    const double cube =
        glm::length(lattice.uWorld) * glm::length(lattice.vWorld) * glm::length(lattice.wWorld);
    if (!(std::fabs(volume) > 1e-9 * cube))
        throw InputError("the lattice's steps u, v and w must not lie in one plane");
    for (const IndexBox& box : boxes) {
        if (box.count() > std::numeric_limits<std::int32_t>::max())
            throw InputError("a box may hold at most 2^31 - 1 lattice points; sample it in parts");
        for (int a = 0; a < 3; ++a)
            if (box.min[a] < -kIndexLimit || box.max[a] > kIndexLimit || box.min[a] > box.max[a])
                throw InputError("lattice indices must lie between -2^30 and 2^30; choose a larger spacing");
    }
}

}  // namespace tessera
