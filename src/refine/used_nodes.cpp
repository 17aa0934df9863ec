#include "refine/used_nodes.h"

#include <atomic>

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
            if (!counts(tet)) continue;
            for (const std::int32_t node : tet) {
                // Reading first keeps the cache line shared once it is marked.
                std::atomic_ref<std::uint8_t> mark(used[std::size_t(node)]);
                if (!mark.load(std::memory_order_relaxed)) mark.store(1, std::memory_order_relaxed);
            }
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
