#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "mesh/split_cells.h"
#include "mesh_test_tools.h"
#include "reference/random.h"

namespace tessera {
namespace {

using test::countFaceUsers;
using test::countInverted;
using test::sumOfVolumes;

TetMesh split(const std::vector<Vec3d>& points, const CellList& cells, int threads = 2) {
    Execution execution;
    execution.threads = threads;
    const SplitCells result = splitCells(points, cells, execution);
    TetMesh mesh;
    mesh.points = points;
    for (const AddedNode& node : result.addedNodes) mesh.points.push_back(node.point);
    mesh.tets = result.tets;
    EXPECT_EQ(result.tets.size(), result.sourceCell.size());
    EXPECT_TRUE(std::is_sorted(result.sourceCell.begin(), result.sourceCell.end()));
    checkMesh(mesh);
    return mesh;
}

/// Nodes of (n + 1)^3 places, the inner ones moved.
struct Grid {
    int n;
    std::vector<Vec3d> points;

    Grid(int size, double shake, std::uint64_t seed) : n(size) {
        Random random(seed);
        for (int k = 0; k <= n; ++k)
            for (int j = 0; j <= n; ++j)
                for (int i = 0; i <= n; ++i) {
                    Vec3d offset = shake * random.offset();
                    if (i == 0 || i == n) offset.x = 0;  // the block stays a cube, so its volume is known
                    if (j == 0 || j == n) offset.y = 0;
                    if (k == 0 || k == n) offset.z = 0;
                    points.push_back(Vec3d(i, j, k) + offset);
                }
    }
    std::int32_t node(int i, int j, int k) const { return std::int32_t((k * (n + 1) + j) * (n + 1) + i); }
    /// Corners of a cube in the order of VTK's hexahedron.
    std::array<std::int32_t, 8> hex(int i, int j, int k) const {
        return {node(i, j, k),     node(i + 1, j, k),     node(i + 1, j + 1, k),     node(i, j + 1, k),
                node(i, j, k + 1), node(i + 1, j, k + 1), node(i + 1, j + 1, k + 1), node(i, j + 1, k + 1)};
    }
};

void addPolyhedron(CellList& cells, const std::vector<std::vector<std::int32_t>>& faces) {
    std::vector<std::int32_t> stream{std::int32_t(faces.size())};
    for (const auto& face : faces) {
        stream.push_back(std::int32_t(face.size()));
        stream.insert(stream.end(), face.begin(), face.end());
    }
    cells.add(CellKind::polyhedron, stream.data(), std::int64_t(stream.size()));
}

std::vector<std::vector<std::int32_t>> hexFaces(const std::array<std::int32_t, 8>& h) {
    return {{h[0], h[4], h[7], h[3]}, {h[1], h[2], h[6], h[5]}, {h[0], h[1], h[5], h[4]},
            {h[3], h[7], h[6], h[2]}, {h[0], h[3], h[2], h[1]}, {h[4], h[5], h[6], h[7]}};
}

/// Adds one cube as cells of the chosen sort; all sorts leave its six quads as faces, or triangles cut by the
/// common rule.
void addCube(CellList& cells, std::vector<Vec3d>& points, const std::array<std::int32_t, 8>& h, int sort) {
    switch (sort) {
        case 0:
            cells.add(CellKind::hex, h.data(), 8);
            break;
        case 1: {
            const std::int32_t voxel[] = {h[0], h[1], h[3], h[2], h[4], h[5], h[7], h[6]};
            cells.add(CellKind::voxel, voxel, 8);
            break;
        }
        case 2: {  // six pyramids around the centre
            Vec3d centre(0);
            for (const std::int32_t n : h) centre += points[std::size_t(n)] / 8.0;
            points.push_back(centre);
            for (const auto& face : hexFaces(h)) {
                const std::int32_t pyramid[] = {face[0], face[3], face[2], face[1],
                                                std::int32_t(points.size() - 1)};
                cells.add(CellKind::pyramid, pyramid, 5);
            }
            break;
        }
        default:
            addPolyhedron(cells, hexFaces(h));
    }
}

void expectConforming(const TetMesh& mesh, std::int64_t boundaryFacesExpected) {
    std::int64_t single = 0;
    for (const auto& [face, users] : countFaceUsers(mesh)) {
        ASSERT_LE(users, 2);
        single += users == 1;
    }
    EXPECT_EQ(single, boundaryFacesExpected);
}

class SplitMixedCubes : public testing::TestWithParam<double> {};

TEST_P(SplitMixedCubes, IsConformingAndFillsTheBlock) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
        Grid grid(6, GetParam(), seed);
        std::vector<Vec3d> points = grid.points;
        CellList cells;
        Random random(100 + seed);
        for (int k = 0; k < grid.n; ++k)
            for (int j = 0; j < grid.n; ++j)
                for (int i = 0; i < grid.n; ++i) addCube(cells, points, grid.hex(i, j, k), random.below(4));
        const TetMesh mesh = split(points, cells);
        expectConforming(mesh, 6 * 6 * 6 * 2);
        EXPECT_EQ(countInverted(mesh), 0);
        EXPECT_NEAR(sumOfVolumes(mesh), 216, 1e-10);
    }
}

INSTANTIATE_TEST_SUITE_P(Shake, SplitMixedCubes, testing::Values(0.0, 0.05, 0.15));

TEST(SplitCells, CutsHexesOnlyIntoSixTets) {
    const Grid grid(4, 0.1, 3);
    CellList cells;
    for (int k = 0; k < 4; ++k)
        for (int j = 0; j < 4; ++j)
            for (int i = 0; i < 4; ++i) cells.add(CellKind::hex, grid.hex(i, j, k).data(), 8);
    const TetMesh mesh = split(grid.points, cells);
    EXPECT_EQ(mesh.elementCount(), 64 * 6);
    EXPECT_EQ(mesh.points.size(), grid.points.size());
}

TEST(SplitCells, CutsWedgesIntoThreeTetsThatConform) {
    const Grid grid(5, 0.1, 4);
    CellList cells;
    for (int k = 0; k < 5; ++k)
        for (int j = 0; j < 5; ++j)
            for (int i = 0; i < 5; ++i) {
                const auto h = grid.hex(i, j, k);
                // VTK's wedge: the triangle of its first three nodes looks away from the other three.
                const std::int32_t a[] = {h[0], h[2], h[1], h[4], h[6], h[5]};
                const std::int32_t b[] = {h[0], h[3], h[2], h[4], h[7], h[6]};
                cells.add(CellKind::wedge, a, 6);
                cells.add(CellKind::wedge, b, 6);
            }
    const TetMesh mesh = split(grid.points, cells);
    EXPECT_EQ(mesh.elementCount(), 125 * 6);
    EXPECT_EQ(countInverted(mesh), 0);
    expectConforming(mesh, 5 * 5 * 6 * 2);
    EXPECT_NEAR(sumOfVolumes(mesh), 125, 1e-10);
}

TEST(SplitCells, CutsBlocksWithSeparateNodesAlike) {
    // Every cube has its own copies of its nodes, in shuffled order; merging nodes by place afterwards must
    // give a conforming mesh.
    const Grid grid(5, 0.15, 5);
    Random random(6);
    std::vector<Vec3d> points;
    CellList cells;
    for (int k = 0; k < 5; ++k)
        for (int j = 0; j < 5; ++j)
            for (int i = 0; i < 5; ++i) {
                const auto h = grid.hex(i, j, k);
                std::array<std::int32_t, 8> own{}, order{0, 1, 2, 3, 4, 5, 6, 7};
                for (int s = 7; s > 0; --s)
                    std::swap(order[std::size_t(s)], order[std::size_t(random.below(s + 1))]);
                for (const std::int32_t s : order) {
                    own[std::size_t(s)] = std::int32_t(points.size());
                    points.push_back(grid.points[std::size_t(h[std::size_t(s)])]);
                }
                if (random.below(2))
                    cells.add(CellKind::hex, own.data(), 8);
                else
                    addPolyhedron(cells, hexFaces(own));
            }
    TetMesh mesh = split(points, cells);
    std::map<std::array<double, 3>, std::int32_t> nodeAt;
    for (auto& tet : mesh.tets)
        for (std::int32_t& n : tet) {
            const Vec3d& p = mesh.points[std::size_t(n)];
            n = nodeAt.try_emplace({p.x, p.y, p.z}, n).first->second;
        }
    expectConforming(mesh, 5 * 5 * 6 * 2);
    EXPECT_NEAR(sumOfVolumes(mesh), 125, 1e-10);
}

TEST(SplitCells, StartsADiagonalAtTheSmallestNode) {
    const Grid grid(1, 0, 1);
    CellList cells;
    cells.add(CellKind::hex, grid.hex(0, 0, 0).data(), 8);
    const auto users = countFaceUsers(split(grid.points, cells));
    // On x = 1 the smallest node is (1,0,0), node 1; its diagonal ends at (1,1,1), node 7.
    EXPECT_TRUE(users.contains({1, 3, 7}));
    EXPECT_TRUE(users.contains({1, 5, 7}));
}

TEST(SplitCells, KeepsTheOrientationOfInvertedCells) {
    const Grid grid(1, 0, 1);
    const auto h = grid.hex(0, 0, 0);
    const std::array<std::int32_t, 8> mirrored{h[4], h[5], h[6], h[7], h[0], h[1], h[2], h[3]};
    CellList cells;
    cells.add(CellKind::hex, mirrored.data(), 8);
    const std::int32_t tet[] = {h[1], h[0], h[3], h[4]}, pyramid[] = {h[0], h[3], h[2], h[1], h[4]};
    cells.add(CellKind::tet, tet, 4);
    cells.add(CellKind::pyramid, pyramid, 5);
    const TetMesh mesh = split(grid.points, cells);
    EXPECT_EQ(mesh.elementCount(), 6 + 1 + 2);
    EXPECT_EQ(countInverted(mesh), mesh.elementCount());
}

TEST(SplitCells, FillsAnOctreeCellWithHangingNodes) {
    // A cube whose side x = 1 is four squares, and with the nodes of these on its other faces.
    std::vector<Vec3d> points;
    for (int k = 0; k < 3; ++k)
        for (int j = 0; j < 3; ++j)
            for (int i = 0; i < 3; ++i) points.push_back(Vec3d(i, j, k) / 2.0);
    const auto n = [](int i, int j, int k) { return std::int32_t((k * 3 + j) * 3 + i); };
    CellList cells;
    addPolyhedron(cells, {{n(0, 0, 0), n(0, 0, 2), n(0, 2, 2), n(0, 2, 0)},
                          {n(2, 0, 0), n(2, 1, 0), n(2, 1, 1), n(2, 0, 1)},
                          {n(2, 1, 0), n(2, 2, 0), n(2, 2, 1), n(2, 1, 1)},
                          {n(2, 0, 1), n(2, 1, 1), n(2, 1, 2), n(2, 0, 2)},
                          {n(2, 1, 1), n(2, 2, 1), n(2, 2, 2), n(2, 1, 2)},
                          {n(0, 0, 0), n(2, 0, 0), n(2, 0, 1), n(2, 0, 2), n(0, 0, 2)},
                          {n(0, 2, 0), n(0, 2, 2), n(2, 2, 2), n(2, 2, 1), n(2, 2, 0)},
                          {n(0, 0, 0), n(0, 2, 0), n(2, 2, 0), n(2, 1, 0), n(2, 0, 0)},
                          {n(0, 0, 2), n(2, 0, 2), n(2, 1, 2), n(2, 2, 2), n(0, 2, 2)}});
    const TetMesh mesh = split(points, cells);
    EXPECT_NEAR(sumOfVolumes(mesh), 1, 1e-14);
    EXPECT_EQ(countInverted(mesh), 0);
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) EXPECT_NE(test::signOf(mesh, e), 0);
    expectConforming(mesh, 2 + 8 + 4 * 3);
}

TEST(SplitCells, FillsAConcavePolyhedron) {
    // An L, extruded: no node but those at the inner corner sees all of it.
    const std::vector<Vec3d> outline = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}};
    std::vector<Vec3d> points = outline;
    for (const Vec3d& p : outline) points.push_back(p + Vec3d(0, 0, 1));
    std::vector<std::vector<std::int32_t>> faces{{5, 4, 3, 2, 1, 0}, {6, 7, 8, 9, 10, 11}};
    for (std::int32_t i = 0; i < 6; ++i) faces.push_back({i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6});
    CellList cells;
    addPolyhedron(cells, faces);
    const TetMesh mesh = split(points, cells);
    EXPECT_NEAR(sumOfVolumes(mesh), 3, 1e-14);
    EXPECT_EQ(countInverted(mesh), 0);
}

TEST(SplitCells, TurnsPolyhedronFacesThatRunTheWrongWay) {
    Random random(7);
    const Grid grid(3, 0.1, 8);
    for (int trial = 0; trial < 20; ++trial) {
        CellList cells;
        for (int k = 0; k < 3; ++k)
            for (int j = 0; j < 3; ++j)
                for (int i = 0; i < 3; ++i) {
                    auto faces = hexFaces(grid.hex(i, j, k));
                    for (int flips = random.below(3); flips > 0; --flips) {
                        auto& face = faces[std::size_t(random.below(6))];
                        std::reverse(face.begin(), face.end());
                    }
                    addPolyhedron(cells, faces);
                }
        const TetMesh mesh = split(grid.points, cells);
        EXPECT_NEAR(sumOfVolumes(mesh), 27, 1e-11);
        EXPECT_EQ(countInverted(mesh), 0);
        expectConforming(mesh, 9 * 6 * 2);
    }
}

TEST(SplitCells, SurvivesCollapsedCells) {
    Grid grid(1, 0, 1);
    const auto h = grid.hex(0, 0, 0);
    // A wedge written as a hexahedron with repeated nodes: half the cube.
    const std::int32_t repeated[] = {h[0], h[1], h[2], h[2], h[4], h[5], h[6], h[6]};
    CellList cells;
    cells.add(CellKind::hex, repeated, 8);
    TetMesh mesh = split(grid.points, cells);
    EXPECT_NEAR(sumOfVolumes(mesh), 0.5, 1e-15);
    EXPECT_EQ(mesh.elementCount(), 3);
    EXPECT_EQ(countInverted(mesh), 0);

    // The same with separate nodes at one place.
    grid.points[std::size_t(h[3])] = grid.points[std::size_t(h[2])];
    grid.points[std::size_t(h[7])] = grid.points[std::size_t(h[6])];
    CellList coincident;
    coincident.add(CellKind::hex, h.data(), 8);
    mesh = split(grid.points, coincident);
    EXPECT_NEAR(sumOfVolumes(mesh), 0.5, 1e-15);
    EXPECT_EQ(countInverted(mesh), 0);

    // One point, and one node.
    const std::vector<Vec3d> onePlace(8, Vec3d(1, 2, 3));
    CellList point;
    point.add(CellKind::hex, h.data(), 8);
    const std::int32_t same[] = {0, 0, 0, 0, 0, 0, 0, 0};
    point.add(CellKind::hex, same, 8);
    addPolyhedron(point, {});
    addPolyhedron(point, {{0, 1}, {1, 0}});
    EXPECT_EQ(sumOfVolumes(split(onePlace, point)), 0);
}

TEST(SplitCells, KeepsAddedNodesFiniteAtTheEndOfTheRangeOfDouble) {
    constexpr double kLargest = std::numeric_limits<double>::max();
    for (const double length : {1.0, 1e200, kLargest}) {
        Grid grid(1, 0, 1);
        for (Vec3d& point : grid.points) point = length * (2.0 * point - 1.0);
        CellList cells;
        addPolyhedron(cells, hexFaces(grid.hex(0, 0, 0)));
        // Folded over, so that no node sees the whole cell.
        const auto h = grid.hex(0, 0, 0);
        const std::int32_t folded[] = {h[6], h[1], h[2], h[3], h[4], h[5], h[0], h[7]};
        cells.add(CellKind::hex, folded, 8);
        for (const AddedNode& node : splitCells(grid.points, cells, {}).addedNodes) {
            EXPECT_TRUE(std::isfinite(node.point.x + node.point.y + node.point.z)) << length;
            for (int k = 0; k < 3; ++k) EXPECT_LE(std::fabs(node.point[k]), length);
        }
    }
}

TEST(SplitCells, TakesCellsWithVeryManyNodesAndFaces) {
    // A prism over a regular polygon, and a cell that has one face over and over.
    constexpr int kSides = 30000;
    std::vector<Vec3d> points;
    std::vector<std::vector<std::int32_t>> faces(2);
    for (int i = 0; i < kSides; ++i) {
        const double angle = 2 * M_PI * i / kSides;
        for (int z = 0; z < 2; ++z) points.push_back({std::cos(angle), std::sin(angle), z});
        const int j = (i + 1) % kSides;
        faces[0].push_back(2 * (kSides - 1 - i));
        faces[1].push_back(2 * i + 1);
        faces.push_back({2 * i, 2 * j, 2 * j + 1, 2 * i + 1});
    }
    CellList prism;
    addPolyhedron(prism, faces);
    EXPECT_NEAR(sumOfVolumes(split(points, prism)), kSides / 2.0 * std::sin(2 * M_PI / kSides), 1e-9);
    CellList repeated;
    addPolyhedron(repeated, std::vector<std::vector<std::int32_t>>(std::size_t(kSides), {0, 2, 1}));
    EXPECT_EQ(sumOfVolumes(split(points, repeated)), 0);
}

TEST(SplitCells, GivesTheSameForEveryNumberOfThreads) {
    const Grid grid(20, 0.4, 9);  // so shaken that many cells need a centre
    CellList cells;
    std::vector<Vec3d> points = grid.points;
    for (int k = 0; k < 20; ++k)
        for (int j = 0; j < 20; ++j)
            for (int i = 0; i < 20; ++i) addCube(cells, points, grid.hex(i, j, k), i % 2 ? 3 : 0);
    const TetMesh one = split(points, cells, 1);
    EXPECT_GT(one.points.size(), points.size());
    for (const int threads : {2, 7}) {
        const TetMesh other = split(points, cells, threads);
        EXPECT_EQ(one.tets, other.tets);
        EXPECT_EQ(one.points, other.points);
    }
}

TEST(SplitCells, PutsAddedNodesAtTheMeanOfTheirParents) {
    const Grid grid(6, 0.45, 10);
    CellList cells;
    for (int i = 0; i < 6; ++i) addPolyhedron(cells, hexFaces(grid.hex(i, 2, 3)));
    for (int i = 0; i < 6; ++i) addPolyhedron(cells, hexFaces(grid.hex(i, 4, 1)));
    const SplitCells result = splitCells(grid.points, cells, {});
    for (const AddedNode& node : result.addedNodes) {
        ASSERT_EQ(node.parents.size(), 8u);
        Vec3d mean(0);
        for (const std::int32_t parent : node.parents) mean += grid.points[std::size_t(parent)] / 8.0;
        EXPECT_LT(glm::distance(mean, node.point), 1e-14);
    }
}

}  // namespace
}  // namespace tessera
