// Single elements that are flat, or nearly, against exact arithmetic: their scanlines' ends are decided in
// sums of two doubles, in 113 bits or in rationals.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "reference/oracle.h"
#include "software/software_resampler.h"
#include "tessera/lattice.h"

namespace tessera {
namespace {

constexpr int kReach = 14;  // of nodes from the lattice's origin, in voxels

TetMesh meshOf(const Vec3d (&nodes)[4]) {
    TetMesh mesh;
    mesh.points.assign(nodes, nodes + 4);
    mesh.tets = {{0, 1, 2, 3}};
    return mesh;
}

/// Somewhat more than the element's bounds, but not far away.
Block sample(const TetMesh& mesh, const Lattice& lattice) {
    Vec3d low(2 * kReach), high(-2 * kReach);
    for (const Vec3d& point : mesh.points) {
        low = glm::min(low, point / lattice.uWorld.x);
        high = glm::max(high, point / lattice.uWorld.x);
    }
    const IndexBox box{Vec3i(glm::floor(glm::max(low, Vec3d(-2 * kReach)))) - 1,
                       Vec3i(glm::ceil(glm::min(high, Vec3d(2 * kReach)))) + 2};
    return resampleBlock(SoftwareResampler(), mesh, {}, lattice, box);
}

struct Findings {
    std::int64_t inside = 0, holes = 0, spills = 0;

    void check(const TetMesh& mesh, const Lattice& lattice) {
        const Oracle oracle(mesh, lattice);
        if (oracle.volumeSign(0) == 0) return;
        const Block block = sample(mesh, lattice);
        Vec3i p;
        for (p.z = block.box.min.z; p.z < block.box.max.z; ++p.z)
            for (p.y = block.box.min.y; p.y < block.box.max.y; ++p.y)
                for (p.x = block.box.min.x; p.x < block.box.max.x; ++p.x) {
                    const bool isCovered = block.coverage[block.offset(p)] != 0, isIn = oracle.contains(0, p);
                    inside += isIn;
                    holes += isIn && !isCovered;
                    if (isCovered && !isIn)
                        spills += oracle.nearest(0, p).squaredDistance > mpq_class(0x1p-24);  // of 2^-12
                }
    }
    void expectNone() const {
        EXPECT_GT(inside, 100);
        EXPECT_EQ(holes, 0);
        EXPECT_EQ(spills, 0);
    }
};

// Parallelograms and triangles of whole numbers times a spacing: flat but for their rounding.
TEST(FlatElements, OfRoundedNodesHaveAllTheirPoints) {
    std::mt19937_64 random(7);
    const auto whole = [&](int most) { return std::uniform_int_distribution<int>(-most, most)(random); };
    Findings found;
    for (int i = 0; i < 150; ++i)
        for (const double spacing : {0.7, 1.0 / 3, 0.1}) {
            Vec3d nodes[4];
            for (Vec3d& node : nodes) node = Vec3d(whole(12), whole(12), whole(12));
            nodes[3] = nodes[0] + (nodes[1] - nodes[0]) * double(whole(1)) +
                       (nodes[2] - nodes[0]) * double(whole(1));
            for (Vec3d& node : nodes) node *= spacing;
            found.check(meshOf(nodes), Lattice::axisParallel(Vec3d(0), spacing));
        }
    found.check(meshOf({{0, -4, 1},
                        {-4, -2.6666666666666665, -1.6666666666666665},
                        {-3.333333333333333, -1.6666666666666665, -3.6666666666666665},
                        {11.333333333333332, -9, 11}}),
                Lattice::axisParallel(Vec3d(0), 0.33333333333333331));
    found.expectNone();
}

// One node lies out of the others' plane, which may be one of the lattice, by nearly nothing.
TEST(FlatElements, OfAnyThicknessHaveAllTheirPoints) {
    std::mt19937_64 random(8);
    const auto whole = [&](int most) { return std::uniform_int_distribution<int>(-most, most)(random); };
    const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1);
    Findings found;
    for (int i = 0; i < 280; ++i) {
        Vec3d nodes[4];
        const int axis = std::abs(whole(1)) + std::abs(whole(1));
        for (Vec3d& node : nodes)
            node = Vec3d(whole(kReach), whole(kReach), whole(kReach)) * (i % 2 ? 1 : 0.37);
        if (i % 3 == 0)
            for (Vec3d& node : nodes) node[axis] = nodes[0][axis];
        else
            nodes[3] = nodes[0] + (nodes[1] - nodes[0]) * 2.0 - (nodes[2] - nodes[0]);
        nodes[3][axis] += std::ldexp(1.0, -1 - i % 140);
        found.check(meshOf(nodes), lattice);
    }
    found.expectNone();
}

TEST(FlatElements, MayBeDenormalOrReachFar) {
    const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1);
    Findings found;
    for (const double thickness : {1e-300, 1e-308, 1e-320, 5e-324})
        found.check(meshOf({{0, 0, 0}, {10, 0, 0}, {0, 10, 0}, {3, 3, thickness}}), lattice);
    for (const double far : {1e290, 1e300, 1e307})
        sample(meshOf({{-5, -5, 0}, {far, 0.3, 0.2e-9}, {0, 10, 0}, {3, 3, 1e-9}}), lattice);
    found.expectNone();
}

}  // namespace
}  // namespace tessera
