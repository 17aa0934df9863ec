#include "surface/triangle_tree.h"

#include "base/parallel.h"
#include "surface/exact_normal.h"

namespace tessera {

TriangleTree::TriangleTree(const Surface& surface, std::span<const std::uint8_t> leftOut,
                           const Execution& execution)
    : surface_(surface) {
    std::vector<std::int32_t> kept;
    kept.reserve(surface.triangles.size());
    for (std::size_t t = 0; t < surface.triangles.size(); ++t)
        if (!leftOut[t]) kept.push_back(std::int32_t(t));
    std::vector<Box3d> boxes(kept.size());
    parallelForChunks(execution, std::int64_t(kept.size()), 1 << 14,
                      [&](std::int64_t begin, std::int64_t end) {
                          for (auto i = std::size_t(begin); i < std::size_t(end); ++i)
                              boxes[i] = boxOf(kept[i]);
                      });
    tree_ = BoxTree(boxes, execution);
    byPlace_.reserve(kept.size());
    for (const std::int32_t item : tree_.order()) byPlace_.push_back(kept[std::size_t(item)]);
}

Box3d TriangleTree::boxOf(std::int32_t triangle) const {
    Box3d box;
    for (const Vec3d& corner : cornersOf(surface_, triangle)) box.include(corner);
    return box;
}

}  // namespace tessera
