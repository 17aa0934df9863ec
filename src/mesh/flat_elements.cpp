#include "mesh/flat_elements.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <unordered_set>

#include "mesh/geometry.h"

namespace tessera {

namespace {

using Face = std::array<std::int32_t, 3>;

/// Outward faces of a positively oriented element, face i opposite to corner i.
Face faceOf(const Tet& tet, std::size_t i) {
    constexpr std::size_t kNodes[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    return {tet[kNodes[i][0]], tet[kNodes[i][1]], tet[kNodes[i][2]]};
}

bool sameCycle(const Face& a, const Face& b) {
    return a == b || a == Face{b[1], b[2], b[0]} || a == Face{b[2], b[0], b[1]};
}

/// The other elements with this face.
std::vector<std::int32_t> neighboursAt(const TetComplex& complex, std::int32_t element, const Face& face) {
    std::vector<std::int32_t> neighbours = complex.elementsWith(face);
    std::erase(neighbours, element);
    return neighbours;
}

/// Whether both elements see their shared face from the same side, as neighbours never do.
bool disagree(const TetComplex& complex, const Face& face, std::int32_t other) {
    for (std::size_t i = 0; i < 4; ++i)
        if (sameCycle(face, faceOf(complex.tet(other), i))) return true;
    return false;
}

}  // namespace

void orientFlatElements(TetComplex& complex, const std::vector<std::int32_t>& flat) {
    std::unordered_set<std::int32_t> open(flat.begin(), flat.end());
    std::deque<std::int32_t> queue(flat.begin(), flat.end());
    while (!queue.empty()) {
        const std::int32_t e = queue.front();
        queue.pop_front();
        if (!open.contains(e)) continue;
        bool isKnown = false;
        for (std::size_t i = 0; i < 4 && !isKnown; ++i) {
            const Face face = faceOf(complex.tet(e), i);
            const std::vector<std::int32_t> neighbours = neighboursAt(complex, e, face);
            if (neighbours.size() != 1 || open.contains(neighbours[0])) continue;
            isKnown = true;
            if (disagree(complex, face, neighbours[0])) complex.flip(e);
        }
        if (!isKnown) continue;
        open.erase(e);
        for (std::size_t i = 0; i < 4; ++i)
            for (const std::int32_t neighbour : neighboursAt(complex, e, faceOf(complex.tet(e), i)))
                if (open.contains(neighbour)) queue.push_back(neighbour);
    }
}

bool isLooseFlatElement(const TetComplex& complex, std::int32_t element) {
    const Tet& tet = complex.tet(element);
    std::array<Vec3d, 4> normals;
    Vec3d largest{0};
    for (std::size_t i = 0; i < 4; ++i) {
        const Face face = faceOf(tet, i);
        const Vec3d& origin = complex.point(face[0]);
        normals[i] = glm::cross(complex.point(face[1]) - origin, complex.point(face[2]) - origin);
        if (glm::dot(normals[i], normals[i]) > glm::dot(largest, largest)) largest = normals[i];
    }
    bool above = false, below = false;
    int shared = 0;
    const double unit = glm::dot(largest, largest);
    for (std::size_t i = 0; i < 4; ++i) {
        if (neighboursAt(complex, element, faceOf(tet, i)).size() != 1) continue;
        ++shared;
        const double area = glm::dot(normals[i], largest);
        above = above || !(area < -1e-12 * unit);
        below = below || !(area > 1e-12 * unit);
    }
    return shared == 0 || !(above && below);
}

}  // namespace tessera
