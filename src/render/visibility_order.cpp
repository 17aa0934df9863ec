#include "render/visibility_order.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tessera {

namespace {

/// Puts the leaves below bricks into order, octant by octant.
class Sorter {
  public:
    Sorter(std::span<const DepthKey> leaves, const Viewpoint& from) : leaves_(leaves), from_(from) {}

    /// All are the brick or lie in it.
    void sort(std::span<std::size_t> numbers, const DepthKey& brick) {
        if (numbers.size() <= 1) return;
        // Octants that differ from the nearest one in more axes come later: those hide none of these.
        const unsigned nearest = nearestChild(brick);
        const Depth below = brick.depth + 1;
        const auto rank = [&](std::size_t number) {
            return childNumber(ancestorKey(leaves_[number], below).index) ^ nearest;
        };
        std::sort(numbers.begin(), numbers.end(),
                  [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
        for (std::size_t first = 0; first < numbers.size();) {
            std::size_t end = first;
            while (end < numbers.size() && rank(numbers[end]) == rank(numbers[first])) ++end;
            sort(numbers.subspan(first, end - first), childKey(brick, rank(numbers[first]) ^ nearest));
            first = end;
        }
    }

  private:
    unsigned nearestChild(const DepthKey& brick) const {
        const double edge = std::ldexp(1.0, -brick.depth.halvings());
        const Vec3d middle = (Vec3d(brick.index) + 0.5) * edge;
        unsigned child = 0;
        for (int a = 0; a < 3; ++a)
            if (from_.direction[a] != 0 ? from_.direction[a] < 0 : from_.place[a] > middle[a])
                child |= 1u << a;
        return child;
    }

    std::span<const DepthKey> leaves_;
    const Viewpoint& from_;
};

}  // namespace

std::vector<std::size_t> visibilityOrder(std::span<const DepthKey> leaves, const Viewpoint& from) {
    std::vector<std::size_t> order(leaves.size());
    std::iota(order.begin(), order.end(), std::size_t(0));
    const bool isParallel = from.direction != Vec3d(0);
    const auto rootOf = [&](std::size_t number) { return ancestorKey(leaves[number], Depth(0)).index; };
    // A brick of depth 0 hides only those that are as far from the eye or farther on every axis.
    const auto distance = [&](std::size_t number) {
        const Vec3i root = rootOf(number);
        double sum = 0;
        for (int a = 0; a < 3; ++a)
            sum += isParallel ? (from.direction[a] > 0   ? double(root[a])
                                 : from.direction[a] < 0 ? -double(root[a])
                                                         : 0)
                              : std::abs(double(root[a]) - std::floor(from.place[a]));
        return sum;
    };
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        const double toA = distance(a), toB = distance(b);
        if (toA != toB) return toA < toB;
        const Vec3i rootA = rootOf(a), rootB = rootOf(b);
        for (int axis = 2; axis >= 0; --axis)
            if (rootA[axis] != rootB[axis]) return rootA[axis] < rootB[axis];
        return false;
    });
    Sorter sorter(leaves, from);
    for (std::size_t first = 0; first < order.size();) {
        const Vec3i root = rootOf(order[first]);
        std::size_t end = first;
        while (end < order.size() && rootOf(order[end]) == root) ++end;
        sorter.sort(std::span(order).subspan(first, end - first), {Depth(0), root});
        first = end;
    }
    return order;
}

}  // namespace tessera
