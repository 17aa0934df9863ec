#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Some nodes of a mesh, a byte each: it is told in one instruction whether a node is there, and one is
/// inserted without a lock.
class NodeSet {
  public:
    NodeSet() = default;
    explicit NodeSet(std::size_t nodes) : isIn_(nodes, 0) {}

    bool contains(std::size_t node) const { return isIn_[node] != 0; }
    bool containsAll() const { return std::find(isIn_.begin(), isIn_.end(), std::uint8_t(0)) == isIn_.end(); }
    /// Several threads may insert at once.
    void insert(const std::array<std::int32_t, 4>& tet) {
        const auto at = [&](std::int32_t node) { return std::atomic_ref(isIn_[std::size_t(node)]); };
        const auto has = [&](std::int32_t node) { return at(node).load(std::memory_order_relaxed); };
        // Reading first keeps the cache lines shared once the nodes are there.
        if (has(tet[0]) & has(tet[1]) & has(tet[2]) & has(tet[3])) return;
        for (const std::int32_t node : tet) at(node).store(1, std::memory_order_relaxed);
    }

    friend bool operator==(const NodeSet&, const NodeSet&) = default;

  private:
    std::vector<std::uint8_t> isIn_;
};

/// Those that some element uses, flat or not.
NodeSet usedNodes(const TetMesh& mesh, const Execution& execution);
/// The same for elements that aren't flat.
NodeSet nodesOfVolumes(const TetMesh& mesh, const Execution& execution);

}  // namespace tessera
