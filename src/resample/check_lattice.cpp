#include "resample/check_lattice.h"

#include <cmath>
#include <limits>

#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kIndexLimit = 1 << 30;

}  // namespace

void checkLattice(const Lattice& lattice, std::span<const IndexBox> boxes) {
    const Vec3d* steps[3] = {&lattice.uWorld, &lattice.vWorld, &lattice.wWorld};
    for (int a = 0; a < 3; ++a) {
        const double length = glm::length(*steps[a]);
        if (!(length > 0) || !std::isfinite(length) || !std::isfinite(lattice.originWorld[a]))
            throw InputError("the lattice's origin must be finite and its spacing positive and finite");
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
