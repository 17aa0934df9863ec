#include "mesh/nearest_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "mesh/box_tree.h"
#include "mesh/field_range.h"
#include "mesh/geometry.h"
#include "mesh/triangle_distance.h"

namespace tessera {

namespace {

/// Box distances and triangle distances round differently; a subtree is left out only when it is further by
/// more than this factor, so the result is the smallest computed distance over all faces whatever the order
/// of the walk.
constexpr double kPruneSlack = 1 + 1e-10;

/// Written so that compilers make it one instruction without branches.
double larger(double a, double b) {
    return a > b ? a : b;
}

/// A face with its nodes in ascending order: the distance to an edge comes out the same, bit for bit, from
/// both its faces.
struct BoundaryTriangle {
    std::array<Vec3d, 3> corners;
    std::array<std::int32_t, 3> nodes;
    std::int32_t element;
};

struct PendingNode {
    double distance2;
    int level;
    std::int64_t index;
};

}  // namespace

double NearestPoint::value(const Field& field, int component) const {
    if (element < 0) return std::numeric_limits<double>::quiet_NaN();
    if (field.location == FieldLocation::cell) {
        const double v = field.at(element, component);
        return std::isfinite(v) ? v : std::numeric_limits<double>::quiet_NaN();
    }
    double sum = 0;
    ValueRange range;
    for (std::size_t i = 0; i < 3; ++i) {
        if (!(weights[i] > 0)) continue;
        const double v = field.at(nodes[i], component);
        if (!std::isfinite(v)) return std::numeric_limits<double>::quiet_NaN();
        sum += weights[i] * v;
        range.min = std::min(range.min, v);
        range.max = std::max(range.max, v);
    }
    return std::clamp(sum, range.min, range.max);
}

struct NearestPointIndex::Impl {
    BoxTree tree;
    std::vector<BoundaryTriangle> triangles;  // in the order of the tree

    void offerTriangle(std::int64_t place, const Vec3d& point, double& best2,
                       const BoundaryTriangle*& bestTriangle, TrianglePlace& best) const {
        const BoundaryTriangle& triangle = triangles[std::size_t(place)];
        const TrianglePlace candidate = nearestOnTriangle(triangle.corners, point);
        if (candidate.distance2 > best2) return;
        if (candidate.distance2 == best2 && bestTriangle &&
            std::tie(bestTriangle->element, bestTriangle->nodes) <=
                std::tie(triangle.element, triangle.nodes))
            return;
        best2 = candidate.distance2;
        bestTriangle = &triangle;
        best = candidate;
    }
};

NearestPointIndex::NearestPointIndex(const TetMesh& mesh, int threads) : impl_(std::make_unique<Impl>()) {
    Execution execution;
    execution.threads = threads;
    const std::vector<BoundaryFace> faces = boundaryFaces(mesh, threads);
    std::vector<Box3d> boxes(faces.size());
    for (std::size_t f = 0; f < faces.size(); ++f)
        for (const std::int32_t node : faces[f].nodes) boxes[f].include(mesh.points[std::size_t(node)]);
    impl_->tree = BoxTree(boxes, execution);
    impl_->triangles.reserve(faces.size());
    for (const std::int32_t f : impl_->tree.order()) {
        BoundaryTriangle triangle;
        triangle.nodes = faces[std::size_t(f)].nodes;
        std::sort(triangle.nodes.begin(), triangle.nodes.end());
        for (std::size_t i = 0; i < 3; ++i) triangle.corners[i] = mesh.points[std::size_t(triangle.nodes[i])];
        triangle.element = faces[std::size_t(f)].element;
        impl_->triangles.push_back(triangle);
    }
}

NearestPointIndex::~NearestPointIndex() = default;

std::vector<double> NearestPointIndex::distances(const PointGrid& grid,
                                                 std::span<const std::uint32_t> offsets,
                                                 double reachWorld) const {
    if (offsets.empty()) return {};
    constexpr double kUnwanted = -1;
    const auto row = std::size_t(grid.size.x), plane = row * std::size_t(grid.size.y);
    std::vector<double> distance2(plane * std::size_t(grid.size.z), kUnwanted);
    for (const std::uint32_t offset : offsets) distance2[offset] = reachWorld * reachWorld;
    const auto placeOf = [&](const Vec3i& p) { return grid.originWorld + grid.spacingWorld * Vec3d(p); };
    const Vec3i last = grid.first + grid.size - 1;
    impl_->tree.visitOverlaps(
        {placeOf(grid.first) - reachWorld, placeOf(last) + reachWorld}, [&](std::int64_t at) {
            const BoundaryTriangle& triangle = impl_->triangles[std::size_t(at)];
            const Vec3d &a = triangle.corners[0], &b = triangle.corners[1], &c = triangle.corners[2];
            const Vec3d normal = glm::cross(b - a, c - a);
            // Further from the triangle's plane than this is out of reach, however it was rounded.
            const double most = reachWorld * glm::length(normal) * (1 + 1e-6);
            const auto pointsOf = [&](const Vec3d& place) {
                return (place - grid.originWorld) / grid.spacingWorld;
            };
            const Vec3d low =
                glm::max(glm::ceil(pointsOf(glm::min(glm::min(a, b), c) - reachWorld)), Vec3d(grid.first));
            const Vec3d high =
                glm::min(glm::floor(pointsOf(glm::max(glm::max(a, b), c) + reachWorld)), Vec3d(last));
            Vec3i p;
            for (p.z = int(low.z); p.z <= int(high.z); ++p.z)
                for (p.y = int(low.y); p.y <= int(high.y); ++p.y)
                    for (p.x = int(low.x); p.x <= int(high.x); ++p.x) {
                        const Vec3i local = p - grid.first;
                        double& best = distance2[std::size_t(local.z) * plane + std::size_t(local.y) * row +
                                                 std::size_t(local.x)];
                        if (best == kUnwanted) continue;
                        const Vec3d place = placeOf(p);
                        if (!(std::abs(glm::dot(place - a, normal)) <= most)) continue;
                        best = std::min(best, nearestOnTriangle(triangle.corners, place).distance2);
                    }
        });
    std::vector<double> distances;
    for (const std::uint32_t offset : offsets)
        distances.push_back(distance2[offset] < reachWorld * reachWorld ? std::sqrt(distance2[offset])
                                                                        : reachWorld);
    return distances;
}

NearestPoint NearestPointIndex::find(const Vec3d& pointWorld, double maxDistanceWorld) const {
    NearestPoint result;
    const BoxTree& tree = impl_->tree;
    if (tree.empty() || !(maxDistanceWorld >= 0)) return result;

    double best2 = maxDistanceWorld * maxDistanceWorld;
    const BoundaryTriangle* bestTriangle = nullptr;
    TrianglePlace best;
    // Four children a level, at most 16 levels over 2^31 faces.
    std::array<PendingNode, 64> stack;
    std::size_t pending = 0;
    stack[pending++] = {0, tree.levelCount() - 1, 0};
    while (pending > 0) {
        const PendingNode current = stack[--pending];
        if (current.distance2 > best2 * kPruneSlack) continue;
        const BoxTree::Node& node = tree.node(current.level, current.index);
        std::array<double, BoxTree::kWidth> distance2{};
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t c = 0; c < BoxTree::kWidth; ++c) {
                const double p = pointWorld[int(k)];
                const double d = larger(larger(node.min[k][c] - p, p - node.max[k][c]), 0);
                distance2[c] += d * d;
            }
        std::array<std::size_t, BoxTree::kWidth> order{0, 1, 2, 3};
        for (std::size_t i = 1; i < order.size(); ++i)
            for (std::size_t j = i; j > 0 && distance2[order[j]] < distance2[order[j - 1]]; --j)
                std::swap(order[j], order[j - 1]);
        if (current.level == 0) {
            for (const std::size_t c : order)
                if (distance2[c] <= best2 * kPruneSlack &&
                    distance2[c] < std::numeric_limits<double>::infinity())
                    impl_->offerTriangle(current.index * BoxTree::kWidth + std::int64_t(c), pointWorld, best2,
                                         bestTriangle, best);
            continue;
        }
        for (std::size_t i = order.size(); i-- > 0;)
            if (distance2[order[i]] <= best2 * kPruneSlack &&
                distance2[order[i]] < std::numeric_limits<double>::infinity())
                stack[pending++] = {distance2[order[i]], current.level - 1,
                                    current.index * BoxTree::kWidth + std::int64_t(order[i])};
    }
    if (!bestTriangle) return result;
    result.element = bestTriangle->element;
    result.nodes = bestTriangle->nodes;
    result.weights = best.weights;
    result.distanceWorld = std::sqrt(best2);
    return result;
}

}  // namespace tessera
