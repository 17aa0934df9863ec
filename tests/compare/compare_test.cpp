#include "compare/compare_resamplers.h"
#include "resample/statistic_names.h"
#include "tessera/lattice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>

#include "reference/fields.h"
#include "reference/generators.h"
#include "tessera/error.h"
#include "tessera/registry.h"

namespace tessera {
namespace {

using Edit = std::function<void(Block&)>;

/// Another resampler whose blocks are changed in a known way.
class EditedResampler : public Resampler {
  public:
    explicit EditedResampler(Edit edit, double boundVoxels = 0)
        : Resampler({.name = "edited",
                     .description = "software, with changes",
                     .formats = {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8},
                     .spillBoundVoxels = boundVoxels > 0 ? boundVoxels : exact().info().spillBoundVoxels,
                     .placeBoundVoxels = boundVoxels > 0 ? boundVoxels : exact().info().placeBoundVoxels}),
          edit_(std::move(edit)) {}
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions&) const override {
        return std::make_unique<Bound>(exact().bind(mesh, fields), edit_);
    }

  private:
    class Bound : public BoundResampler {
      public:
        Bound(std::unique_ptr<BoundResampler> inner, const Edit& edit)
            : inner_(std::move(inner)), edit_(edit) {}
        ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                    const BlockSink& sink, const Execution& execution) override {
            return inner_->resample(
                lattice, boxes,
                [&](std::size_t b, const Block& block) {
                    Block copy = block;
                    edit_(copy);
                    sink(b, copy);
                },
                execution);
        }

      private:
        std::unique_ptr<BoundResampler> inner_;
        const Edit& edit_;
    };
    static const Resampler& exact() { return findResampler("software"); }

    Edit edit_;
};

Edit addToValues(const std::function<double(const Vec3i&)>& amount) {
    return [amount](Block& block) {
        std::size_t at = 0;
        Vec3i p;
        for (p.z = block.box.min.z; p.z < block.box.max.z; ++p.z)
            for (p.y = block.box.min.y; p.y < block.box.max.y; ++p.y)
                for (p.x = block.box.min.x; p.x < block.box.max.x; ++p.x, ++at)
                    for (int c = 0; c < block.channels; ++c) {
                        float& value = block.values[std::size_t(c) * block.count() + at];
                        value = float(double(value) + amount(p));
                    }
    };
}
Edit setCoverage(const Vec3i& p, bool covered) {
    return [p, covered](Block& block) {
        if (block.box.contains(p)) block.coverage[block.offset(p)] = covered;
    };
}
void changeNothing(Block&) {}

CompareReport compareWith(const TetMesh& mesh, const std::vector<int>& fields, const Edit& edit,
                          const SamplingGrid& grid, double boundVoxels = 0, CompareOptions options = {},
                          int threads = 2, SampleFormat format = SampleFormat::r32f) {
    const EditedResampler edited(edit, boundVoxels);
    BindOptions bind;
    bind.format = format;
    const Contestant contestants[] = {{"software", &findResampler("software"), {}},
                                      {"edited", &edited, bind}};
    options.runs = 1;
    Execution execution;
    execution.threads = threads;
    return compareResamplers(mesh, fields, contestants, grid, options, execution);
}

/// The unit box with a linear field of gradient (2, 0, 0), in [10, 12].
struct LinearBox {
    TetMesh mesh = boxMesh({.cells = Vec3i(3)});
    int field = addPointField(mesh, "f", {[](const Vec3d& p) { return 10 + 2 * p.x; }});
};

TEST(CompareResamplers, TheSameAlgorithmTwiceAgreesExactly) {
    TetMesh mesh = sphereMesh(6);
    const int f = addPointField(mesh, "wavy", {wavyField});
    const CompareReport report = compareWith(mesh, {f}, changeNothing, cubicGrid(mesh.boundsWorld(), 40));
    EXPECT_TRUE(report.agrees());
    ASSERT_EQ(report.pairs.size(), 1u);
    const PairReport& pair = report.pairs[0];
    EXPECT_EQ(pair.onlyFirst + pair.onlySecond, 0);
    EXPECT_GT(pair.coveredByBoth, 20000);
    EXPECT_EQ(pair.coveredByBoth, report.contestants[0].check.covered);
    EXPECT_EQ(pair.fields[0].points, pair.coveredByBoth);
    EXPECT_EQ(pair.fields[0].max, 0);
    EXPECT_EQ(pair.fields[0].p999, 0);
    EXPECT_EQ(pair.fields[0].rms, 0);
    EXPECT_LE(report.contestants[0].check.largestShare, 1);
    EXPECT_EQ(report.contestants[0].check.undecided, 0);
}

TEST(CompareResamplers, AConstantShiftIsEveryFigure) {
    const LinearBox box;
    const CompareReport report =
        compareWith(box.mesh, {box.field}, addToValues([](const Vec3i&) { return 0.125; }),
                    cubicGrid(box.mesh.boundsWorld(), 9));
    const ValueDifference& d = report.pairs[0].fields[0];
    EXPECT_EQ(d.points, 729);
    EXPECT_DOUBLE_EQ(d.range, 2);
    EXPECT_NEAR(d.max, 0.125, 2e-6);
    EXPECT_NEAR(d.rms, 0.125, 2e-6);
    EXPECT_NEAR(d.p999, 0.125, 1e-4);
    EXPECT_FALSE(report.agrees());
    EXPECT_TRUE(report.contestants[0].check.isGood());
    EXPECT_EQ(report.contestants[1].check.wrongValues, 729);
    EXPECT_NE(report.contestants[1].check.firstProblem.find("(0, 0, 0)"), std::string::npos);
}

TEST(CompareResamplers, QuantileAndPlaceAreThoseOfTheShift) {
    // 10 x 10 x 10 points of a lattice, each with its own shift: 1/1000 to 1, largest at (9, 9, 9).
    const LinearBox box;
    const CompareReport report =
        compareWith(box.mesh, {box.field},
                    addToValues([](const Vec3i& p) { return (1 + p.x + 10 * p.y + 100 * p.z) / 1000.0; }),
                    cubicGrid(box.mesh.boundsWorld(), 10));
    const ValueDifference& d = report.pairs[0].fields[0];
    ASSERT_EQ(d.points, 1000);
    EXPECT_NEAR(d.max, 1, 2e-6);
    EXPECT_EQ(d.worst, Vec3i(9));
    EXPECT_NEAR(d.worstWorld.x, 1, 1e-12);
    EXPECT_NEAR(d.p999, 0.999, 0.0006);
    EXPECT_GE(d.p999, 0.999 - 2e-6);
    EXPECT_NEAR(d.rms, std::sqrt(1001 * 2001 / 6.0 / 1e6), 2e-6);
    EXPECT_EQ(d.maxInThickElements, d.max);
    EXPECT_EQ(d.thinPoints, 0);
}

TEST(CompareResamplers, VectorsDifferByTheirNorm) {
    TetMesh mesh = boxMesh({.cells = Vec3i(2)});
    const int f = addPointField(mesh, "v",
                                {[](const Vec3d& p) { return p.x; }, [](const Vec3d& p) { return 4 * p.y; },
                                 [](const Vec3d&) { return 0.0; }});
    const Edit edit = [](Block& block) {
        for (std::size_t i = 0; i < block.count(); ++i) {
            block.values[i] += 3;
            block.values[block.count() + i] += 4;
        }
    };
    const CompareReport report = compareWith(mesh, {f}, edit, cubicGrid(mesh.boundsWorld(), 5));
    EXPECT_NEAR(report.pairs[0].fields[0].max, 5, 1e-5);
    EXPECT_DOUBLE_EQ(report.pairs[0].fields[0].range, 4);
}

TEST(CompareResamplers, AShiftOfPlaceIsRightWithinItsBoundOnly) {
    const LinearBox box;
    const SamplingGrid grid = cubicGrid(box.mesh.boundsWorld(), 17);
    // A quarter of 2^-8 voxel and a voxel of 1/16: the field changes by 2/16 a voxel. Towards the middle, so
    // that no value leaves its element's range.
    const Edit shift = addToValues([](const Vec3i& p) { return (p.x < 8 ? 1 : -1) * 0x1p-10 * 2 / 16; });
    const CompareReport right = compareWith(box.mesh, {box.field}, shift, grid, 0x1p-8);
    EXPECT_TRUE(right.agrees()) << right.contestants[1].check.firstProblem;
    EXPECT_GT(right.contestants[1].check.largestShare, 0.2);
    EXPECT_LT(right.contestants[1].check.largestShare, 0.3);
    const CompareReport wrong = compareWith(box.mesh, {box.field}, shift, grid, 0x1p-11);
    EXPECT_GT(wrong.contestants[1].check.wrongValues, 4000);
    EXPECT_FALSE(wrong.agrees());
}

TEST(CompareResamplers, NoValueMayLeaveItsElementsRange) {
    const LinearBox box;
    const Edit edit = addToValues([](const Vec3i& p) { return p == Vec3i(16, 3, 3) ? 1e-5 : 0; });
    const CompareReport report =
        compareWith(box.mesh, {box.field}, edit, cubicGrid(box.mesh.boundsWorld(), 17), 0x1p-8);
    EXPECT_EQ(report.contestants[1].check.wrongValues, 1);
}

TEST(CompareResamplers, FormatsMayStep) {
    const LinearBox box;
    const SamplingGrid grid = cubicGrid(box.mesh.boundsWorld(), 17);
    const auto truncate = [](double steps) {
        return [steps](Block& block) {
            for (float& v : block.values)
                v = float(10 + std::floor((double(v) - 10) / 2 * steps) / steps * 2);
        };
    };
    const auto wrong = [&](double steps, SampleFormat format) {
        return compareWith(box.mesh, {box.field}, truncate(steps), grid, 0, {}, 2, format)
            .contestants[1]
            .check.wrongValues;
    };
    EXPECT_EQ(wrong(255, SampleFormat::r8), 0);
    EXPECT_GT(wrong(100, SampleFormat::r8), 0);
    EXPECT_EQ(wrong(65535, SampleFormat::r16), 0);
    EXPECT_GT(wrong(20001, SampleFormat::r16), 0);
    EXPECT_EQ(wrong(2048, SampleFormat::r16f) + wrong(4096, SampleFormat::r16f), 0);
    EXPECT_GT(wrong(255, SampleFormat::r32f), 0);
}

TEST(CompareResamplers, AMissingPointInsideIsAHoleAndAwayFromTheBoundary) {
    const LinearBox box;
    const CompareReport report = compareWith(box.mesh, {box.field}, setCoverage({4, 5, 6}, false),
                                             cubicGrid(box.mesh.boundsWorld(), 11), 0x1p-8);
    const PairReport& pair = report.pairs[0];
    EXPECT_EQ(pair.onlyFirst, 1);
    EXPECT_EQ(pair.onlySecond, 0);
    EXPECT_EQ(pair.nearBoundary, 0);
    EXPECT_EQ(pair.awayFromBoundary, 1);
    EXPECT_EQ(pair.firstAway, Vec3i(4, 5, 6));
    EXPECT_EQ(report.contestants[1].check.holes, 1);
    EXPECT_FALSE(report.agrees());
}

TEST(CompareResamplers, AMissingPointOnTheBoundaryIsNearIt) {
    const LinearBox box;
    for (const Vec3i p : {Vec3i(0, 5, 5), Vec3i(10, 0, 5), Vec3i(0, 0, 0)}) {
        const CompareReport report = compareWith(box.mesh, {box.field}, setCoverage(p, false),
                                                 cubicGrid(box.mesh.boundsWorld(), 11), 0x1p-8);
        EXPECT_EQ(report.pairs[0].nearBoundary, 1);
        EXPECT_EQ(report.pairs[0].awayFromBoundary, 0);
        EXPECT_TRUE(report.agrees());
    }
}

TEST(CompareResamplers, ACoveredPointOutsideIsASpill) {
    TetMesh mesh = sphereMesh(4);
    const int f = addPointField(mesh, "one", {[](const Vec3d&) { return 1.0; }});
    const CompareReport report =
        compareWith(mesh, {f}, setCoverage({0, 0, 0}, true), cubicGrid(mesh.boundsWorld(), 21), 0x1p-8);
    EXPECT_EQ(report.pairs[0].onlySecond, 1);
    EXPECT_EQ(report.pairs[0].awayFromBoundary, 1);
    EXPECT_EQ(report.contestants[1].check.spills, 1);
}

TEST(CompareResamplers, WhereFineMeetsCoarseIsNoBoundary) {
    TetMesh mesh = hangingNodeMesh(2, 6);
    const int f = addPointField(mesh, "x", {[](const Vec3d& p) { return p.x; }});
    const Box3d bounds = mesh.boundsWorld();
    // The parts meet in a plane across the middle of the longest axis; lattice points lie on it.
    const SamplingGrid grid = cubicGrid(bounds, 25);
    const Vec3i size = grid.points.size();
    int axis = 0;
    for (int a = 1; a < 3; ++a)
        if (size[a] > size[axis]) axis = a;
    Vec3i middle(5);
    middle[axis] = 12;
    const CompareReport inside = compareWith(mesh, {f}, setCoverage(middle, false), grid, 0x1p-8);
    EXPECT_EQ(inside.pairs[0].onlyFirst, 1);
    EXPECT_EQ(inside.pairs[0].awayFromBoundary, 1);
    middle[(axis + 1) % 3] = 0;
    const CompareReport rim = compareWith(mesh, {f}, setCoverage(middle, false), grid, 0x1p-8);
    EXPECT_EQ(rim.pairs[0].nearBoundary, 1);
}

TEST(CompareResamplers, DifferencesInThinElementsAreToldApart) {
    // A layer of elements of a thousandth of a voxel lies on the bottom, and the field changes by 1 across
    // it.
    TetMesh mesh = boxMesh({.cells = {2, 2, 1}, .sizeWorld = {1, 1, 1e-4}});
    TetMesh above = boxMesh({.cells = Vec3i(2), .originWorld = {0, 0, 1e-4}, .sizeWorld = {1, 1, 1}});
    appendMesh(mesh, above);
    const int f = addPointField(mesh, "f", {[](const Vec3d& p) { return p.z < 5e-5 ? 0.0 : 1.0; }});
    const Edit edit = addToValues([](const Vec3i& p) { return p.z == 0 ? 0.5 : 0; });
    const CompareReport report =
        compareWith(mesh, {f}, edit, cubicGridOfSpacing(mesh.boundsWorld(), 0.1), 0x1p-8);
    const ValueDifference& d = report.pairs[0].fields[0];
    EXPECT_TRUE(report.agrees()) << report.contestants[1].check.firstProblem;
    EXPECT_NEAR(d.max, 0.5, 1e-6);
    EXPECT_LE(d.maxInThickElements, 1e-6);
    EXPECT_EQ(d.thinPoints, 121);
    EXPECT_EQ(d.worst.z, 0);
    EXPECT_NEAR(d.worstThicknessVoxels, 0.001, 1e-4);
    ASSERT_GE(d.worstElement, 0);
    EXPECT_LT(d.worstElement, 24);
}

TEST(CompareResamplers, ReportsDependNeitherOnThreadsNorOnBoxes) {
    TetMesh mesh = gradedBoxMesh(5, 3, 0.2, 7);
    const int f = addPointField(mesh, "wavy", {wavyField});
    const Edit edit = addToValues([](const Vec3i& p) { return 1e-4 * std::sin(p.x + 2 * p.y + 3 * p.z); });
    const SamplingGrid grid = cubicGrid(mesh.boundsWorld(), 33);
    const CompareReport one = compareWith(mesh, {f}, edit, grid, 0x1p-8, {}, 1);
    CompareOptions small;
    small.boxEdge = 10;
    const CompareReport many = compareWith(mesh, {f}, edit, grid, 0x1p-8, small, 5);
    EXPECT_EQ(many.boxes, 64u);
    for (std::size_t c = 0; c < 2; ++c) {
        EXPECT_EQ(one.contestants[c].check.covered, many.contestants[c].check.covered);
        EXPECT_EQ(one.contestants[c].check.wrongValues, many.contestants[c].check.wrongValues);
        EXPECT_EQ(one.contestants[c].check.largestShare, many.contestants[c].check.largestShare);
    }
    const ValueDifference &a = one.pairs[0].fields[0], &b = many.pairs[0].fields[0];
    EXPECT_EQ(a.max, b.max);
    EXPECT_EQ(a.p999, b.p999);
    EXPECT_NEAR(a.rms, b.rms, 1e-12);
}

TEST(CompareResamplers, BadMeshesRaiseNoFalseAlarm) {
    const auto check = [](TetMesh mesh, const char* what) {
        std::vector<int> fields{addPointField(mesh, "wavy", {wavyField}), addElementIdField(mesh, "id")};
        fields.push_back(addHoledCopy(mesh, fields[0], "holed", 7));
        const CompareReport report =
            compareWith(mesh, fields, changeNothing, cubicGrid(mesh.boundsWorld(), 48));
        EXPECT_TRUE(report.agrees()) << what << ": " << report.contestants[0].check.firstProblem;
        EXPECT_GT(report.contestants[0].check.covered, 0) << what;
    };
    for (const ThinKind kind : {ThinKind::sliver, ThinKind::needle, ThinKind::spindle, ThinKind::cap})
        for (const double aspect : {1e-2, 1e-5, 1e-9}) {
            TetMesh mesh = thinTetsMesh(kind, aspect, 0.5, 60, 3);
            appendMesh(mesh,
                       boxMesh({.cells = Vec3i(2), .originWorld = {0.4, 0.4, 0.4}, .sizeWorld = Vec3d(0.3)}));
            check(std::move(mesh), "thin");
        }
    for (const double aspect : {1e-3, 1e-7, 1e-12, 1e-15}) {
        TetMesh mesh = thinClusterMesh(aspect, 1, 60, 5);
        appendMesh(mesh,
                   boxMesh({.cells = Vec3i(2), .originWorld = {0.4, 0.4, 0.4}, .sizeWorld = Vec3d(0.3)}));
        check(std::move(mesh), "cluster");
    }
    check(overlappingMesh(200, 9), "overlapping");
    check(boundaryLayerMesh(4, 1e-6), "layers");
    TetMesh odd = gradedDelaunayMesh(300, 4, 2);
    invertEverySecond(odd);
    addFlatElements(odd);
    place(odd, {.scale = 1e-3, .offsetWorld = {1e5, -2e5, 3e5}, .isTurned = true});
    check(std::move(odd), "odd");
}

TEST(CompareResamplers, NeedsAContestant) {
    const LinearBox box;
    EXPECT_THROW(compareResamplers(box.mesh, {}, {}, cubicGrid(box.mesh.boundsWorld(), 5), {}, {}),
                 InputError);
}

TEST(RunTimes, EveryStageIsItsOwnMedian) {
    class Scripted : public BoundResampler {
      public:
        ResampleStatistics resample(const Lattice&, std::span<const IndexBox>, const BlockSink&,
                                    const Execution&) override {
            ResampleStatistics s;
            s.add(counted::polygons, 100);
            s.addMs(stage::bin, std::array{5.0, 1.0, 3.0, 9.0}[std::size_t(run_)]);
            s.addMs(stage::render, std::array{10.0, 30.0, 20.0, 0.0}[std::size_t(run_)]);
            ++run_;
            return s;
        }

      private:
        int run_ = 0;
    };
    Scripted three, four;
    const RunTimes odd = timeRuns(three, {}, {}, 3, {});
    EXPECT_EQ(odd.statistics.ms(stage::bin), 3);
    EXPECT_EQ(odd.statistics.ms(stage::render), 20);
    EXPECT_EQ(odd.statistics.count(counted::polygons), 100);
    EXPECT_EQ(odd.runs, 3);
    EXPECT_GE(odd.totalMs, 0);
    const RunTimes even = timeRuns(four, {}, {}, 4, {});
    EXPECT_EQ(even.statistics.ms(stage::bin), 4);
    EXPECT_EQ(even.statistics.ms(stage::render), 15);
}

TEST(SamplingGrid, CubicGridStartsAtTheLowerCorner) {
    const SamplingGrid grid = cubicGrid({{1, 2, 3}, {5, 4, 3.9}}, 9);
    EXPECT_EQ(grid.points.size(), Vec3i(9, 5, 2));
    EXPECT_EQ(grid.lattice.worldFromIndex({0, 0, 0}), Vec3d(1, 2, 3));
    EXPECT_EQ(grid.lattice.worldFromIndex({8, 4, 1}), Vec3d(5, 4, 3.5));
    EXPECT_EQ(cubicGridOfSpacing({{0, 0, 0}, {0.7, 0.3, 0}}, 0.1).points.size(), Vec3i(8, 4, 1));
}

TEST(SamplingGrid, SpanningGridEndsAtTheUpperCorner) {
    const SamplingGrid grid = spanningGrid({{0, 0, 0}, {8, 2, 3}}, {5, 3, 4});
    EXPECT_EQ(grid.points.count(), 60);
    EXPECT_EQ(grid.lattice.worldFromIndex({4, 2, 3}), Vec3d(8, 2, 3));
    EXPECT_TRUE(grid.lattice.isAxisParallel());
}

TEST(SamplingGrid, RejectsWhatCanNotBeSampled) {
    EXPECT_THROW(cubicGrid({}, 5), InputError);
    EXPECT_THROW(cubicGrid({{1, 1, 1}, {1, 1, 1}}, 5), InputError);
    EXPECT_THROW(cubicGrid({{0, 0, 0}, {1, 1, 1}}, 1), InputError);
    EXPECT_THROW(cubicGridOfSpacing({{0, 0, 0}, {1, 1, 1}}, 0), InputError);
    EXPECT_THROW(cubicGridOfSpacing({{0, 0, 0}, {1, 1, 1}}, 1e-9), InputError);
    EXPECT_THROW(spanningGrid({{0, 0, 0}, {1, 1, 0}}, {4, 4, 4}), InputError);
    EXPECT_THROW(spanningGrid({{0, 0, 0}, {1, 1, 1}}, {4, 1, 4}), InputError);
}

TEST(SamplingGrid, BoxesCoverEveryPointOnce) {
    const IndexBox points{{-3, 0, 2}, {10, 7, 5}};
    std::int64_t count = 0;
    for (const IndexBox& box : cutIntoBoxes(points, 4)) {
        count += box.count();
        EXPECT_EQ(intersect(box, points), box);
        EXPECT_LE(box.size().x, 4);
    }
    EXPECT_EQ(count, points.count());
}

}  // namespace
}  // namespace tessera
