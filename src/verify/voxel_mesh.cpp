#include "verify/voxel_mesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/parallel.h"
#include "mesh/geometry.h"
#include "tessera/error.h"
#include "tessera/execution.h"

namespace tessera {

namespace {

constexpr double kUnit = 0x1p-53;
constexpr int kProbes = 128;
constexpr double kFlatVoxels = 1e-9;  // thicker than any element that isn't reliable

TetMesh inVoxels(const TetMesh& mesh, const Lattice& lattice) {
    if (!lattice.isAxisParallel()) throw InputError("only an axis-parallel lattice can be compared on");
    const Vec3d step{lattice.uWorld.x, lattice.vWorld.y, lattice.wWorld.z};
    TetMesh result;
    result.tets = mesh.tets;
    result.points.reserve(mesh.points.size());
    for (const Vec3d& p : mesh.points) result.points.push_back((p - lattice.originWorld) / step);
    return result;
}

double distanceToSegment(const Vec3d& place, const Vec3d& a, const Vec3d& b) {
    const Vec3d edge = b - a;
    const double length2 = glm::dot(edge, edge);
    const double t = length2 > 0 ? std::clamp(glm::dot(place - a, edge) / length2, 0.0, 1.0) : 0.0;
    return glm::length(place - (a + t * edge));
}

/// Each candidate is the distance of a true place of the triangle, so a needle or a point is no special case.
double distanceToTriangle(const Vec3d& place, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    double best = std::min(
        {distanceToSegment(place, a, b), distanceToSegment(place, b, c), distanceToSegment(place, c, a)});
    const Vec3d u = b - a, v = c - a, w = place - a;
    const Vec3d normal = glm::cross(u, v);
    const double normal2 = glm::dot(normal, normal);
    if (normal2 > 0) {
        const double t1 = glm::dot(glm::cross(w, v), normal) / normal2;
        const double t2 = glm::dot(glm::cross(u, w), normal) / normal2;
        if (t1 > 0 && t2 > 0 && t1 + t2 < 1) best = std::min(best, glm::length(w - (t1 * u + t2 * v)));
    }
    return best;
}

/// Directions spread evenly over the sphere (a golden spiral).
const std::array<Vec3d, kProbes>& probeDirections() {
    static const std::array<Vec3d, kProbes> directions = [] {
        std::array<Vec3d, kProbes> d;
        for (int i = 0; i < kProbes; ++i) {
            const double z = 1 - (2 * i + 1.0) / kProbes;
            const double angle = std::numbers::pi * (3 - std::sqrt(5.0)) * i;
            const double radius = std::sqrt(1 - z * z);
            d[std::size_t(i)] = {radius * std::cos(angle), radius * std::sin(angle), z};
        }
        return d;
    }();
    return directions;
}

}  // namespace

double VoxelElement::distance(const Vec3d& place) const {
    if (isReliable()) {
        const std::array<double, 4> w = weights(place);
        if (*std::min_element(w.begin(), w.end()) >= 0) return 0;
    }
    double best = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 4; ++i)
        best =
            std::min(best, distanceToTriangle(place, corners[i], corners[(i + 1) & 3], corners[(i + 2) & 3]));
    return best;
}

VoxelMesh::VoxelMesh(const TetMesh& mesh, const Lattice& lattice, int threads)
    : voxels_(inVoxels(mesh, lattice)),
      solid_(mesh.tets.size()),
      index_(voxels_, Execution{.threads = threads}),
      boundary_(voxels_, threads) {
    Execution execution;
    execution.threads = threads;
    parallelForChunks(execution, mesh.elementCount(), 4096, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
            const auto& tet = mesh.tets[std::size_t(e)];
            const auto at = [&](std::size_t i) { return mesh.points[std::size_t(tet[i])]; };
            solid_[std::size_t(e)] = volumeSign(at(0), at(1), at(2), at(3)) != 0;
        }
    });
}

bool VoxelMesh::element(std::int32_t index, VoxelElement& result) const {
    if (!solid_[std::size_t(index)]) return false;
    const auto& tet = voxels_.tets[std::size_t(index)];
    Box3d box;
    double largest = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const Vec3d& p = result.corners[i] = voxels_.points[std::size_t(tet[i])];
        box.include(p);
        largest = std::max({largest, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    }
    const Vec3d size = box.size();
    const double diameter = std::max({size.x, size.y, size.z});
    double steepest = 0, smallest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < 4; ++i) {
        const Vec3d& a = result.corners[(i + 1) & 3];
        const Vec3d normal = glm::cross(result.corners[(i + 2) & 3] - a, result.corners[(i + 3) & 3] - a);
        const double height = glm::dot(normal, result.corners[i] - a);
        result.gradients[i] = normal / height;
        smallest = std::min(smallest, std::abs(height));
        steepest = std::max(steepest, glm::length(result.gradients[i]));
    }
    // The bound of docs/algorithms.md ("Software"), with coordinates counted from the lattice's origin.
    result.weightError =
        kUnit * (256 * size.x * size.y * size.z / smallest + 256 * steepest * (diameter + largest + 2));
    if (!(result.weightError >= 0)) result.weightError = std::numeric_limits<double>::infinity();
    result.thicknessVoxels = smallest > 0 && std::isfinite(steepest) ? 1 / steepest : 0;
    return true;
}

Box3d VoxelMesh::bounds(std::int32_t index) const {
    Box3d box;
    for (const std::int32_t node : voxels_.tets[std::size_t(index)])
        box.include(voxels_.points[std::size_t(node)]);
    return box;
}

bool VoxelMesh::isNearBoundary(const Vec3d& place, double reach) const {
    if (boundary_.get().find(place, reach).element < 0) return false;
    std::vector<std::int32_t> candidates;
    query({place - reach, place + reach}, candidates);
    std::vector<VoxelElement> elements;
    for (const std::int32_t e : candidates)
        if (VoxelElement element; this->element(e, element)) elements.push_back(element);
    const auto isInside = [&](const Vec3d& p) {
        return std::any_of(elements.begin(), elements.end(), [&](const VoxelElement& e) {
            if (!e.isReliable()) return e.distance(p) <= kFlatVoxels;
            const std::array<double, 4> w = e.weights(p);
            return *std::min_element(w.begin(), w.end()) >= -e.weightError;
        });
    };
    // A place with mesh all around it is inside, whatever the sides near it are.
    for (const double radius : {reach, reach / 8})
        for (const Vec3d& direction : probeDirections())
            if (!isInside(place + radius * direction)) return true;
    return false;
}

VoxelMesh::Neighbour VoxelMesh::thinnestNear(const Vec3d& place, double reach) const {
    std::vector<std::int32_t> candidates;
    query({place - reach, place + reach}, candidates);
    Neighbour result;
    for (const std::int32_t e : candidates) {
        VoxelElement element;
        if (!this->element(e, element) || element.thicknessVoxels >= result.thicknessVoxels) continue;
        if (element.distance(place) <= reach) result = {e, element.thicknessVoxels};
    }
    return result;
}

}  // namespace tessera
