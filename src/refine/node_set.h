#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Some nodes of a mesh, a bit each: small enough to stay in the nearest cache while elements ask for their
/// nodes in no order.
class NodeSet {
  public:
    NodeSet() = default;
    explicit NodeSet(std::size_t nodes) : words_((nodes + 63) / 64, 0) {}

    bool contains(std::size_t node) const { return words_[node / 64] >> node % 64 & 1; }
    /// Whether it has the first so many.
    bool containsAll(std::size_t nodes) const {
        for (std::size_t node = 0; node < nodes; ++node)
            if (!contains(node)) return false;
        return true;
    }
    /// Several threads may insert at once.
    void insert(const std::array<std::int32_t, 4>& tet) {
        for (const std::int32_t node : tet) {
            // Reading first keeps the cache line shared once the bit is set.
            const std::uint64_t bit = std::uint64_t(1) << node % 64;
            std::atomic_ref<std::uint64_t> word(words_[std::size_t(node) / 64]);
            if (!(word.load(std::memory_order_relaxed) & bit)) word.fetch_or(bit, std::memory_order_relaxed);
        }
    }

    friend bool operator==(const NodeSet&, const NodeSet&) = default;

  private:
    std::vector<std::uint64_t> words_;
};

/// Those that some element uses, flat or not.
NodeSet usedNodes(const TetMesh& mesh, const Execution& execution);
/// The same for elements that aren't flat.
NodeSet nodesOfVolumes(const TetMesh& mesh, const Execution& execution);

}  // namespace tessera
