#include "surface/winding_number.h"

#include <array>
#include <cmath>
#include <numbers>

namespace tessera {

double windingNumber(const Surface& surface, const Vec3d& placeWorld) {
    double angle = 0;
    for (const auto& triangle : surface.triangles) {
        std::array<Vec3d, 3> to;
        std::array<double, 3> length;
        for (std::size_t i = 0; i < 3; ++i) {
            to[i] = surface.points[std::size_t(triangle[i])] - placeWorld;
            length[i] = glm::length(to[i]);
        }
        angle += 2 * std::atan2(glm::dot(to[0], glm::cross(to[1], to[2])),
                                length[0] * length[1] * length[2] + glm::dot(to[0], to[1]) * length[2] +
                                    glm::dot(to[1], to[2]) * length[0] + glm::dot(to[2], to[0]) * length[1]);
    }
    return angle / (4 * std::numbers::pi);
}

}  // namespace tessera
