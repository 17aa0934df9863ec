#include "refine/node_set.h"

#include "base/parallel.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

template <class Counts>
NodeSet nodesOfElements(const TetMesh& mesh, const Execution& execution, const Counts& counts) {
    constexpr std::int64_t kChunk = 65536;
    NodeSet nodes(mesh.points.size());
    parallelForChunks(execution, mesh.elementCount(), kChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
            const auto& tet = mesh.tets[std::size_t(e)];
            if (counts(tet)) nodes.insert(tet);
        }
    });
    return nodes;
}

}  // namespace

NodeSet usedNodes(const TetMesh& mesh, const Execution& execution) {
    return nodesOfElements(mesh, execution, [](const auto&) { return true; });
}

NodeSet nodesOfVolumes(const TetMesh& mesh, const Execution& execution) {
    return nodesOfElements(mesh, execution, [&](const auto& tet) {
        return volumeSign(mesh.points[std::size_t(tet[0])], mesh.points[std::size_t(tet[1])],
                          mesh.points[std::size_t(tet[2])], mesh.points[std::size_t(tet[3])]) != 0;
    });
}

}  // namespace tessera
