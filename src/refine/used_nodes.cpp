#include "refine/used_nodes.h"

#include <atomic>

#include "base/parallel.h"

namespace tessera {

std::vector<std::uint8_t> usedNodes(const TetMesh& mesh, const Execution& execution) {
    constexpr std::int64_t kChunk = 65536;
    std::vector<std::uint8_t> used(mesh.points.size(), 0);
    parallelForChunks(execution, mesh.elementCount(), kChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e)
            for (const std::int32_t node : mesh.tets[std::size_t(e)]) {
                // Reading first keeps the cache line shared once it is marked.
                std::atomic_ref<std::uint8_t> mark(used[std::size_t(node)]);
                if (!mark.load(std::memory_order_relaxed)) mark.store(1, std::memory_order_relaxed);
            }
    });
    return used;
}

}  // namespace tessera
