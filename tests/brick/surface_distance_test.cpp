#include "brick/surface_distance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "brick_test_meshes.h"
#include "mesh/nearest_point.h"

namespace tessera {
namespace {

/// Corners of cells that have covered corners and others, cell by cell.
std::vector<std::uint32_t> cornersOneByOne(const std::vector<std::uint8_t>& coverage, const Vec3i& size) {
    std::set<std::uint32_t> corners;
    const auto offset = [&](const Vec3i& p) { return std::uint32_t((p.z * size.y + p.y) * size.x + p.x); };
    Vec3i p;
    for (p.z = 0; p.z + 1 < size.z; ++p.z)
        for (p.y = 0; p.y + 1 < size.y; ++p.y)
            for (p.x = 0; p.x + 1 < size.x; ++p.x) {
                int covered = 0;
                for (int c = 0; c < 8; ++c) covered += coverage[offset(p + cornerOffset(c))];
                if (covered == 0 || covered == 8) continue;
                for (int c = 0; c < 8; ++c) corners.insert(offset(p + cornerOffset(c)));
            }
    return {corners.begin(), corners.end()};
}

TEST(SurfaceDistance, CornersAreThoseOfCellsThatTheSurfaceRunsThrough) {
    std::mt19937 random(7);
    for (const Vec3i size : {Vec3i(5, 4, 3), Vec3i(2, 2, 2), Vec3i(9, 9, 9), Vec3i(1, 5, 5)})
        for (const double share : {0.0, 0.02, 0.5, 0.98, 1.0}) {
            std::bernoulli_distribution isCovered(share);
            std::vector<std::uint8_t> coverage;
            for (int n = 0; n < size.x * size.y * size.z; ++n) coverage.push_back(isCovered(random));
            EXPECT_EQ(cornersAtSurface(coverage, size), cornersOneByOne(coverage, size));
        }
}

TEST(SurfaceDistance, IsThatOfTheNearestPlaceOnTheBoundary) {
    const TetMesh mesh = ballMesh(4, 1);
    const NearestPointIndex nearest(mesh);
    for (const double spacing : {0.05, 0.31}) {
        const Vec3i first(-7, -9, -8), size(17, 16, 15);
        std::vector<std::uint32_t> offsets;
        for (std::uint32_t n = 0; n < 17 * 16 * 15; n += 3) offsets.push_back(n);
        const Vec3d origin(0.013, -0.02, 0.7);
        const double reach = 2.5 * spacing;
        const std::vector<double> found = nearest.distances({origin, spacing, first, size}, offsets, reach);
        ASSERT_EQ(found.size(), offsets.size());
        std::size_t near = 0;
        for (std::size_t i = 0; i < offsets.size(); ++i) {
            const int n = int(offsets[i]);
            const Vec3i p = first + Vec3i(n % 17, n / 17 % 16, n / (17 * 16));
            const NearestPoint one = nearest.find(origin + spacing * Vec3d(p), reach);
            EXPECT_DOUBLE_EQ(found[i], one.element < 0 ? reach : one.distanceWorld);
            near += one.element >= 0;
        }
        EXPECT_GT(near, 100u);
        EXPECT_LT(near, offsets.size());
    }
}

TEST(SurfaceDistance, OfASlopingPlaneIsLinearSoThatItsZeroIsThePlane) {
    // One large element, of which a box around the middle of a face sees that face alone.
    const Vec3d normal = glm::normalize(Vec3d(1, 2, -1.5));
    TetMesh mesh;
    const Vec3d across = glm::normalize(glm::cross(normal, Vec3d(0, 0, 1))),
                beside = glm::cross(normal, across);
    mesh.points = {6.0 * across, -3.0 * across + 5.0 * beside, -3.0 * across - 5.0 * beside, -9.0 * normal};
    mesh.tets = {{0, 1, 2, 3}};
    const NearestOnDemand nearest(mesh, 1);
    const Lattice lattice = Lattice::axisParallel(Vec3d(0.03, 0.01, -0.02), 0.125);
    const IndexBox box{Vec3i(-4), Vec3i(5)};
    std::vector<std::uint8_t> coverage;
    std::vector<double> rises;
    Vec3i p;
    for (p.z = box.min.z; p.z < box.max.z; ++p.z)
        for (p.y = box.min.y; p.y < box.max.y; ++p.y)
            for (p.x = box.min.x; p.x < box.max.x; ++p.x) {
                rises.push_back(glm::dot(lattice.worldFromIndex(Vec3d(p)), normal) / 0.125);
                coverage.push_back(rises.back() <= 0);
            }
    const SurfacePoints points = measureSurface(nearest, lattice, box, coverage);
    EXPECT_GT(points.all().size(), 100u);
    for (const auto& [offset, distance] : points.all()) EXPECT_NEAR(distance, -rises[offset], 1e-6);
    EXPECT_EQ(points.find(std::size_t(points.all().front().first)), &points.all().front().second);
}

}  // namespace
}  // namespace tessera
