#include "surface/crossing_search.h"

#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "surface/exact_normal.h"
#include "surface/triangle_crossing.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr std::int64_t kSearchChunk = 256;
/// A pair that crosses counts as so many that don't, as exact arithmetic takes longer there.
constexpr std::int64_t kCrossingCost = 10;
/// Of the pairs within the limits, those that are looked at where there are more.
constexpr std::int64_t kFirstShare = 16;

/// Counts what crosses the triangle at one place among those at later ones, and adds the pairs looked at to
/// `looked`; nothing once that is above `most`.
std::int64_t searchAt(const TriangleTree& tree, std::int64_t place, std::int64_t most,
                      std::atomic<std::int64_t>& looked, std::vector<std::uint8_t>& crosses) {
    const auto mark = [&](std::int32_t triangle) {
        std::atomic_ref(crosses[std::size_t(triangle)]).store(1, std::memory_order_relaxed);
    };
    if (looked.load(std::memory_order_relaxed) > most) return 0;
    const std::int32_t triangle = tree.triangleAt(place);
    std::int64_t pairs = 0, candidates = 0;
    tree.visitOverlaps(tree.boxOf(triangle), [&](std::int64_t other) {
        if (other <= place) return;
        ++candidates;
        if (!trianglesCross(tree.surface(), triangle, tree.triangleAt(other))) return;
        ++pairs;
        candidates += kCrossingCost - 1;
        mark(triangle);
        mark(tree.triangleAt(other));
    });
    looked.fetch_add(candidates, std::memory_order_relaxed);
    return pairs;
}

}  // namespace

Crossings findCrossings(const TriangleTree& tree, const CrossingLimits& limits, const Execution& execution) {
    Crossings found;
    found.crosses.assign(tree.surface().triangles.size(), 0);
    const std::int64_t most = limits.pairsPerTriangle * tree.count() + limits.pairsMore;
    std::atomic<std::int64_t> looked{0}, pairs{0};
    parallelForChunks(execution, tree.count(), kSearchChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t place = begin; place < end; ++place)
            pairs += searchAt(tree, place, most, looked, found.crosses);
    });
    found.pairs = pairs;
    if (looked <= most) return found;

    // Where the threads stopped depends on chance, so the beginning is looked at again, in one order.
    found = {0, std::vector<std::uint8_t>(tree.surface().triangles.size(), 0)};
    looked = 0;
    for (std::int64_t place = 0; place < tree.count() && looked <= most / kFirstShare; ++place) {
        execution.throwIfCancelled();
        found.pairs += searchAt(tree, place, most / kFirstShare, looked, found.crosses);
    }
    if (found.pairs == 0)
        throw InputError("the surface's triangles overlap too much to be checked: more than " +
                         std::to_string(most) + " pairs of its " + std::to_string(tree.count()) +
                         " triangles lie close together");
    return found;
}

Vec3d placeOfCrossing(const TriangleTree& tree, std::int32_t triangle) {
    const Box3d box = tree.boxOf(triangle);
    std::int32_t other = -1;
    tree.visitOverlaps(box, [&](std::int64_t place) {
        const std::int32_t candidate = tree.triangleAt(place);
        if (candidate != triangle && (other < 0 || candidate < other) &&
            trianglesCross(tree.surface(), triangle, candidate))
            other = candidate;
    });
    if (other < 0) return middleOf(cornersOf(tree.surface(), triangle));
    const Box3d otherBox = tree.boxOf(other);
    return middleOf(glm::max(box.min, otherBox.min), glm::min(box.max, otherBox.max));
}

}  // namespace tessera
