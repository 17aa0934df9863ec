#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Sets the bytes of an element's nodes; several threads may.
inline void markNodes(const std::array<std::int32_t, 4>& tet, std::vector<std::uint8_t>& marks) {
    for (const std::int32_t node : tet) {
        // Reading first keeps the cache line shared once it is marked.
        std::atomic_ref<std::uint8_t> mark(marks[std::size_t(node)]);
        if (!mark.load(std::memory_order_relaxed)) mark.store(1, std::memory_order_relaxed);
    }
}

/// One byte a node: 1 where some element, flat or not, uses it.
std::vector<std::uint8_t> usedNodes(const TetMesh& mesh, const Execution& execution);
/// The same for elements that aren't flat.
std::vector<std::uint8_t> nodesOfVolumes(const TetMesh& mesh, const Execution& execution);

}  // namespace tessera
