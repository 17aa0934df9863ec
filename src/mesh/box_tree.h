#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tessera/execution.h"
#include "tessera/vec.h"

namespace tessera {

/// Bounding volume hierarchy over boxes: four children a node, split at the median along the longest side, no
/// pointers. Depends on the boxes only, not on threads.
class BoxTree {
  public:
    static constexpr int kWidth = 4;

    /// The boxes of four children, axis by axis; absent children are empty boxes (+inf, -inf).
    struct Node {
        std::array<std::array<double, kWidth>, 3> min, max;
    };

    BoxTree() = default;
    BoxTree(std::span<const Box3d> boxes, const Execution& execution);

    bool empty() const { return order_.empty(); }
    /// order()[place] is the item at `place` of the tree's order.
    std::span<const std::int32_t> order() const { return order_; }
    /// Levels of nodes; the last has one node. Child c of node n is node 4 n + c of the level below, or place
    /// 4 n + c on level 0.
    int levelCount() const { return int(levels_.size()); }
    const Node& node(int level, std::int64_t index) const {
        return levels_[std::size_t(level)][std::size_t(index)];
    }

    /// Calls visit(place) for every item whose box meets the closed box.
    template <class Visit>
    void visitOverlaps(const Box3d& box, Visit&& visit) const {
        if (empty() || box.empty()) return;
        // An infinite box would meet the absent children too.
        constexpr double kLargest = std::numeric_limits<double>::max();
        const Box3d finite{glm::max(box.min, Vec3d(-kLargest)), glm::min(box.max, Vec3d(kLargest))};
        visitOverlaps(levelCount() - 1, 0, finite, visit);
    }

  private:
    template <class Visit>
    void visitOverlaps(int level, std::int64_t index, const Box3d& box, Visit& visit) const {
        const Node& n = node(level, index);
        for (int c = 0; c < kWidth; ++c) {
            const auto k = std::size_t(c);
            if (n.min[0][k] > box.max.x || n.max[0][k] < box.min.x || n.min[1][k] > box.max.y ||
                n.max[1][k] < box.min.y || n.min[2][k] > box.max.z || n.max[2][k] < box.min.z)
                continue;
            if (level == 0)
                visit(index * kWidth + c);
            else
                visitOverlaps(level - 1, index * kWidth + c, box, visit);
        }
    }

    std::vector<std::int32_t> order_;
    std::vector<std::vector<Node>> levels_;
};

}  // namespace tessera
