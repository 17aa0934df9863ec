#include "mesh/element_index.h"

#include <algorithm>

#include "mesh/box_tree.h"

namespace tessera {

struct ElementIndex::Impl {
    BoxTree tree;
};

ElementIndex::ElementIndex(const TetMesh& mesh, int threads) : impl_(std::make_unique<Impl>()) {
    Execution execution;
    execution.threads = threads;
    std::vector<Box3d> boxes(mesh.tets.size());
    parallelForChunks(execution, mesh.elementCount(), 1 << 14, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e)
            for (const std::int32_t node : mesh.tets[std::size_t(e)])
                boxes[std::size_t(e)].include(mesh.points[std::size_t(node)]);
    });
    impl_->tree = BoxTree(boxes, execution);
}

ElementIndex::~ElementIndex() = default;

void ElementIndex::query(const Box3d& boxWorld, std::vector<std::int32_t>& elements) const {
    const auto first = std::ptrdiff_t(elements.size());
    impl_->tree.visitOverlaps(
        boxWorld, [&](std::int64_t place) { elements.push_back(impl_->tree.order()[std::size_t(place)]); });
    std::sort(elements.begin() + first, elements.end());
}

}  // namespace tessera
