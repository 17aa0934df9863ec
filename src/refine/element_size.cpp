#include "refine/element_size.h"

#include <algorithm>

#include "base/parallel.h"
#include "brick/overlap.h"

namespace tessera {

std::vector<float> elementSizes(const TetMesh& mesh, double unit, const std::optional<Box3d>& boundsWorld,
                                const Execution& execution) {
    std::vector<float> sizes(mesh.tets.size());
    parallelForChunks(execution, mesh.elementCount(), 16384, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
            prefetchNodes(mesh, std::min(e + kPrefetchElements, mesh.elementCount() - 1));
            if (boundsWorld &&
                !ElementOverlap(elementInIndexSpace(mesh, e, Vec3d(0), 1)).touches(*boundsWorld))
                continue;
            const auto nodes = elementInIndexSpace(mesh, e, Vec3d(0), unit);
            double product = 1;
            for (std::size_t a = 0; a < 4; ++a)
                for (std::size_t b = a + 1; b < 4; ++b) {
                    const Vec3d edge = nodes[b] - nodes[a];
                    product *= glm::dot(edge, edge);
                }
            sizes[std::size_t(e)] = float(std::pow(product, 1.0 / 12));
        }
    });
    return sizes;
}

}  // namespace tessera
