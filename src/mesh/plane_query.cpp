#include "mesh/plane_query.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace tessera {

namespace {

/// A bound on the rounding of dot(axis, p - centre) for every p in the box: one subtraction, one product and
/// two sums, each off by 2^-53 of at most |axis| (|p| + |centre|); the bound is four times that.
double placeRounding(const Box3d& box, const Vec3d& axis, const Vec3d& centre) {
    const Vec3d reach = glm::max(glm::abs(box.min), glm::abs(box.max)) + glm::abs(centre);
    return 0x1p-49 * glm::dot(glm::abs(axis), reach);
}

/// A plate made ready: how far along each axis a place may lie, with the rounding of its computed distance.
struct PlateTest {
    const PlanePatch& patch;
    Vec3d limit{0};

    bool meets(int axis, double low, double high) const { return low <= limit[axis] && high >= -limit[axis]; }

    bool meetsBox(const Box3d& box) const {
        for (int a = 0; a < 3; ++a) {
            const Vec3d& axis = patch.axes[std::size_t(a)];
            double low = 0, high = 0;
            for (int k = 0; k < 3; ++k) {
                const double toMin = axis[k] * (box.min[k] - patch.centreWorld[k]);
                const double toMax = axis[k] * (box.max[k] - patch.centreWorld[k]);
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

}  // namespace

PlaneQuery::PlaneQuery(std::shared_ptr<const SharedElementIndex> index, const Execution& execution)
    : index_(std::move(index)) {
    index_->get(execution);
}

PlaneHits PlaneQuery::find(const PlanePatch& patch) const {
    const TetMesh& mesh = index_->mesh();
    const ElementIndex& index = index_->get();
    PlaneHits hits;
    if (index.elementCount() == 0) return hits;
    PlateTest test{patch};
    for (int a = 0; a < 3; ++a)
        test.limit[a] = patch.halfWorld[a] +
                        placeRounding(index.boundsWorld(), patch.axes[std::size_t(a)], patch.centreWorld);
    hits.boxes = index.walk([&](const Box3d& box) { return test.meetsBox(box); },
                            [&](std::int32_t element) {
                                ++hits.touched;
                                if (test.meetsElement(mesh, mesh.tets[std::size_t(element)]))
                                    hits.elements.push_back(element);
                            });
    sortEachOnce(hits.elements);
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
