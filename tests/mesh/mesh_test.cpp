#include <gmpxx.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "brick_test_meshes.h"
#include "mesh/element_index.h"
#include "mesh/face_matching.h"
#include "mesh/geometry.h"
#include "mesh/mesh_quality.h"
#include "mesh/nearest_point.h"
#include "mesh/shell_edges.h"
#include "mesh_test_tools.h"
#include "reference/random.h"

namespace tessera {
namespace {

using test::countFaceUsers;

/// 4 x 4 determinant of homogeneous coordinates in rationals: another formula than that of the code under
/// test.
int referenceSign(const std::array<Vec3d, 4>& p) {
    mpq_class m[4][4];
    for (int i = 0; i < 4; ++i) {
        for (int k = 0; k < 3; ++k) m[i][k] = mpq_class(p[std::size_t(i)][k]);
        m[i][3] = 1;
    }
    int sign = 1;
    for (int column = 0; column < 4; ++column) {
        int pivot = column;
        while (pivot < 4 && m[pivot][column] == 0) ++pivot;
        if (pivot == 4) return 0;
        if (pivot != column) {
            std::swap(m[pivot], m[column]);
            sign = -sign;
        }
        sign *= sgn(m[column][column]);
        for (int row = column + 1; row < 4; ++row) {
            const mpq_class factor = m[row][column] / m[column][column];
            for (int k = column; k < 4; ++k) m[row][k] -= factor * m[column][k];
        }
    }
    return -sign;  // rows 1 to 3 minus row 0 give the volume with this sign
}

int signOf(const std::array<Vec3d, 4>& p) {
    return volumeSign(p[0], p[1], p[2], p[3]);
}

TEST(VolumeSign, IsPositiveForTheUnitCorner) {
    EXPECT_EQ(signOf({Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)}), 1);
    EXPECT_EQ(signOf({Vec3d(0, 0, 0), Vec3d(0, 1, 0), Vec3d(1, 0, 0), Vec3d(0, 0, 1)}), -1);
}

TEST(VolumeSign, AgreesWithRationalsOnNearlyFlatTets) {
    Random random(1);
    int zeros = 0;
    for (int trial = 0; trial < 20000; ++trial) {
        std::array<Vec3d, 4> p{random.offset(), random.offset(), random.offset(), Vec3d(0)};
        const double shift = trial % 3 == 0 ? 0 : std::ldexp(1.0, trial % 60 - 20);
        for (int i = 0; i < 3; ++i) p[std::size_t(i)] += Vec3d(shift);
        const double s = random.centred(), t = random.centred();
        p[3] = p[0] + s * (p[1] - p[0]) + t * (p[2] - p[0]);
        for (int k = 0; k < 3; ++k)
            for (int ulps = random.below(3); ulps > 0; --ulps)
                p[3][k] = std::nextafter(p[3][k], random.below(2) ? 1e300 : -1e300);
        if (trial % 5 == 0)
            for (Vec3d& q : p)
                q.z = double(float(q.x)) + double(float(q.y));  // often exactly flat after rounding
        const int expected = referenceSign(p);
        zeros += expected == 0;
        ASSERT_EQ(signOf(p), expected) << "trial " << trial;
        std::swap(p[0], p[1]);
        ASSERT_EQ(signOf(p), -expected) << "trial " << trial;
    }
    EXPECT_GT(zeros, 100);
}

TEST(VolumeSign, AgreesWithRationalsOnTheIntegerGrid) {
    Random random(2);
    for (int trial = 0; trial < 5000; ++trial) {
        std::array<Vec3d, 4> p;
        for (Vec3d& q : p) q = Vec3d(random.below(3), random.below(3), random.below(3)) * 0.1;
        ASSERT_EQ(signOf(p), referenceSign(p));
    }
}

TEST(VolumeSign, SurvivesUnderflowAndOverflow) {
    Random random(3);
    for (int trial = 0; trial < 4000; ++trial) {
        std::array<Vec3d, 4> p;
        for (Vec3d& q : p)
            for (int k = 0; k < 3; ++k) q[k] = std::ldexp(random.centred(), random.below(2040) - 1030);
        ASSERT_EQ(signOf(p), referenceSign(p)) << "trial " << trial;
        for (Vec3d& q : p)
            for (int k = 0; k < 3; ++k) q[k] = std::ldexp(random.centred(), random.below(4) - 1072);
        ASSERT_EQ(signOf(p), referenceSign(p)) << "trial " << trial;
    }
}

/// A block of n^3 cubes, six tets each around the diagonal, shaken and with elements of either orientation.
TetMesh shakenCubes(int n, double shake, std::uint64_t seed) {
    TetMesh mesh;
    Random random(seed);
    const auto node = [&](int i, int j, int k) { return std::int32_t((k * (n + 1) + j) * (n + 1) + i); };
    for (int k = 0; k <= n; ++k)
        for (int j = 0; j <= n; ++j)
            for (int i = 0; i <= n; ++i) mesh.points.push_back(Vec3d(i, j, k) + shake * random.offset());
    const int axes[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    for (int k = 0; k < n; ++k)
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i)
                for (const auto& order : axes) {
                    Vec3i at(i, j, k);
                    std::array<std::int32_t, 4> tet{node(i, j, k)};
                    for (int step = 0; step < 3; ++step) {
                        ++at[order[step]];
                        tet[std::size_t(step) + 1] = node(at.x, at.y, at.z);
                    }
                    if (random.below(2)) std::swap(tet[0], tet[3]);
                    mesh.tets.push_back(tet);
                }
    return mesh;
}

TEST(BoundaryFaces, AreThoseThatOneElementUses) {
    const TetMesh mesh = shakenCubes(6, 0.2, 4);
    const auto users = countFaceUsers(mesh);
    for (const int threads : {1, 2, 5}) {
        const std::vector<BoundaryFace> faces = boundaryFaces(mesh, threads);
        EXPECT_EQ(faces.size(), 6u * 6 * 6 * 2);
        std::int32_t before = 0;
        for (const BoundaryFace& face : faces) {
            EXPECT_GE(face.element, before);
            before = face.element;
            auto key = face.nodes;
            std::sort(key.begin(), key.end());
            EXPECT_EQ(users.at(key), 1);
            for (const std::int32_t n : face.nodes)
                EXPECT_EQ(std::count(mesh.tets[std::size_t(face.element)].begin(),
                                     mesh.tets[std::size_t(face.element)].end(), n),
                          1);
        }
    }
}

TEST(BoundaryFaces, LookOutwardForPositiveElements) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.tets = {{0, 1, 2, 3}};
    for (const BoundaryFace& face : boundaryFaces(mesh)) {
        const Vec3d &a = mesh.points[std::size_t(face.nodes[0])],
                    &b = mesh.points[std::size_t(face.nodes[1])],
                    &c = mesh.points[std::size_t(face.nodes[2])];
        EXPECT_LT(volumeSign(a, b, c, Vec3d(0.1, 0.1, 0.1)), 0);
    }
}

TEST(BoundaryFaces, LeaveOutFlatElements) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}};
    mesh.tets = {{0, 1, 2, 3}, {0, 1, 2, 4}};  // the second lies in the plane z = 0
    const std::vector<BoundaryFace> faces = boundaryFaces(mesh);
    ASSERT_EQ(faces.size(), 4u);
    for (const BoundaryFace& face : faces) EXPECT_EQ(face.element, 0);
    mesh.tets = {{0, 1, 2, 4}};
    EXPECT_TRUE(boundaryFaces(mesh).empty());
    EXPECT_EQ(NearestPointIndex(mesh).find({0, 0, 1}, 1e9).element, -1);
    mesh.tets.clear();
    EXPECT_EQ(NearestPointIndex(mesh).find({0, 0, 1}, 1e9).element, -1);
}

TEST(MeshQuality, CountsWhatIsWrong) {
    TetMesh mesh = shakenCubes(3, 0, 5);
    for (auto& tet : mesh.tets)
        if (test::signOf(mesh, &tet - mesh.tets.data()) < 0) std::swap(tet[0], tet[1]);
    const MeshQuality sound = measureQuality(mesh, {});
    EXPECT_EQ(
        sound.flat + sound.inverted + sound.duplicate + sound.coincidentNodes + sound.nonConformingFaces, 0);
    EXPECT_EQ(sound.boundaryFaces, 108);
    EXPECT_EQ(sound.innerFaces, (162 * 4 - 108) / 2);
    EXPECT_EQ(sound.smallestEdgeWorld, 1);
    EXPECT_NEAR(sound.largestEdgeWorld, std::sqrt(3), 1e-15);
    EXPECT_NEAR(sound.smallestVolumeWorld, 1.0 / 6, 1e-15);
    EXPECT_NEAR(sound.largestVolumeWorld, 1.0 / 6, 1e-15);

    std::swap(mesh.tets[7][0], mesh.tets[7][1]);  // inverted
    mesh.tets.push_back(
        {mesh.tets[20][2], mesh.tets[20][0], mesh.tets[20][1], mesh.tets[20][3]});  // duplicate
    mesh.points.push_back(mesh.points[5]);                                          // coincident
    mesh.points.push_back({-0.0, 0, 0});                                            // coincident with node 0
    mesh.tets.push_back({0, 1, 2, 3});                                              // flat: a row of nodes
    const MeshQuality quality = measureQuality(mesh, {});
    EXPECT_EQ(quality.flat, 1);
    EXPECT_EQ(quality.inverted, 1);
    EXPECT_EQ(quality.duplicate, 1);
    EXPECT_EQ(quality.coincidentNodes, 2);
    EXPECT_GE(quality.nonConformingFaces, 1);  // faces of the duplicate have three users
}

TEST(MeshQuality, FindsHangingNodesAndStackedFaces) {
    // One tet on z > 0, two below it that halve its face along an edge: node 4 hangs.
    TetMesh hanging;
    hanging.points = {{0, 0, 0}, {2, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 0}, {0, 0, -1}};
    hanging.tets = {{0, 1, 2, 3}, {0, 2, 4, 5}, {4, 2, 1, 5}};
    // The face (0,1,2) has node 4 on its edge; so has (0,1,3), which holds that edge too.
    EXPECT_EQ(measureQuality(hanging, {}).nonConformingFaces, 2);

    // The same face twice, with separate nodes.
    TetMesh stacked;
    stacked.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1},
                      {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, -1}};
    stacked.tets = {{0, 1, 2, 3}, {4, 6, 5, 7}};
    EXPECT_EQ(measureQuality(stacked, {}).nonConformingFaces, 2);
    EXPECT_EQ(measureQuality(stacked, {}).coincidentNodes, 3);
}

TEST(MeshQuality, MeasuresMeshesAtTheEndOfTheRangeOfDouble) {
    // The box of a face and its margin are infinite.
    constexpr double kLargest = std::numeric_limits<double>::max();
    TetMesh mesh;
    mesh.points = {{kLargest, 0, 0}, {-kLargest, 0, 0}, {0, kLargest, 0}, {0, 0, -kLargest}, {0, 0, 5e-324}};
    mesh.tets = {{0, 1, 2, 3}, {0, 1, 2, 4}};
    const MeshQuality quality = measureQuality(mesh, {});
    EXPECT_EQ(quality.flat, 0);
    EXPECT_EQ(quality.boundaryFaces, 6);
}

TEST(MeshQuality, FirstNodeAtPlaceIsTheLowestIndex) {
    Random random(6);
    std::vector<Vec3d> points;
    for (int i = 0; i < 3000; ++i)
        points.push_back(Vec3d(random.below(9), random.below(9), random.below(9)) / 3.0);
    const std::vector<std::int32_t> first = firstNodeAtPlace(points, {});
    for (std::size_t i = 0; i < points.size(); ++i) {
        const auto expected = std::find(points.begin(), points.end(), points[i]) - points.begin();
        ASSERT_EQ(first[i], expected);
    }
}

/// Distance to a triangle by projection in long double and by its three edges: slow and plain.
long double referenceDistance(const Vec3d& p, const std::array<Vec3d, 3>& t) {
    using V = glm::tvec3<long double>;
    const V q(p);
    const V c[3] = {V(t[0]), V(t[1]), V(t[2])};
    long double best = std::numeric_limits<long double>::infinity();
    for (int i = 0; i < 3; ++i) {
        const V a = c[i], e = c[(i + 1) % 3] - a;
        const long double length2 = glm::dot(e, e);
        const long double s = length2 > 0 ? glm::clamp(glm::dot(q - a, e) / length2, 0.0L, 1.0L) : 0.0L;
        best = std::min(best, glm::length(q - a - s * e));
    }
    const V n = glm::cross(c[1] - c[0], c[2] - c[0]);
    const long double n2 = glm::dot(n, n);
    if (!(n2 > 0)) return best;
    const V foot = q - n * (glm::dot(q - c[0], n) / n2);
    for (int i = 0; i < 3; ++i)
        if (glm::dot(glm::cross(c[(i + 1) % 3] - c[i], foot - c[i]), n) < 0) return best;
    return std::min(best, glm::length(q - foot));
}

void expectNearestAgrees(const TetMesh& mesh, Random& random, int queries) {
    const std::vector<BoundaryFace> faces = boundaryFaces(mesh);
    const NearestPointIndex index(mesh, 2);
    const Box3d box = mesh.boundsWorld();
    const double extent = glm::length(box.size());
    for (int i = 0; i < queries; ++i) {
        const Vec3d p = box.min + (1.4 * random.place() - 0.2) * box.size();
        long double expected = std::numeric_limits<long double>::infinity();
        for (const BoundaryFace& face : faces)
            expected = std::min(expected, referenceDistance(p, {mesh.points[std::size_t(face.nodes[0])],
                                                                mesh.points[std::size_t(face.nodes[1])],
                                                                mesh.points[std::size_t(face.nodes[2])]}));
        const NearestPoint nearest = index.find(p, std::numeric_limits<double>::infinity());
        ASSERT_GE(nearest.element, 0);
        ASSERT_NEAR(nearest.distanceWorld, double(expected), 1e-12 * extent);
        Vec3d place(0);
        double sum = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            ASSERT_GE(nearest.weights[k], 0);
            ASSERT_LE(nearest.weights[k], 1);
            sum += nearest.weights[k];
            place += nearest.weights[k] * mesh.points[std::size_t(nearest.nodes[k])];
        }
        ASSERT_NEAR(sum, 1, 1e-14);
        ASSERT_NEAR(glm::distance(place, p), double(expected), 1e-12 * extent);
        EXPECT_EQ(index.find(p, 0.5 * nearest.distanceWorld).element, -1);
        EXPECT_EQ(index.find(p, 1.001 * nearest.distanceWorld).element, nearest.element);
    }
}

TEST(NearestPoint, AgreesWithBruteForceOnShakenCubes) {
    Random random(7);
    expectNearestAgrees(shakenCubes(4, 0.3, 8), random, 500);
}

TEST(NearestPoint, AgreesWithBruteForceOnNeedlesAndSlivers) {
    Random random(9);
    for (int trial = 0; trial < 40; ++trial) {
        TetMesh mesh;
        for (std::int32_t e = 0; e < 12; ++e) {
            const Vec3d a = random.place(), b = random.place();
            const double thin = std::ldexp(1.0, -random.below(40));
            mesh.points.insert(mesh.points.end(), {a, b, a + random.unit() * (b - a) + thin * random.offset(),
                                                   a + random.unit() * (b - a) + thin * random.offset()});
            mesh.tets.push_back({4 * e, 4 * e + 1, 4 * e + 2, 4 * e + 3});
        }
        expectNearestAgrees(mesh, random, 20);
    }
}

TEST(NearestPoint, GivesTiesToTheLowestElement) {
    const TetMesh mesh = shakenCubes(5, 0.15, 10);
    const std::vector<BoundaryFace> faces = boundaryFaces(mesh);
    const NearestPointIndex one(mesh, 1), many(mesh, 5);
    Random random(11);
    for (int i = 0; i < 300; ++i) {
        // Straight out of a corner of the block: the node is nearest, and several faces share it.
        const Vec3i side(random.below(2), random.below(2), random.below(2));
        const auto node = std::int32_t((side.z * 5 * 6 + side.y * 5) * 6 + side.x * 5);
        const Vec3d p = mesh.points[std::size_t(node)] + (Vec3d(side) - 0.5) * (1 + random.unit());
        const NearestPoint nearest = one.find(p, 1e9);
        std::int32_t lowest = std::numeric_limits<std::int32_t>::max();
        for (const BoundaryFace& face : faces)
            if (std::count(face.nodes.begin(), face.nodes.end(), node))
                lowest = std::min(lowest, face.element);
        if (nearest.distanceWorld == glm::distance(p, mesh.points[std::size_t(node)])) {
            EXPECT_EQ(nearest.element, lowest);
        }
        const NearestPoint again = many.find(p, 1e9);
        EXPECT_EQ(nearest.element, again.element);
        EXPECT_EQ(nearest.weights, again.weights);
        EXPECT_EQ(nearest.nodes, again.nodes);
    }
}

TEST(NearestPoint, BlendsNodesAndTakesTheElementsOwnValue) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}};
    mesh.tets = {{0, 1, 2, 3}};
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const Field linear{"linear", FieldLocation::point, 2, {1, 0, 5, 0, 9, 0, nan, 0}};  // 1 + x + 2 y
    const Field cell{"cell", FieldLocation::cell, 1, {42}};
    const NearestPoint nearest = NearestPointIndex(mesh).find({1, 1, -3}, 10);
    EXPECT_EQ(nearest.distanceWorld, 3);
    EXPECT_NEAR(nearest.value(linear, 0), 4, 1e-14);
    EXPECT_EQ(nearest.value(linear, 1), 0);
    EXPECT_EQ(nearest.value(cell, 0), 42);
    const NearestPoint top = NearestPointIndex(mesh).find({0, 0, 9}, 10);
    EXPECT_TRUE(std::isnan(top.value(linear, 0)));
    EXPECT_TRUE(std::isnan(NearestPoint{}.value(linear, 0)));
}

TEST(ElementIndex, FindsEveryElementWhoseBoxMeetsTheBox) {
    const TetMesh mesh = shakenCubes(5, 0.3, 12);
    Random random(13);
    for (const int threads : {1, 3}) {
        const ElementIndex index(mesh, {.threads = threads});
        for (int i = 0; i < 200; ++i) {
            const Vec3d at = 6.0 * random.place() - 0.5;
            Box3d box;
            box.include(at);
            if (i % 3) box.include(at + 2.0 * random.place());
            std::vector<std::int32_t> found{-7}, expected{-7};  // results are appended
            index.query(box, found);
            EXPECT_EQ(index.count(box), std::int64_t(found.size()) - 1);
            const double near = 0.02;  // boxes may be taken for a little larger than they are
            for (std::int32_t e = 0; e < mesh.elementCount(); ++e) {
                Box3d own;
                for (const std::int32_t n : mesh.tets[std::size_t(e)])
                    own.include(mesh.points[std::size_t(n)]);
                const double gap =
                    std::max({own.min.x - box.max.x, box.min.x - own.max.x, own.min.y - box.max.y,
                              box.min.y - own.max.y, own.min.z - box.max.z, box.min.z - own.max.z});
                const bool isFound = std::binary_search(found.begin() + 1, found.end(), e);
                if (gap <= 0 || (isFound && gap < near)) expected.push_back(e);
            }
            ASSERT_EQ(found, expected);
        }
    }
    std::vector<std::int32_t> none;
    ElementIndex(TetMesh{}).query({{0, 0, 0}, {1, 1, 1}}, none);
    EXPECT_TRUE(none.empty());
}

// What is left out is far from all points; what is far and isn't left out is allowed, but must be little.
TEST(ElementIndex, LeavesOutElementsBetweenThePointsOfAGrid) {
    const TetMesh mesh = shakenCubes(9, 0.3, 14);
    const ElementIndex index(mesh, {.threads = 1});
    Random random(15);
    std::size_t all = 0, kept = 0, needed = 0;
    for (int i = 0; i < 60; ++i) {
        const double spacing = 0.3 + 4 * random.unit();
        const Vec3d origin = (i % 5 == 0 ? 1e4 : 10.0) * (random.place() - 0.5);
        const PointGrid grid{origin, spacing * (0.8 + 0.4 * random.place()), 1.0 / 16};
        Box3d box;
        box.include(8.0 * random.place());
        box.include(box.min + 8.0 * random.place());
        std::vector<std::int32_t> plain, found;
        index.query(box, plain);
        index.query(box, found, ElementIndex::kEvery, &grid);
        EXPECT_EQ(index.count(box, &grid), std::int64_t(found.size()));
        EXPECT_TRUE(std::includes(plain.begin(), plain.end(), found.begin(), found.end()));
        all += plain.size();
        kept += found.size();
        for (const std::int32_t e : plain) {
            Box3d own;
            for (const std::int32_t n : mesh.tets[std::size_t(e)]) own.include(mesh.points[std::size_t(n)]);
            const Vec3d low = glm::ceil((own.min - origin) / grid.spacingWorld - grid.margin),
                        high = glm::floor((own.max - origin) / grid.spacingWorld + grid.margin);
            if (!(low.x <= high.x && low.y <= high.y && low.z <= high.z)) continue;
            ++needed;
            ASSERT_TRUE(std::binary_search(found.begin(), found.end(), e));
        }
    }
    EXPECT_LT(double(kept), 0.8 * double(all));
    EXPECT_LT(double(kept), 1.25 * double(needed));
}

TEST(ShellEdges, AreThoseOfTheBoundaryOrOfItsBends) {
    const TetMesh cube = gridMesh({2, 3, 4}, Vec3d(0), Vec3d(1));
    // Each side of so many squares, of two faces each; an edge has two faces.
    EXPECT_EQ(shellEdges(cube, 0).size(), std::size_t(2 * (2 * 3 + 3 * 4 + 2 * 4) * 2 * 3 / 2));
    const std::vector<ShellEdge> bends = shellEdges(cube, 89);
    EXPECT_EQ(bends.size(), std::size_t(4 * (2 + 3 + 4)));
    for (const ShellEdge& edge : bends) {
        const Vec3d a = cube.points[std::size_t(edge[0])], b = cube.points[std::size_t(edge[1])];
        int onSides = 0;
        for (int axis = 0; axis < 3; ++axis) onSides += a[axis] == b[axis] && (a[axis] == 0 || a[axis] == 1);
        EXPECT_EQ(onSides, 2);
        EXPECT_LT(edge[0], edge[1]);
    }
    EXPECT_TRUE(shellEdges(cube, 91).empty());
    // Two elements that share an edge alone: four faces meet there.
    TetMesh touching;
    touching.points = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 1, 0}, {-1, 0, 0}, {-1, -1, 0}};
    touching.tets = {{0, 1, 2, 3}, {0, 1, 4, 5}};
    EXPECT_EQ(shellEdges(touching, 180), (std::vector<ShellEdge>{{0, 1}}));
}

// Few nodes: faces have one, two, three elements and more, some of them flat, some twice the same.
TEST(FaceMatching, BoundaryAloneIsThatOfAll) {
    std::mt19937 random(11);
    for (const int nodes : {5, 12, 40, 2000}) {
        TetMesh mesh;
        mesh.points.resize(std::size_t(nodes));
        std::vector<std::uint8_t> flat;
        for (int e = 0; e < 5000; ++e) {
            std::array<std::int32_t, 4> tet{};
            const int around = int(random() % unsigned(nodes));
            for (std::size_t c = 0; c < 4; ++c) {
                do tet[c] = (around + std::int32_t(random() % 5u)) % nodes;
                while (std::find(tet.begin(), tet.begin() + std::ptrdiff_t(c), tet[c]) !=
                       tet.begin() + std::ptrdiff_t(c));
            }
            mesh.tets.push_back(tet);
            flat.push_back(random() % 10 == 0);
        }
        const std::vector<BoundaryFace> all = matchFaces(mesh, flat, {}).boundary;
        const std::vector<BoundaryFace> alone = matchBoundary(mesh, flat, {.threads = 3});
        ASSERT_EQ(alone.size(), all.size());
        for (std::size_t f = 0; f < all.size(); ++f) {
            EXPECT_EQ(alone[f].element, all[f].element);
            EXPECT_EQ(alone[f].nodes, all[f].nodes);
        }
    }
}

}  // namespace
}  // namespace tessera
