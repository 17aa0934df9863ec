#include "refine/measure_error.h"

#include <gtest/gtest.h>

#include "brick_test_meshes.h"
#include "brute_force_resampler.h"
#include "refine/plan.h"
#include "refine/refine.h"
#include "refine/refine_options.h"
#include "refine/resample_tree.h"

namespace tessera {
namespace {

struct Measured {
    BrickTree tree;
    ErrorReport report;
};

Measured measure(const TetMesh& mesh, std::vector<int> fields, const RefineOptions& options, int threads = 0,
                 std::vector<double>* leafErrors = nullptr) {
    Execution execution;
    execution.threads = threads;
    Measured result;
    result.tree = planBricks(mesh, options, execution);
    ResampleStatistics statistics;
    int channels = 0;
    for (const int f : fields) channels += mesh.fields[std::size_t(f)].components;
    const BrickStore store = resampleTree(result.tree, *BruteForceResampler().bind(mesh, fields, {}),
                                          channels, execution, statistics);
    MeasureOptions measureOptions;
    measureOptions.leafErrors = leafErrors;
    result.report = measureError(mesh, fields, result.tree, store, NearestOnDemand(mesh, threads), execution,
                                 measureOptions);
    return result;
}

RefineOptions uniform(int resolution) {
    RefineOptions options;
    options.criterion = Criterion::uniform;
    options.brickCells = 8;
    options.resolution = resolution;
    return options;
}

RefineOptions threeLevels() {
    RefineOptions options;
    options.brickCells = 8;
    options.resolution = 129;
    options.maxLevels = 3;
    return options;
}

TEST(MeasureError, ALinearFieldIsReconstructedToFloatPrecision) {
    TetMesh mesh = gradedMesh(8, 3.0);
    addPointField(mesh, "linear", [](const Vec3d& p) { return 3 * p.x - 2 * p.y + p.z; });
    for (const RefineOptions& options : {uniform(40), uniform(33), threeLevels()}) {
        const Measured measured = measure(mesh, {0}, options);
        const FieldError& error = measured.report.fields[0];
        EXPECT_LT(error.relativeMax, 2e-7);
        EXPECT_LE(error.rms, error.max);
        EXPECT_LE(error.p999, error.max);
        EXPECT_EQ(error.range, 6.0);
        EXPECT_EQ(error.samples, 9 * 9 * 9 + 6 * 8 * 8 * 8);
        EXPECT_EQ(error.skippedSamples, 0);
        EXPECT_EQ(measured.report.fullyCoveredShare, 1.0);
        EXPECT_EQ(measured.report.outsideBricks, 0);
        EXPECT_EQ(error.validPoints, measured.report.coveredPoints);
        EXPECT_NEAR(error.integralMesh[0], 1.0, 1e-12) << "mean 1.5 - 1 + 0.5 over the unit cube";
    }
}

TEST(MeasureError, AHatBetweenLatticePointsIsMissedByItsHeight) {
    // Lattice points at even coordinates; the field is 1 at one node at odd coordinates, 0 at all others.
    TetMesh mesh = gridMesh({6, 6, 6}, Vec3d(0), Vec3d(6));
    addPointField(mesh, "hat", [](const Vec3d& p) { return p == Vec3d(3, 3, 3) ? 1.0 : 0.0; });
    RefineOptions options = uniform(0);
    options.spacingWorld = 2;
    const FieldError error = measure(mesh, {0}, options).report.fields[0];
    EXPECT_EQ(error.max, 1.0) << "no lattice point lies in an element of the hat";
    EXPECT_EQ(error.worstPlaceWorld, Vec3d(3, 3, 3));
    EXPECT_EQ(error.relativeMax, 1.0);
    // The node has 24 elements of volume 1/6 around it; their centroids are off by 1/4.
    const double square = 24.0 / 6 * (1.0 / 20 + 0.8 / 16) / 216;
    EXPECT_NEAR(error.rms, std::sqrt(square), 1e-7);
    EXPECT_NEAR(error.integralMesh[0], 24.0 / 6 / 4, 1e-12);
    EXPECT_EQ(error.integralLattice[0], 0.0);
}

TEST(MeasureError, AQuadraticFieldHasItsClosedForm) {
    // Nodes on a lattice twice as fine as the samples: f = x^2 at an odd node is missed by (a^2 + (a + 2)^2)
    // / 2 - (a + 1)^2 = 1.
    TetMesh mesh = gridMesh({8, 8, 8}, Vec3d(0), Vec3d(8));
    addPointField(mesh, "square", [](const Vec3d& p) { return p.x * p.x; });
    RefineOptions options = uniform(0);
    options.spacingWorld = 2;
    const FieldError error = measure(mesh, {0}, options).report.fields[0];
    EXPECT_EQ(error.range, 64.0);
    EXPECT_NEAR(error.max, 1.0, 1e-6);
    // Sum over lattice points of x^2 h^3, 5 x 5 x 5 points.
    EXPECT_NEAR(error.integralLattice[0], (0 + 4 + 16 + 36 + 64) * 25 * 8.0, 1e-9);
}

TEST(MeasureError, CornersOutsideTakeTheNearestMeshPoint) {
    // The lattice is not aligned with the mesh: outermost cells stick out, and the field is constant along
    // their way out.
    TetMesh mesh = gridMesh({4, 4, 4}, Vec3d(0), Vec3d(1));
    addPointField(mesh, "constant", [](const Vec3d&) { return 2.5; });
    RefineOptions options = uniform(0);
    options.spacingWorld = 0.23;
    options.frame = FixedFrame{Vec3d(-0.1), 0.23};
    const ErrorReport report = measure(mesh, {0}, options).report;
    EXPECT_LT(report.fields[0].max, 1e-14) << "weights add up to 1 but for rounding";
    EXPECT_EQ(report.fields[0].range, 0.0);
    EXPECT_EQ(report.fields[0].relativeMax, 0.0);
    EXPECT_LT(report.fullyCoveredShare, 1.0);
    EXPECT_GT(report.fullyCoveredShare, 0.0);
}

TEST(MeasureError, CellFieldsAreMeasuredAtCentroidsAndVectorsByTheirNorm) {
    TetMesh mesh = gridMesh({4, 4, 4}, Vec3d(0), Vec3d(1));
    const int cell =
        addCellField(mesh, "layer", [&](std::int64_t e) { return e < 192 ? 0.0 : 1.0; });  // z = 1/2
    Field vector{"vector", FieldLocation::point, 3, {}};
    for (const Vec3d& p : mesh.points)
        for (const double v : {3 * p.x, 4 * p.x, 0.0}) vector.values.push_back(v);
    mesh.fields.push_back(vector);
    const ErrorReport report = measure(mesh, {1, cell}, uniform(41)).report;
    EXPECT_EQ(report.fields[0].name, "vector");
    EXPECT_EQ(report.fields[0].range, 4.0);
    EXPECT_LT(report.fields[0].max, 1e-6);
    EXPECT_EQ(report.fields[0].samples, 125 + 384);
    EXPECT_EQ(report.fields[1].location, "cell");
    EXPECT_EQ(report.fields[1].samples, 384);
    EXPECT_EQ(report.fields[1].max, 0.0) << "at 41 points every centroid is away from the jump";
    EXPECT_NEAR(report.fields[1].integralMesh[0], 0.5, 1e-12);
}

TEST(MeasureError, ValuesThatAreNotFiniteAreSkippedAndCounted) {
    TetMesh mesh = gridMesh({4, 4, 4}, Vec3d(0), Vec3d(1));
    addPointField(mesh, "hole", [](const Vec3d& p) {
        return p == Vec3d(0.5) ? std::numeric_limits<double>::quiet_NaN() : p.x;
    });
    const ErrorReport report = measure(mesh, {0}, uniform(33)).report;
    const FieldError& error = report.fields[0];
    EXPECT_GE(error.skippedSamples, 25) << "the node and the centroids of its 24 elements";
    EXPECT_EQ(error.samples + error.skippedSamples, 125 + 384);
    EXPECT_LT(error.max, 1e-6);
    EXPECT_LT(error.validPoints, report.coveredPoints);
    EXPECT_TRUE(std::isfinite(error.integralMesh[0]));
    EXPECT_TRUE(std::isfinite(error.integralLattice[0]));
}

TEST(MeasureError, CountsFlatAndInvertedElements) {
    TetMesh mesh = gridMesh({4, 4, 4}, Vec3d(0), Vec3d(1));
    std::swap(mesh.tets[7][0], mesh.tets[7][1]);
    mesh.tets.push_back({0, 1, 2, 3});  // in one row
    mesh.points.push_back({5, 5, 5});
    mesh.tets.push_back({0, 1, 2, std::int32_t(mesh.points.size()) - 1});
    mesh.tets.back()[3] = mesh.tets.back()[0];
    addPointField(mesh, "x", [](const Vec3d& p) { return p.x; });
    const ErrorReport report = measure(mesh, {0}, uniform(20)).report;
    EXPECT_EQ(report.flatElements, 2);
    EXPECT_EQ(report.invertedElements, 1);
    EXPECT_EQ(report.nodes, 125) << "the node that no element of some volume uses is no sample";
    EXPECT_EQ(report.centroids, 384);
}

TEST(MeasureError, LeafErrorsAreTheLargestOfTheirLeaf) {
    TetMesh mesh = gridMesh({9, 9, 9}, Vec3d(0), Vec3d(1));
    addPointField(mesh, "wave",
                  [](const Vec3d& p) { return std::sin(9 * p.x) * std::cos(7 * p.y) + p.z * p.z; });
    std::vector<double> leafErrors;
    const Measured measured = measure(mesh, {0}, uniform(30), 0, &leafErrors);
    ASSERT_EQ(leafErrors.size(), measured.tree.leafCount());
    EXPECT_EQ(*std::max_element(leafErrors.begin(), leafErrors.end()), measured.report.fields[0].relativeMax);
    const Vec3d worst = (measured.report.fields[0].worstPlaceWorld - measured.tree.originWorld()) /
                        measured.tree.spacingWorld();
    EXPECT_EQ(leafErrors[std::size_t(measured.tree.findLeafAt(worst))],
              measured.report.fields[0].relativeMax);
}

TEST(MeasureError, ReportsAreTheSameForAnyNumberOfThreads) {
    TetMesh mesh = gradedMesh(10, 3.0);
    addPointField(mesh, "wave",
                  [](const Vec3d& p) { return std::sin(9 * p.x) * std::cos(7 * p.y) + p.z * p.z; });
    const FieldError one = measure(mesh, {0}, threeLevels(), 1).report.fields[0];
    for (const int threads : {2, 5, 16}) {
        const FieldError many = measure(mesh, {0}, threeLevels(), threads).report.fields[0];
        EXPECT_EQ(one.max, many.max);
        EXPECT_EQ(one.rms, many.rms);
        EXPECT_EQ(one.p999, many.p999);
        EXPECT_EQ(one.worstPlaceWorld, many.worstPlaceWorld);
        EXPECT_EQ(one.integralMesh, many.integralMesh);
        EXPECT_EQ(one.integralLattice, many.integralLattice);
    }
}

}  // namespace
}  // namespace tessera
