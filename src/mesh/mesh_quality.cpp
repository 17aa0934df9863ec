#include "mesh/mesh_quality.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "mesh/box_tree.h"
#include "mesh/face_matching.h"

namespace tessera {

namespace {

constexpr std::int64_t kQualityChunk = 1 << 14;

/// A node counts as lying on a face when it is this close to it, over the face's longest edge: about the
/// rounding of coordinates that were stored as float.
constexpr double kOnFace = 1e-6;

struct Extremes {
    double smallestEdge2 = std::numeric_limits<double>::infinity();
    double largestEdge2 = 0;
    double smallestVolume = std::numeric_limits<double>::infinity();
    double largestVolume = 0;
    std::int64_t flat = 0, inverted = 0;

    void include(const Extremes& other) {
        smallestEdge2 = std::min(smallestEdge2, other.smallestEdge2);
        largestEdge2 = std::max(largestEdge2, other.largestEdge2);
        smallestVolume = std::min(smallestVolume, other.smallestVolume);
        largestVolume = std::max(largestVolume, other.largestVolume);
        flat += other.flat;
        inverted += other.inverted;
    }
};

Extremes measureElements(const TetMesh& mesh, std::vector<std::uint8_t>& flat, std::int64_t begin,
                         std::int64_t end) {
    Extremes extremes;
    for (std::int64_t e = begin; e < end; ++e) {
        const auto& tet = mesh.tets[std::size_t(e)];
        const Vec3d& a = mesh.points[std::size_t(tet[0])];
        const Vec3d& b = mesh.points[std::size_t(tet[1])];
        const Vec3d& c = mesh.points[std::size_t(tet[2])];
        const Vec3d& d = mesh.points[std::size_t(tet[3])];
        for (const Vec3d& edge : {b - a, c - a, d - a, c - b, d - b, d - c}) {
            const double length2 = glm::dot(edge, edge);
            extremes.smallestEdge2 = std::min(extremes.smallestEdge2, length2);
            extremes.largestEdge2 = std::max(extremes.largestEdge2, length2);
        }
        const int sign = volumeSign(a, b, c, d);
        flat[std::size_t(e)] = sign == 0;
        extremes.flat += sign == 0;
        extremes.inverted += sign < 0;
        if (sign == 0) continue;
        const double volume = std::fabs(glm::dot(glm::cross(b - a, c - a), d - a)) / 6;
        extremes.smallestVolume = std::min(extremes.smallestVolume, volume);
        extremes.largestVolume = std::max(extremes.largestVolume, volume);
    }
    return extremes;
}

Extremes measureElements(const TetMesh& mesh, std::vector<std::uint8_t>& flat, const Execution& execution) {
    const std::int64_t chunks = (mesh.elementCount() + kQualityChunk - 1) / kQualityChunk;
    std::vector<Extremes> parts{std::size_t(chunks)};
    parallelFor(execution, chunks, [&](std::int64_t c) {
        parts[std::size_t(c)] = measureElements(mesh, flat, c * kQualityChunk,
                                                std::min(mesh.elementCount(), (c + 1) * kQualityChunk));
    });
    Extremes all;
    for (const Extremes& part : parts) all.include(part);
    return all;
}

std::uint64_t hashPlace(const Vec3d& p) {
    std::uint64_t hash = 0;
    for (int k = 0; k < 3; ++k) {
        hash ^= std::bit_cast<std::uint64_t>(p[k] + 0.0);  // -0 and 0 are one place
        hash *= 0x9e3779b97f4a7c15ull;
        hash ^= hash >> 29;
    }
    return hash;
}

struct HashedNode {
    std::uint64_t hash;
    std::int32_t node;
    bool operator<(const HashedNode& other) const {
        return hash != other.hash ? hash < other.hash : node < other.node;
    }
};

/// Which boundary faces have another boundary face at their place, given the first node at the place of every
/// node.
std::vector<std::uint8_t> findStackedFaces(const std::vector<BoundaryFace>& faces,
                                           const std::vector<std::int32_t>& firstNode) {
    struct Keyed {
        std::array<std::int32_t, 3> nodes;
        std::size_t face;
    };
    std::vector<Keyed> keyed(faces.size());
    for (std::size_t f = 0; f < faces.size(); ++f) {
        keyed[f].face = f;
        for (std::size_t i = 0; i < 3; ++i) keyed[f].nodes[i] = firstNode[std::size_t(faces[f].nodes[i])];
        std::sort(keyed[f].nodes.begin(), keyed[f].nodes.end());
    }
    std::sort(keyed.begin(), keyed.end(), [](const Keyed& a, const Keyed& b) { return a.nodes < b.nodes; });
    std::vector<std::uint8_t> stacked(faces.size(), 0);
    for (std::size_t i = 1; i < keyed.size(); ++i)
        if (keyed[i].nodes == keyed[i - 1].nodes) stacked[keyed[i].face] = stacked[keyed[i - 1].face] = 1;
    return stacked;
}

bool liesOnFace(const std::array<Vec3d, 3>& corners, const Vec3d& point) {
    const Vec3d u = corners[1] - corners[0], v = corners[2] - corners[0], w = point - corners[0];
    const Vec3d normal = glm::cross(u, v);
    const double area2 = glm::dot(normal, normal);
    if (!(area2 > 0)) return false;
    const double longest = std::sqrt(std::max({glm::dot(u, u), glm::dot(v, v), glm::dot(v - u, v - u)}));
    if (std::fabs(glm::dot(w, normal)) > kOnFace * longest * std::sqrt(area2)) return false;
    // Distances inside of the three edges: weight times height.
    const double t1 = glm::dot(glm::cross(w, v), normal) / area2;
    const double t2 = glm::dot(glm::cross(u, w), normal) / area2;
    const double area = std::sqrt(area2);
    const double tolerance = kOnFace * longest;
    const auto inside = [&](double weight, const Vec3d& edge) {
        return weight * area >= -tolerance * std::sqrt(glm::dot(edge, edge));
    };
    return inside(t1, v) && inside(t2, u) && inside(1 - t1 - t2, v - u);
}

/// Boundary faces that lie inside the mesh.
std::int64_t countInnerBoundary(const TetMesh& mesh, const std::vector<BoundaryFace>& faces,
                                const std::vector<std::int32_t>& firstNode, const Execution& execution) {
    const std::vector<std::uint8_t> stacked = findStackedFaces(faces, firstNode);
    std::vector<std::int32_t> nodes;
    for (const BoundaryFace& face : faces)
        for (const std::int32_t node : face.nodes) nodes.push_back(firstNode[std::size_t(node)]);
    std::sort(nodes.begin(), nodes.end());
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    std::vector<Box3d> places(nodes.size());
    for (std::size_t i = 0; i < nodes.size(); ++i) places[i].include(mesh.points[std::size_t(nodes[i])]);
    const BoxTree tree(places, execution);

    std::atomic<std::int64_t> inner{0};
    parallelForChunks(
        execution, std::int64_t(faces.size()), 1 << 10, [&](std::int64_t begin, std::int64_t end) {
            std::int64_t found = 0;
            for (std::int64_t f = begin; f < end; ++f) {
                const BoundaryFace& face = faces[std::size_t(f)];
                std::array<Vec3d, 3> corners;
                Box3d box;
                for (std::size_t i = 0; i < 3; ++i)
                    box.include(corners[i] = mesh.points[std::size_t(face.nodes[i])]);
                const Vec3d size = box.size();
                const double margin = kOnFace * std::max({size.x, size.y, size.z});
                box.min -= Vec3d(margin);
                box.max += Vec3d(margin);
                bool hanging = stacked[std::size_t(f)];
                tree.visitOverlaps(box, [&](std::int64_t place) {
                    const Vec3d& point = places[std::size_t(tree.order()[std::size_t(place)])].min;
                    hanging = hanging || (point != corners[0] && point != corners[1] && point != corners[2] &&
                                          liesOnFace(corners, point));
                });
                found += hanging;
            }
            inner += found;
        });
    return inner;
}

}  // namespace

std::vector<std::int32_t> firstNodeAtPlace(const std::vector<Vec3d>& points, const Execution& execution) {
    constexpr std::size_t kBuckets = 256;
    const auto count = std::int64_t(points.size());
    std::vector<std::uint64_t> hashes(points.size());
    parallelForChunks(execution, count, kQualityChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t i = begin; i < end; ++i) hashes[std::size_t(i)] = hashPlace(points[std::size_t(i)]);
    });
    std::array<std::size_t, kBuckets + 1> bucketBegin{};
    for (const std::uint64_t hash : hashes) ++bucketBegin[(hash >> 56) + 1];
    for (std::size_t b = 0; b < kBuckets; ++b) bucketBegin[b + 1] += bucketBegin[b];
    std::vector<HashedNode> nodes(points.size());
    auto cursor = bucketBegin;
    for (std::size_t i = 0; i < hashes.size(); ++i)
        nodes[cursor[hashes[i] >> 56]++] = {hashes[i], std::int32_t(i)};

    std::vector<std::int32_t> first(points.size());
    parallelFor(execution, std::int64_t(kBuckets), [&](std::int64_t b) {
        const std::size_t begin = bucketBegin[std::size_t(b)], end = bucketBegin[std::size_t(b) + 1];
        std::sort(nodes.begin() + std::ptrdiff_t(begin), nodes.begin() + std::ptrdiff_t(end));
        for (std::size_t i = begin; i < end; ++i) {
            const std::int32_t node = nodes[i].node;
            first[std::size_t(node)] = node;
            // Two places may have one hash, so all earlier nodes of the run are compared.
            for (std::size_t j = i; j > begin && nodes[j - 1].hash == nodes[i].hash; --j) {
                const std::int32_t earlier = nodes[j - 1].node;
                if (points[std::size_t(earlier)] != points[std::size_t(node)]) continue;
                first[std::size_t(node)] = first[std::size_t(earlier)];
                break;
            }
        }
    });
    return first;
}

MeshQuality measureQuality(const TetMesh& mesh, const Execution& execution) {
    MeshQuality quality;
    std::vector<std::uint8_t> flat(mesh.tets.size());
    const Extremes extremes = measureElements(mesh, flat, execution);
    quality.flat = extremes.flat;
    quality.inverted = extremes.inverted;
    if (mesh.elementCount() > 0) {
        quality.smallestEdgeWorld = std::sqrt(extremes.smallestEdge2);
        quality.largestEdgeWorld = std::sqrt(extremes.largestEdge2);
    }
    if (quality.flat < mesh.elementCount()) {
        quality.smallestVolumeWorld = extremes.smallestVolume;
        quality.largestVolumeWorld = extremes.largestVolume;
    }
    const FaceMatching matching = matchFaces(mesh, flat, execution);
    quality.duplicate = matching.duplicateElements;
    quality.boundaryFaces = matching.singleFaces;
    quality.innerFaces = matching.pairedFaces;
    const std::vector<std::int32_t> first = firstNodeAtPlace(mesh.points, execution);
    quality.nonConformingFaces =
        matching.crowdedFaces + countInnerBoundary(mesh, matching.lone, first, execution);
    for (std::size_t i = 0; i < first.size(); ++i) quality.coincidentNodes += first[i] != std::int32_t(i);
    return quality;
}

}  // namespace tessera
