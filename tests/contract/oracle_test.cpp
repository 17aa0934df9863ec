#include "reference/oracle.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/sanitizers.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "reference/random.h"
#include "reference/reference_block.h"

namespace tessera {
namespace {

/// The corner of the unit cube: nodes 0, x, y, z.
TetMesh cornerTet() {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    mesh.tets = {{0, 1, 2, 3}};
    return mesh;
}

const Lattice kUnit = Lattice::axisParallel(Vec3d(0), 1);
const Lattice kQuarter = Lattice::axisParallel(Vec3d(0), 0.25);

TEST(Oracle, ContainsTheClosedElement) {
    const TetMesh mesh = cornerTet();
    const Oracle oracle(mesh, kQuarter);
    EXPECT_TRUE(oracle.contains(0, {0, 0, 0}));
    EXPECT_TRUE(oracle.contains(0, {4, 0, 0}));
    EXPECT_TRUE(oracle.contains(0, {2, 1, 1}));  // on the slanted face
    EXPECT_TRUE(oracle.contains(0, {2, 2, 0}));  // on an edge
    EXPECT_TRUE(oracle.contains(0, {1, 1, 1}));
    EXPECT_FALSE(oracle.contains(0, {2, 2, 1}));
    EXPECT_FALSE(oracle.contains(0, {-1, 0, 0}));
    EXPECT_FALSE(oracle.contains(0, {5, 0, 0}));
}

TEST(Oracle, TellsPointsOneUlpApart) {
    TetMesh mesh = cornerTet();
    const Oracle on(mesh, kUnit);
    EXPECT_TRUE(on.contains(0, {1, 0, 0}));
    mesh.points[1].x = std::nextafter(1.0, 0.0);
    const Oracle before(mesh, kUnit);
    EXPECT_FALSE(before.contains(0, {1, 0, 0}));
    EXPECT_EQ(before.nearest(0, {1, 0, 0}).squaredDistance, mpq_class(0x1p-53) * mpq_class(0x1p-53));
}

TEST(Oracle, TakesLatticePointsAsRealNumbers) {
    // The double 0.1 is above one tenth, the double 0.3 below three tenths: three steps of 0.1 lie beyond the
    // double 0.3.
    TetMesh mesh = cornerTet();
    mesh.points[1].x = 0.3;
    const Lattice lattice = Lattice::axisParallel(Vec3d(0), 0.1);
    EXPECT_FALSE(Oracle(mesh, lattice).contains(0, {3, 0, 0}));
    mesh.points[1].x = std::nextafter(0.3, 1.0);
    EXPECT_TRUE(Oracle(mesh, lattice).contains(0, {3, 0, 0}));
}

TEST(Oracle, GivesExactBarycentricCoordinates) {
    const TetMesh mesh = cornerTet();
    const Lattice thirds{{0, 0, 0}, {1, 0, 0}, {0, 0.5, 0}, {0, 0, 0.125}};
    const ExactWeights w = Oracle(mesh, thirds).barycentrics(0, {2, 1, -3});
    EXPECT_EQ(w[1], 2);
    EXPECT_EQ(w[2], mpq_class(1, 2));
    EXPECT_EQ(w[3], mpq_class(-3, 8));
    EXPECT_EQ(w[0] + w[1] + w[2] + w[3], 1);
}

TEST(Oracle, DoesNotCareForOrientationOfElementOrFrame) {
    TetMesh mesh = cornerTet();
    const Lattice leftHanded{{0, 0, 0}, {0, 0.25, 0}, {0.25, 0, 0}, {0, 0, 0.25}};
    for (int turn = 0; turn < 2; ++turn) {
        for (const Lattice& lattice : {kQuarter, leftHanded}) {
            const Oracle oracle(mesh, lattice);
            EXPECT_TRUE(oracle.contains(0, {1, 2, 1}));
            EXPECT_FALSE(oracle.contains(0, {1, 2, 2}));
            EXPECT_GT(oracle.depthVoxels(0, {1, 1, 1}), 0);
            EXPECT_LT(oracle.depthVoxels(0, {-1, 1, 1}), 0);
        }
        std::swap(mesh.tets[0][1], mesh.tets[0][3]);
    }
}

TEST(Oracle, FindsTheNearestPointOnFaceEdgeAndNode) {
    const TetMesh mesh = cornerTet();
    const Oracle oracle(mesh, kUnit);
    const ExactNearest face = oracle.nearest(0, {1, 1, 1});
    EXPECT_EQ(face.squaredDistance, mpq_class(4, 3));
    EXPECT_EQ(face.weights, (ExactWeights{0, mpq_class(1, 3), mpq_class(1, 3), mpq_class(1, 3)}));
    const ExactNearest edge = oracle.nearest(0, {1, 1, -3});
    EXPECT_EQ(edge.squaredDistance, mpq_class(19, 2));
    EXPECT_EQ(edge.weights, (ExactWeights{0, mpq_class(1, 2), mpq_class(1, 2), 0}));
    const ExactNearest node = oracle.nearest(0, {3, 0, 0});
    EXPECT_EQ(node.squaredDistance, 4);
    EXPECT_EQ(node.weights, (ExactWeights{0, 1, 0, 0}));
    EXPECT_EQ(oracle.nearest(0, {0, 1, 0}).squaredDistance, 0);
}

TEST(Oracle, MeasuresInVoxels) {
    TetMesh mesh = cornerTet();
    place(mesh, {1e-3, {5, 6, 7}, false});
    const Lattice lattice = Lattice::axisParallel(mesh.points[0], 1e-3 * 0.25);
    const Oracle oracle(mesh, lattice);
    const ExactNearest nearest = oracle.nearest(0, {-3, 0, 0});
    EXPECT_NEAR(std::sqrt(nearest.squaredDistance.get_d()), 3, 1e-9);
    // The middle of the corner tet lies a quarter from the sides and 1/4/sqrt(3) from the slanted face.
    EXPECT_NEAR(oracle.depthVoxels(0, {1, 1, 1}), 1 / std::sqrt(3.0), 1e-9);
}

TEST(Oracle, DepthIsTheDistanceToTheNearestFacePlane) {
    const TetMesh mesh = cornerTet();
    const Oracle oracle(mesh, kQuarter);
    EXPECT_DOUBLE_EQ(oracle.depthVoxels(0, {1, 1, 1}), 1 / std::sqrt(3.0));
    EXPECT_EQ(oracle.depthVoxels(0, {2, 2, 0}), 0);
    EXPECT_DOUBLE_EQ(oracle.depthVoxels(0, {2, 1, -1}), -1);
    EXPECT_DOUBLE_EQ(oracle.depthVoxels(0, {2, 2, 2}), -2 / std::sqrt(3.0));
}

TEST(Oracle, NearestPointMeetsTheConditionOfOptimality) {
    // q is the nearest point of a convex hull to p exactly when no node lies beyond the plane through q
    // across p - q.
    Random random(5);
    for (int trial = 0; trial < 200; ++trial) {
        const double squeeze = std::pow(10.0, -random.below(13));
        TetMesh mesh;
        for (int i = 0; i < 4; ++i)
            mesh.points.push_back(8.0 * random.place() * Vec3d(1, 1, squeeze) + Vec3d(0, 0, 4));
        mesh.tets = {{0, 1, 2, 3}};
        const Oracle oracle(mesh, kUnit);
        if (oracle.volumeSign(0) == 0) continue;
        const Vec3i p{random.below(12) - 2, random.below(12) - 2, random.below(12) - 2};
        const ExactNearest nearest = oracle.nearest(0, p);
        std::array<mpq_class, 3> q;
        for (int a = 0; a < 3; ++a)
            for (std::size_t i = 0; i < 4; ++i)
                q[std::size_t(a)] += nearest.weights[i] * mpq_class(mesh.points[i][a]);
        mpq_class square, sum;
        for (std::size_t i = 0; i < 4; ++i) {
            mpq_class beyond;
            for (int a = 0; a < 3; ++a)
                beyond += (p[a] - q[std::size_t(a)]) * (mpq_class(mesh.points[i][a]) - q[std::size_t(a)]);
            EXPECT_LE(beyond, 0);
            EXPECT_GE(nearest.weights[i], 0);
            sum += nearest.weights[i];
        }
        for (int a = 0; a < 3; ++a) square += (p[a] - q[std::size_t(a)]) * (p[a] - q[std::size_t(a)]);
        EXPECT_EQ(sum, 1);
        EXPECT_EQ(square, nearest.squaredDistance);
    }
}

TEST(Oracle, InterpolatesALinearFieldAndItsGradientExactly) {
    TetMesh mesh = overlappingMesh(20, 3);
    for (Vec3d& p : mesh.points) p = glm::round(p * 1024.0);  // so that node values are exact
    const int f = addPointField(mesh, "f", {[](const Vec3d& p) { return 2 * p.x - 3 * p.y + 5 * p.z + 7; }});
    const Lattice lattice{{3, 4, 5}, {8, 0, 0}, {0, 8, 0}, {0, 0, 8}};
    const Oracle oracle(mesh, lattice);
    for (int e = 0; e < 20; ++e) {
        const Vec3i p{e, 40 - e, 17};
        const Vec3d at = lattice.worldFromIndex(Vec3d(p));
        EXPECT_EQ(oracle.interpolate(mesh.fields[std::size_t(f)], 0, e, oracle.barycentrics(e, p)),
                  mpq_class(2 * at.x - 3 * at.y + 5 * at.z + 7));
        EXPECT_EQ(oracle.squaredGradient(mesh.fields[std::size_t(f)], 0, e), (4 + 9 + 25) * 64);
    }
}

TEST(Oracle, ApproximateBarycentricsFollowTheExactOnes) {
    const TetMesh mesh = thinClusterMesh(1e-9, 1, 20, 2);
    const Oracle oracle(mesh, Lattice::axisParallel(Vec3d(0.5), 1e-7));
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) {
        if (oracle.volumeSign(e) == 0) continue;
        const auto rough = oracle.approximateBarycentrics(e, {1, -2, 3});
        const ExactWeights exact = oracle.barycentrics(e, {1, -2, 3});
        for (std::size_t i = 0; i < 4; ++i)
            EXPECT_NEAR(rough[i], exact[i].get_d(), std::abs(rough[i]) * 0x1p-50);
    }
}

TEST(Oracle, FlatElementsHaveNoVolume) {
    TetMesh mesh = boxMesh({.cells = {1, 1, 1}, .jitter = 0});
    const std::int64_t proper = mesh.elementCount();
    addFlatElements(mesh);
    const Oracle oracle(mesh, kQuarter);
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) EXPECT_EQ(oracle.volumeSign(e) != 0, e < proper);
}

TEST(ExactFrame, GivesTheSameNodesWhetherTheyAreStoredOrNot) {
    TetMesh mesh;
    Random random(71);
    for (int n = 0; n < 400; ++n)
        mesh.points.push_back({random.centred(), 1e-9 * random.centred(), 1e6 + random.centred()});
    // Beside the origin of the lattice; on it; so near that the quotient is no normal number.
    mesh.points[0] = {0.1, 0.2, 1e6};
    mesh.points[1] = {0x1p-1060, -0x1p-1073, 0x1p-1020};
    for (std::int32_t n = 0; n < 400; n += 4) mesh.tets.push_back({n, n + 1, n + 2, n + 3});
    TetMesh many = mesh;
    many.points.resize(300'000, Vec3d(0));  // of no element
    for (const Lattice& lattice :
         {Lattice::axisParallel({0.1, 0.2, 1e6}, 0.1), Lattice::axisParallel(Vec3d(0), 0x1p20)}) {
        const ExactFrame stored(mesh, lattice), computed(many, lattice);
        EXPECT_EQ(stored.unit(), computed.unit());
        for (std::int32_t n = 0; n < 400; ++n) {
            const ExactVec a = stored.node(n), b = computed.node(n);
            ASSERT_TRUE(a.x == b.x && a.y == b.y && a.z == b.z) << n;
            ASSERT_EQ(stored.indexNode(n), computed.indexNode(n)) << n;
            const ExactVec zero = stored.nodeFrom(n, b);
            ASSERT_TRUE(zero.x == 0 && zero.y == 0 && zero.z == 0) << n;
            const mpz_class* exact[] = {&a.x, &a.y, &a.z};
            for (int axis = 0; axis < 3; ++axis) {
                const mpq_class wanted(mpq_class(*exact[axis]) / stored.unit());
                const mpq_class error = abs(mpq_class(mpq_class(stored.indexNode(n)[axis]) - wanted));
                ASSERT_LE(error, abs(wanted) * mpq_class(0x1p-50) + mpq_class(0x1p-1074)) << n;
            }
        }
    }
}

TEST(ReferenceBlock, CountsTheClosedBox) {
    const TetMesh mesh = boxMesh({.cells = {3, 3, 3}, .sizeWorld = {6, 6, 6}});
    const auto inMesh = [&](const Vec3d& origin) {
        const ReferenceBlock reference =
            referenceBlock(Oracle(mesh, Lattice::axisParallel(origin, 1)), {Vec3i(-2), Vec3i(10)});
        return std::count(reference.mustCover.begin(), reference.mustCover.end(), 1);
    };
    EXPECT_EQ(inMesh(Vec3d(0)), 7 * 7 * 7);
    EXPECT_EQ(inMesh(Vec3d(0.5)), 6 * 6 * 6);
    EXPECT_EQ(inMesh({0, 1.0 / 3, 0.5}), 7 * 6 * 6);
    EXPECT_EQ(inMesh({1e-300, 0, -1e-300}), 6 * 7 * 6);
}

TEST(ReferenceBlock, CountsTheElementsAtANode) {
    // In Kuhn's division 24 tets meet at an inner node and 6 at its edges along the axes.
    const TetMesh mesh = boxMesh({.cells = {2, 2, 2}, .sizeWorld = {4, 4, 4}});
    const ReferenceBlock reference = referenceBlock(Oracle(mesh, kUnit), {{2, 2, 2}, {4, 3, 3}});
    EXPECT_EQ(reference.candidatesOf(0).size(), 24u);
    EXPECT_EQ(reference.candidatesOf(1).size(), 6u);
    for (const Candidate& c : reference.candidatesOf(0)) EXPECT_EQ(c.depthVoxels, 0);
}

TEST(ReferenceBlock, AllowsSpillUpToTheToleranceExactly) {
    // The point (2, 0, 0) is one unit from the tet: exactly the tolerance, then one ulp of 1 more.
    TetMesh mesh = cornerTet();
    const auto mayCover = [&](double tolerance) {
        return referenceBlock(Oracle(mesh, kUnit), {{2, 0, 0}, {3, 1, 1}}, {.toleranceVoxels = tolerance})
            .mayCover(0);
    };
    EXPECT_TRUE(mayCover(1));
    EXPECT_FALSE(mayCover(std::nextafter(1.0, 0.0)));
    // Beyond a sharp corner the planes are near, the element is not.
    mesh.points = {{0, 0, 0}, {1, 1e-3, 0}, {1, -1e-3, 1e-3}, {1, 0, -1e-3}};
    const ReferenceBlock sharp = referenceBlock(Oracle(mesh, Lattice::axisParallel({-0.5, 0, 0}, 1)),
                                                {{0, 0, 0}, {1, 1, 1}}, {.toleranceVoxels = 0.01});
    EXPECT_FALSE(sharp.mayCover(0));
}

TEST(ReferenceBlock, SphereHasItsVolume) {
    const TetMesh mesh = sphereMesh(16);
    const double h = 1.0 / 16;
    const ReferenceBlock reference =
        referenceBlock(Oracle(mesh, Lattice::axisParallel(Vec3d(h / 3), h)), {Vec3i(-18), Vec3i(18)});
    const double volume =
        double(std::count(reference.mustCover.begin(), reference.mustCover.end(), 1)) * h * h * h;
    EXPECT_NEAR(volume, 4.0 / 3 * M_PI, 0.03 * volume);
}

void expectSame(const ReferenceBlock& a, const ReferenceBlock& b) {
    ASSERT_EQ(a.firstCandidate, b.firstCandidate);
    EXPECT_EQ(a.mustCover, b.mustCover);
    for (std::size_t i = 0; i < a.candidates.size(); ++i) {
        EXPECT_EQ(a.candidates[i].element, b.candidates[i].element);
        EXPECT_EQ(a.candidates[i].contains, b.candidates[i].contains);
        EXPECT_NEAR(a.candidates[i].depthVoxels, b.candidates[i].depthVoxels, 1e-8);
        EXPECT_NEAR(a.candidates[i].distanceVoxels, b.candidates[i].distanceVoxels,
                    0.11 * b.candidates[i].distanceVoxels);
    }
}

TEST(ReferenceBlock, FilterChangesNothing) {
    std::vector<TetMesh> meshes{boxMesh({.cells = {2, 2, 2}}),
                                boxMesh({.cells = {2, 2, 2}, .originWorld = {1e5, 0, -1e5}, .jitter = 0.3}),
                                gradedDelaunayMesh(60, 2.2, 3),
                                overlappingMesh(20, 4),
                                thinClusterMesh(1e-6, 1, 20, 5),
                                thinClusterMesh(1e-11, 2, 20, 6),
                                thinTetsMesh(ThinKind::sliver, 1e-3, 1, 20, 7),
                                thinTetsMesh(ThinKind::cap, 1e-10, 1, 20, 8)};
    const Vec3d step{0.0625, 0.03, -0.04};
    for (const TetMesh& mesh : meshes) {
        const Box3d bounds = mesh.boundsWorld();
        const double h = bounds.size().x / 8;
        const Lattice turned{bounds.min, {h, h / 3, 0}, {-h / 3, h, 0}, {0, h / 5, h}};
        for (const Lattice& lattice :
             {Lattice::axisParallel(bounds.min, h), Lattice::axisParallel(bounds.min + step, h), turned})
            for (const double tolerance : {0x1p-12, 0x1p-8, 0.25}) {
                const Oracle oracle(mesh, lattice);
                const IndexBox box =
                    kIsSanitized ? IndexBox{Vec3i(-2), Vec3i(4)} : IndexBox{Vec3i(-2), Vec3i(11)};
                const auto fast = referenceBlock(oracle, box, {.toleranceVoxels = tolerance});
                const auto slow = referenceBlock(
                    oracle, box, {.toleranceVoxels = tolerance, .isUnfiltered = true}, {.threads = 2});
                expectSame(fast, slow);
                EXPECT_LE(fast.exactPairs, slow.exactPairs);
            }
    }
}

TEST(ReferenceBlock, FilterChangesNothingForElementsAsThinAsTheTolerance) {
    // A voxel is an eighth of the unit box; thicknesses run from a quarter of the tolerance to four times it.
    constexpr double kTolerance = 0x1p-8, h = 0.125;
    std::vector<TetMesh> meshes{boxMesh({.cells = {3, 3, 1}, .sizeWorld = {1, 1, kTolerance * h}}),
                                hangingNodeMesh(1, 3)};
    for (const double thickness : {0.25, 1.0, 4.0}) {
        const double aspect = thickness * kTolerance * h;
        meshes.push_back(thinTetsMesh(ThinKind::sliver, aspect, 1, 8, 31));
        meshes.push_back(thinTetsMesh(ThinKind::needle, aspect, 1, 8, 32));
        meshes.push_back(thinClusterMesh(aspect, 1, 12, 33));
    }
    for (const TetMesh& mesh : meshes)
        for (const int far : {0, -511, 1 << 20}) {
            const Vec3d origin = Vec3d(-0.3 * kTolerance * h) - h * double(far);
            const Oracle oracle(mesh, Lattice::axisParallel(origin, h));
            const IndexBox box{Vec3i(far - 1), Vec3i(far + 10)};
            const auto fast = referenceBlock(oracle, box, {.toleranceVoxels = kTolerance});
            const auto slow =
                referenceBlock(oracle, box, {.toleranceVoxels = kTolerance, .isUnfiltered = true});
            expectSame(fast, slow);
            EXPECT_LE(fast.exactPairs, slow.exactPairs);
        }
}

TEST(Generators, KuhnAndFiveTetBoxesFillTheBox) {
    for (const bool isFiveSplit : {false, true}) {
        const TetMesh mesh =
            boxMesh({.cells = {3, 4, 5}, .sizeWorld = {3, 4, 5}, .isFiveSplit = isFiveSplit});
        EXPECT_EQ(mesh.elementCount(), 60 * (isFiveSplit ? 5 : 6));
        mpq_class volume;
        const Oracle oracle(mesh, kUnit);
        for (std::int64_t e = 0; e < mesh.elementCount(); ++e) {
            EXPECT_GT(oracle.volumeSign(e), 0);
            const auto& t = mesh.tets[std::size_t(e)];
            const auto at = [&](std::size_t i) { return mesh.points[std::size_t(t[i])]; };
            volume += mpq_class(dot(cross(at(1) - at(0), at(2) - at(0)), at(3) - at(0))) / 6;
        }
        EXPECT_EQ(volume, 60);
        // Each inner point of a conforming mesh off all faces has one element.
        const ReferenceBlock reference = referenceBlock(
            Oracle(mesh, Lattice::axisParallel({0.11, 0.23, 0.37}, 0.5)), {Vec3i(0), {5, 7, 9}});
        EXPECT_EQ(reference.candidates.size(), 5u * 7 * 9);
    }
}

TEST(Generators, DelaunaySpheresAreEmptyAndElementsTileTheHull) {
    const TetMesh mesh = gradedDelaunayMesh(120, 2.2, 9);
    EXPECT_GT(mesh.elementCount(), 400);
    for (const auto& tet : mesh.tets) {
        std::array<Vec3d, 4> at;
        for (std::size_t i = 0; i < 4; ++i) at[i] = mesh.points[std::size_t(tet[i])];
        const Vec3d a = at[1] - at[0], b = at[2] - at[0], c = at[3] - at[0];
        const Vec3d centre = (dot(a, a) * cross(b, c) + dot(b, b) * cross(c, a) + dot(c, c) * cross(a, b)) /
                             (2 * dot(a, cross(b, c)));
        const double radius = glm::length(centre);
        if (radius > 1e3) continue;  // the centre isn't known well enough in double
        for (const Vec3d& p : mesh.points)
            EXPECT_GT(glm::length(p - at[0] - centre), radius * (1 - 1e-9) - 1e-9);
    }
    const ReferenceBlock reference = referenceBlock(
        Oracle(mesh, Lattice::axisParallel({0.301, 0.307, 0.303}, 0.02)), {Vec3i(0), Vec3i(20)});
    for (std::size_t i = 0; i < reference.mustCover.size(); ++i) EXPECT_EQ(reference.mustCover[i], 1);
    EXPECT_LT(reference.candidates.size(), reference.mustCover.size() + 30);
}

TEST(Generators, GradedBoxHasAVolumeRatioOfAMillion) {
    const TetMesh mesh = gradedBoxMesh(12, 3, 0.2, 3);
    double least = 1, most = 0;
    for (const auto& t : mesh.tets) {
        const Vec3d a = mesh.points[std::size_t(t[0])];
        const double v =
            std::abs(dot(cross(mesh.points[std::size_t(t[1])] - a, mesh.points[std::size_t(t[2])] - a),
                         mesh.points[std::size_t(t[3])] - a));
        least = std::min(least, v), most = std::max(most, v);
    }
    EXPECT_GT(most / least, 1e6);
}

}  // namespace
}  // namespace tessera
