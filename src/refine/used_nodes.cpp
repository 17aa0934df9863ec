#include "refine/used_nodes.h"

#include "base/parallel.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

template <class Counts>
std::vector<std::uint8_t> nodesOfElements(const TetMesh& mesh, const Execution& execution,
                                          const Counts& counts) {
    constexpr std::int64_t kChunk = 65536;
    std::vector<std::uint8_t> used(mesh.points.size(), 0);
    parallelForChunks(execution, mesh.elementCount(), kChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
            const auto& tet = mesh.tets[std::size_t(e)];
            if (counts(tet)) markNodes(tet, used);
        }
    });
    return used;
}

}  // namespace

std::vector<std::uint8_t> usedNodes(const TetMesh& mesh, const Execution& execution) {
    return nodesOfElements(mesh, execution, [](const auto&) { return true; });
}

std::vector<std::uint8_t> nodesOfVolumes(const TetMesh& mesh, const Execution& execution) {
    return nodesOfElements(mesh, execution, [&](const auto& tet) {
        return volumeSign(mesh.points[std::size_t(tet[0])], mesh.points[std::size_t(tet[1])],
                          mesh.points[std::size_t(tet[2])], mesh.points[std::size_t(tet[3])]) != 0;
    });
}

}  // namespace tessera
