#include "mesh/shape_statistics.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>

#include "base/parallel.h"
#include "mesh/element_class.h"

namespace tessera {

namespace {

constexpr std::int64_t kChunk = 1 << 14;

void add(const Corners& corners, ShapeStatistics& shapes) {
    ++shapes.elements;
    const double aspect = std::sqrt(2.0 / 3.0) / aspectOf(corners);
    const auto bin =
        std::upper_bound(kAspectBins.begin() + 1, kAspectBins.end(), aspect) - kAspectBins.begin() - 1;
    ++shapes.aspects[std::size_t(bin)];
    shapes.largestAspect = std::max(shapes.largestAspect, aspect);
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = 0; j < i; ++j) {
            // The angle at edge i-j is that between the parts of the other two corners across it.
            const std::size_t k = i != 0 && j != 0 ? 0 : i != 1 && j != 1 ? 1 : 2, l = 6 - i - j - k;
            const Vec3d edge = glm::normalize(corners[j] - corners[i]);
            const Vec3d u = glm::cross(edge, corners[k] - corners[i]),
                        v = glm::cross(edge, corners[l] - corners[i]);
            const double degrees =
                std::atan2(glm::length(glm::cross(u, v)), glm::dot(u, v)) * 180 / std::numbers::pi;
            if (!(degrees >= 0)) continue;  // of an edge without length
            ++shapes.dihedrals[std::min<std::size_t>(std::size_t(degrees / 10), shapes.dihedrals.size() - 1)];
            shapes.smallestDihedral = std::min(shapes.smallestDihedral, degrees);
            shapes.largestDihedral = std::max(shapes.largestDihedral, degrees);
        }
}

}  // namespace

ShapeStatistics measureShapes(const TetMesh& mesh, const Execution& execution) {
    ShapeStatistics all;
    all.smallestDihedral = 180;
    std::mutex mutex;
    parallelForChunks(execution, mesh.elementCount(), kChunk, [&](std::int64_t begin, std::int64_t end) {
        ShapeStatistics part;
        part.smallestDihedral = 180;
        for (std::int64_t e = begin; e < end; ++e) add(cornersOf(mesh, e), part);
        const std::lock_guard lock(mutex);
        all.elements += part.elements;
        for (std::size_t b = 0; b < all.aspects.size(); ++b) all.aspects[b] += part.aspects[b];
        for (std::size_t b = 0; b < all.dihedrals.size(); ++b) all.dihedrals[b] += part.dihedrals[b];
        all.largestAspect = std::max(all.largestAspect, part.largestAspect);
        all.smallestDihedral = std::min(all.smallestDihedral, part.smallestDihedral);
        all.largestDihedral = std::max(all.largestDihedral, part.largestDihedral);
    });
    return all;
}

}  // namespace tessera
