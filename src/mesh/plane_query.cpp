#include "mesh/plane_query.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {

namespace {

constexpr std::int64_t kChunk = 1 << 14;

/// A bound on the rounding of dot(axis, p - centre) for every p in the box: one subtraction, one product and
/// two sums, each off by 2^-53 of at most |axis| (|p| + |centre|); the bound is four times that.
double placeRounding(const Box3d& box, const Vec3d& axis, const Vec3d& centre) {
    const Vec3d reach = glm::max(glm::abs(box.min), glm::abs(box.max)) + glm::abs(centre);
    return 0x1p-49 * glm::dot(glm::abs(axis), reach);
}

Box3d rootBox(const BoxTree& tree) {
    Box3d box;
    if (tree.empty()) return box;
    const BoxTree::Node& root = tree.node(tree.levelCount() - 1, 0);
    for (int k = 0; k < 3; ++k) {
        const auto& low = root.min[std::size_t(k)];
        const auto& high = root.max[std::size_t(k)];
        box.min[k] = *std::min_element(low.begin(), low.end());
        box.max[k] = *std::max_element(high.begin(), high.end());
    }
    return box;
}

std::vector<Box3d> elementBoxes(const TetMesh& mesh, const Execution& execution) {
    std::vector<Box3d> boxes(mesh.tets.size());
    parallelForChunks(execution, mesh.elementCount(), kChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e)
            for (const std::int32_t node : mesh.tets[std::size_t(e)])
                boxes[std::size_t(e)].include(mesh.points[std::size_t(node)]);
    });
    return boxes;
}

}  // namespace

/// A plate made ready: how far along each axis a place may lie, with the rounding of its computed distance.
struct PlaneQuery::Test {
    const PlanePatch& patch;
    Vec3d limit{0};

    bool meets(int axis, double low, double high) const { return low <= limit[axis] && high >= -limit[axis]; }

    bool meetsChild(const BoxTree::Node& node, std::size_t c) const {
        for (int a = 0; a < 3; ++a) {
            const Vec3d& axis = patch.axes[std::size_t(a)];
            double low = 0, high = 0;
            for (int k = 0; k < 3; ++k) {
                const double toMin = axis[k] * (node.min[std::size_t(k)][c] - patch.centreWorld[k]);
                const double toMax = axis[k] * (node.max[std::size_t(k)][c] - patch.centreWorld[k]);
                low += std::min(toMin, toMax);
                high += std::max(toMin, toMax);
            }
            if (!meets(a, low, high)) return false;
        }
        return true;
    }

    bool meetsElement(const TetMesh& mesh, const std::array<std::int32_t, 4>& tet) const {
        Box3d extent;
        for (const std::int32_t node : tet) {
            const Vec3d offset = mesh.points[std::size_t(node)] - patch.centreWorld;
            extent.include({glm::dot(patch.axes[0], offset), glm::dot(patch.axes[1], offset),
                            glm::dot(patch.axes[2], offset)});
        }
        return meets(0, extent.min.x, extent.max.x) && meets(1, extent.min.y, extent.max.y) &&
               meets(2, extent.min.z, extent.max.z);
    }
};

PlaneQuery::PlaneQuery(const TetMesh& mesh, const Execution& execution)
    : mesh_(&mesh), tree_(elementBoxes(mesh, execution), execution), boundsWorld_(rootBox(tree_)) {}

void PlaneQuery::visit(int level, std::int64_t index, const Test& test, PlaneHits& hits) const {
    const BoxTree::Node& node = tree_.node(level, index);
    for (int c = 0; c < BoxTree::kWidth; ++c) {
        const std::int64_t child = index * BoxTree::kWidth + c;
        if (level == 0) {
            if (child >= std::int64_t(tree_.order().size())) break;
            ++hits.boxes;
        }
        // An absent child's box holds infinities of the wrong sign and is never met.
        if (node.min[0][std::size_t(c)] > node.max[0][std::size_t(c)] ||
            !test.meetsChild(node, std::size_t(c)))
            continue;
        if (level > 0) {
            visit(level - 1, child, test, hits);
            continue;
        }
        const std::int32_t element = tree_.order()[std::size_t(child)];
        ++hits.touched;
        if (test.meetsElement(*mesh_, mesh_->tets[std::size_t(element)])) hits.elements.push_back(element);
    }
}

PlaneHits PlaneQuery::find(const PlanePatch& patch) const {
    PlaneHits hits;
    if (tree_.empty()) return hits;
    Test test{patch};
    for (int a = 0; a < 3; ++a)
        test.limit[a] =
            patch.halfWorld[a] + placeRounding(boundsWorld_, patch.axes[std::size_t(a)], patch.centreWorld);
    visit(tree_.levelCount() - 1, 0, test, hits);
    std::sort(hits.elements.begin(), hits.elements.end());
    return hits;
}

Box3d cutExtent(const TetMesh& mesh, const std::vector<std::int32_t>& elements, const PlanePatch& patch) {
    Box3d extent;
    for (const std::int32_t element : elements) {
        std::array<Vec3d, 4> places;
        Box3d box;
        for (std::size_t i = 0; i < 4; ++i) {
            const Vec3d& node = mesh.points[std::size_t(mesh.tets[std::size_t(element)][i])];
            box.include(node);
            const Vec3d offset = node - patch.centreWorld;
            for (int a = 0; a < 3; ++a) places[i][a] = glm::dot(patch.axes[std::size_t(a)], offset);
        }
        const double rounding = placeRounding(box, patch.axes[2], patch.centreWorld);
        for (std::size_t i = 0; i < 4; ++i) {
            const Vec3d& p = places[i];
            if (std::abs(p.z) <= rounding) {
                extent.include({p.x, p.y, 0});
                continue;
            }
            for (std::size_t j = 0; j < i; ++j) {
                const Vec3d& q = places[j];
                if ((p.z > 0) == (q.z > 0) || q.z == 0) continue;
                const Vec3d cut = p + p.z / (p.z - q.z) * (q - p);
                extent.include({cut.x, cut.y, 0});
            }
        }
    }
    return extent;
}

}  // namespace tessera
