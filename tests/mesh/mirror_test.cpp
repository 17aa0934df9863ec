#include "mesh/mirror.h"

#include <gtest/gtest.h>

#include "mesh/geometry.h"
#include "mesh_test_tools.h"

namespace tessera {
namespace {

/// The unit cube as five elements of positive volume, with the nodes' numbers and the elements' as fields.
TetMesh cube() {
    TetMesh mesh;
    for (int n = 0; n < 8; ++n) mesh.points.push_back({n & 1, (n >> 1) & 1, (n >> 2) & 1});
    mesh.tets = {{0, 1, 2, 4}, {3, 2, 1, 7}, {5, 1, 4, 7}, {6, 4, 2, 7}, {1, 2, 4, 7}};
    Field nodes{"node", FieldLocation::point, 2, {}};
    for (int n = 0; n < 8; ++n) nodes.values.insert(nodes.values.end(), {double(n), -double(n)});
    mesh.fields = {nodes, {"element", FieldLocation::cell, 1, {10, 11, 12, 13, 14}}};
    return mesh;
}

TEST(Mirror, SharesTheNodesOnThePlane) {
    const TetMesh both = withMirrorImage(cube(), 1, 0);
    checkMesh(both);
    EXPECT_EQ(both.nodeCount(), 12);
    EXPECT_EQ(both.elementCount(), 10);
    EXPECT_EQ(both.boundsWorld().min, Vec3d(0, -1, 0));
    EXPECT_EQ(both.boundsWorld().max, Vec3d(1, 1, 1));
    // Two triangles on each of the ten outer squares; those on the plane have two users.
    EXPECT_EQ(boundaryFaces(both).size(), 20u);
}

TEST(Mirror, KeepsOrientationAndVolume) {
    for (const int axis : {0, 1, 2}) {
        const TetMesh mesh = cube(), both = withMirrorImage(mesh, axis, 0.25);
        EXPECT_EQ(both.nodeCount(), 16) << "no node lies on the plane";
        ASSERT_EQ(both.elementCount(), 10);
        for (std::int64_t e = 0; e < mesh.elementCount(); ++e) {
            EXPECT_EQ(test::signOf(mesh, e), 1);
            EXPECT_EQ(signedVolume(both, e), signedVolume(mesh, e));
            EXPECT_DOUBLE_EQ(signedVolume(both, e + 5), signedVolume(mesh, e));
        }
    }
}

TEST(Mirror, AnInvertedElementStaysInverted) {
    TetMesh mesh = cube();
    std::swap(mesh.tets[3][0], mesh.tets[3][1]);
    const TetMesh both = withMirrorImage(mesh, 2, 1);
    EXPECT_EQ(test::countInverted(both), 2);
    EXPECT_EQ(test::signOf(both, 8), -1);
}

TEST(Mirror, CopiesFieldsToTheImages) {
    const TetMesh mesh = cube(), both = withMirrorImage(mesh, 1, 1);
    const Field &nodes = both.fields[0], &elements = both.fields[1];
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) {
        EXPECT_EQ(elements.at(e + 5, 0), elements.at(e, 0));
        for (const std::int32_t n : both.tets[std::size_t(e + 5)]) {
            Vec3d back = both.points[std::size_t(n)];
            back.y = 2 - back.y;
            const int source = int(back.x) + 2 * int(back.y) + 4 * int(back.z);
            EXPECT_EQ(nodes.at(n, 0), source);
            EXPECT_EQ(nodes.at(n, 1), -source);
        }
    }
}

TEST(Mirror, TwiceGivesFourParts) {
    const TetMesh quad = withMirrorImage(withMirrorImage(cube(), 1, 0), 2, 0);
    EXPECT_EQ(quad.elementCount(), 20);
    EXPECT_EQ(quad.nodeCount(), 18);
    EXPECT_DOUBLE_EQ(test::sumOfVolumes(quad), 4);
    EXPECT_EQ(test::countInverted(quad), 0);
}

}  // namespace
}  // namespace tessera
