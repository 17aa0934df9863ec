#include "mesh/geometry.h"

#include <gmpxx.h>

#include <cmath>

#include "base/parallel.h"
#include "mesh/face_matching.h"
#include "tessera/execution.h"

namespace tessera {

int exactVolumeSign(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    if (a == b || a == c || a == d || b == c || b == d || c == d) return 0;
    mpq_class u[3], v[3], w[3];
    for (int k = 0; k < 3; ++k) {
        const mpq_class origin(a[k]);
        u[k] = mpq_class(b[k]) - origin;
        v[k] = mpq_class(c[k]) - origin;
        w[k] = mpq_class(d[k]) - origin;
    }
    const mpq_class volume = w[0] * (u[1] * v[2] - u[2] * v[1]) + w[1] * (u[2] * v[0] - u[0] * v[2]) +
                             w[2] * (u[0] * v[1] - u[1] * v[0]);
    return sgn(volume);
}

double signedVolume(const TetMesh& mesh, std::int64_t element) {
    const auto& tet = mesh.tets[std::size_t(element)];
    const Vec3d& a = mesh.points[std::size_t(tet[0])];
    const Vec3d u = mesh.points[std::size_t(tet[1])] - a;
    const Vec3d v = mesh.points[std::size_t(tet[2])] - a;
    const Vec3d w = mesh.points[std::size_t(tet[3])] - a;
    return glm::dot(glm::cross(u, v), w) / 6;
}

double meanEdgeLength(const TetMesh& mesh, std::int64_t element) {
    const auto& tet = mesh.tets[std::size_t(element)];
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i)
        for (std::size_t j = i + 1; j < 4; ++j)
            sum += glm::distance(mesh.points[std::size_t(tet[i])], mesh.points[std::size_t(tet[j])]);
    return sum / 6;
}

std::vector<BoundaryFace> boundaryFaces(const TetMesh& mesh, int threads) {
    Execution execution;
    execution.threads = threads;
    std::vector<std::uint8_t> flat(mesh.tets.size());
    parallelForChunks(execution, mesh.elementCount(), 1 << 14, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
            const auto& tet = mesh.tets[std::size_t(e)];
            flat[std::size_t(e)] =
                volumeSign(mesh.points[std::size_t(tet[0])], mesh.points[std::size_t(tet[1])],
                           mesh.points[std::size_t(tet[2])], mesh.points[std::size_t(tet[3])]) == 0;
        }
    });
    return matchBoundary(mesh, flat, execution);
}

}  // namespace tessera
