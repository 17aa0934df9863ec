#include "surface/shell_of_place.h"

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace tessera {

ShellOfPlace findShell(const Surface& surface, const SurfaceShells& shells, const Vec3d& placeWorld) {
    constexpr double kOnSurface =
        1e-3;  // off a whole number of turns, as only places on edges and corners are
    constexpr double kNearlyFlat = 1e-9;
    ShellOfPlace found;
    std::vector<double> turns(shells.shells.size());
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
        std::array<Vec3d, 3> to;
        std::array<double, 3> length;
        for (std::size_t i = 0; i < 3; ++i) {
            to[i] = surface.points[std::size_t(surface.triangles[t][i])] - placeWorld;
            length[i] = glm::length(to[i]);
        }
        const double across = length[0] * length[1] * length[2] + glm::dot(to[0], to[1]) * length[2] +
                              glm::dot(to[1], to[2]) * length[0] + glm::dot(to[2], to[0]) * length[1];
        const double along = glm::dot(to[0], glm::cross(to[1], to[2]));
        // Half a turn of one triangle alone: the place lies on it.
        found.isOnSurface |= across < 0 && std::abs(along) <= kNearlyFlat * -across;
        turns[std::size_t(shells.shellOf[t])] += std::atan2(along, across) / (2 * std::numbers::pi);
    }
    for (std::size_t s = 0; s < turns.size(); ++s) {
        found.isOnSurface |= std::abs(turns[s] - std::round(turns[s])) > kOnSurface;
        if (std::abs(turns[s]) > 0.5 &&
            (found.shell < 0 || shells.shells[s].around > shells.shells[std::size_t(found.shell)].around))
            found.shell = std::int32_t(s);
    }
    return found;
}

}  // namespace tessera
