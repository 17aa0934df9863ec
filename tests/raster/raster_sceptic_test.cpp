// Odd requests to the OpenGL resamplers, measured against the exact oracle where they are small and against
// the software resampler where they are large.

#include <algorithm>
#include <cmath>
#include <optional>

#include "raster_run_tools.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"
#include "tessera/lattice.h"

namespace tessera {
namespace {

using namespace rastertest;

/// An algorithm on the default platform of tests.
class RasterSceptic : public testing::TestWithParam<std::string_view> {
  protected:
    void SetUp() override { TESSERA_NEEDS_GL(GlPlatform::eglSurfaceless); }

    static contract::Subject subject(SampleFormat format = SampleFormat::r32f) {
        return {&namedResampler(GetParam()), "egl-surfaceless", format, true, true, std::string(GetParam())};
    }
    static std::vector<Block> sample(const TetMesh& mesh, std::span<const int> fields, const Lattice& lattice,
                                     std::span<const IndexBox> boxes,
                                     SampleFormat format = SampleFormat::r32f) {
        BindOptions options;
        options.target = "egl-surfaceless";
        options.format = format;
        return sampleOnce(GetParam(), mesh, fields, options, lattice, boxes).blocks;
    }
    static std::vector<Block> bySoftware(const TetMesh& mesh, std::span<const int> fields,
                                         const Lattice& lattice, std::span<const IndexBox> boxes) {
        return sampleOnce("software", mesh, fields, {}, lattice, boxes).blocks;
    }
};

std::int64_t coveredCount(const Block& block) {
    return std::ranges::count(block.coverage, std::uint8_t(1));
}

/// Whether some element contains a point, or lies within 2^-8 voxel of it.
struct Whereabouts {
    bool isIn = false, isNear = false;
};
Whereabouts whereabouts(const Oracle& oracle, const Vec3i& p) {
    const mpq_class bound = mpq_class(1, 65536);
    Whereabouts found;
    for (std::int64_t e = 0; e < oracle.mesh().elementCount(); ++e) {
        if (oracle.volumeSign(e) == 0) continue;
        Vec3d low(INFINITY), high(-INFINITY);
        for (const std::int32_t n : oracle.mesh().tets[std::size_t(e)]) {
            low = glm::min(low, oracle.frame().indexNode(n));
            high = glm::max(high, oracle.frame().indexNode(n));
        }
        if (glm::any(glm::lessThan(Vec3d(p), low - 0.01)) || glm::any(glm::lessThan(high + 0.01, Vec3d(p))))
            continue;
        found.isIn = found.isIn || oracle.contains(e, p);
        found.isNear = found.isNear || oracle.nearest(e, p).squaredDistance <= bound;
    }
    return found;
}

/// Coverage differs from the software resampler's only within 2^-8 voxel of the boundary, and loses no point
/// that is in the mesh. Returns the points that both cover.
std::int64_t expectSameCoverage(const Block& block, const Block& software, const TetMesh& mesh) {
    EXPECT_EQ(block.box, software.box);
    std::optional<Oracle> oracle;
    std::int64_t both = 0;
    int asked = 0;
    for (std::size_t i = 0; i < block.count(); ++i) {
        both += block.coverage[i] && software.coverage[i];
        if (block.coverage[i] == software.coverage[i] || ++asked > 2000) continue;
        if (!oracle) oracle.emplace(mesh, block.lattice);
        const Vec3i n = block.box.size();
        const Vec3i p =
            block.box.min + Vec3i(int(i % std::size_t(n.x)), int(i / std::size_t(n.x) % std::size_t(n.y)),
                                  int(i / std::size_t(n.x) / std::size_t(n.y)));
        const Whereabouts at = whereabouts(*oracle, p);
        EXPECT_TRUE(block.coverage[i] ? at.isNear : !at.isIn)
            << (block.coverage[i] ? "spill" : "hole") << " at " << p.x << " " << p.y << " " << p.z;
    }
    EXPECT_LE(asked, 2000) << "differences left unchecked";
    return both;
}

/// Clauses 1 to 5 over a box.
void expectContract(const contract::Subject& subject, const TetMesh& mesh, const Lattice& lattice,
                    const IndexBox& box) {
    const ContractReport report = contract::expectContract(subject, mesh, {"sceptic", lattice, box});
    EXPECT_GT(report.inMesh, 0);
}

TEST_P(RasterSceptic, EmptyMeshesCoverNothing) {
    TetMesh empty, nodesOnly, flatOnly;
    nodesOnly.points = {{0, 0, 0}, {1, 2, 3}};
    flatOnly.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    flatOnly.tets = {{0, 1, 2, 3}, {0, 0, 1, 2}, {3, 3, 3, 3}};
    for (TetMesh* mesh : {&empty, &nodesOnly, &flatOnly}) {
        addPointField(*mesh, "f", {wavyField});
        const std::vector<IndexBox> boxes{
            {{-2, -2, -2}, {3, 3, 3}}, {{0, 0, 0}, {0, 0, 0}}, {{5, 5, 5}, {6, 6, 6}}};
        for (const std::vector<int>& fields : {std::vector<int>{}, std::vector<int>{0}})
            for (const Block& block : sample(*mesh, fields, Lattice::axisParallel(Vec3d(0), 0.5), boxes)) {
                EXPECT_EQ(coveredCount(block), 0);
                EXPECT_EQ(block.channels, int(fields.size()));
                EXPECT_EQ(block.values.size(), block.count() * fields.size());
            }
    }
}

TEST_P(RasterSceptic, ElementsThatReachFarBeyondTheLatticeAreCovered) {
    for (const double far : {1e9, 1e20, 1e31, 1e60, 1e300}) {
        TetMesh mesh;
        mesh.points = {{-5, -5, -5}, {50, -5, -5}, {-5, 50, -5}, {-5, -5, far}};
        mesh.tets = {{0, 1, 2, 3}};
        const IndexBox box{Vec3i(0), Vec3i(8)};
        const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1);
        EXPECT_EQ(coveredCount(sample(mesh, {}, lattice, std::span(&box, 1))[0]), 512) << far;
        // A node so far to the other side that an index has no fraction, nor an int room for it.
        mesh.points = {far * Vec3d(1.5, -2.2, -0.9), {10, 19, 25}, {35, -0.3, -21}, {-13, 32, 20}};
        const IndexBox wide{Vec3i(0), Vec3i(40)};
        const auto ofSoftware = sampleOnce("software", mesh, {}, {}, lattice, std::span(&wide, 1));
        EXPECT_GT(coveredCount(ofSoftware.blocks[0]), 100);
        EXPECT_EQ(coveredCount(sample(mesh, {}, lattice, std::span(&wide, 1))[0]),
                  coveredCount(ofSoftware.blocks[0]))
            << far;
    }
}

TEST_P(RasterSceptic, NoBoxesAndEmptyBoxesAreServed) {
    const TetMesh mesh = smallMesh(2);
    const std::vector<int> fields{0, 1};
    EXPECT_TRUE(sample(mesh, fields, centredLattice(8), {}).empty());
    const std::vector<IndexBox> empty{{{0, 0, 0}, {0, 0, 0}}, {{3, 3, 3}, {3, 9, 9}}};
    for (const Block& block : sample(mesh, fields, centredLattice(8), empty)) EXPECT_EQ(block.count(), 0u);
}

TEST_P(RasterSceptic, WithoutFieldsThereIsStillCoverage) {
    TetMesh mesh = smallMesh(2);
    mesh.fields.clear();
    for (const SampleFormat format :
         {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8})
        expectContract(subject(format), mesh, Lattice::axisParallel(Vec3d(0), 1.0 / 12),
                       {Vec3i(-1), Vec3i(14)});
}

TEST_P(RasterSceptic, FieldsOfNineComponentsAndSeventeenChannels) {
    TetMesh mesh = boxMesh({.cells = Vec3i(2), .jitter = 0.25});
    addRandomField(mesh, "tensor", FieldLocation::point, 9, 10, 5, 1);
    addRandomField(mesh, "cells", FieldLocation::cell, 7, 0, 1, 2);
    addHoledCopy(mesh, 0, "holed", 3);
    mesh.fields.back().components = 1;
    mesh.fields.back().values.resize(mesh.points.size());
    for (const SampleFormat format :
         {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8})
        expectContract(subject(format), mesh, Lattice::axisParallel(Vec3d(-0.01), 1.0 / 9),
                       {Vec3i(0), Vec3i(11)});
}

TEST_P(RasterSceptic, AFieldAskedForTwiceComesTwice) {
    const TetMesh mesh = smallMesh(2);
    const std::vector<int> fields{1, 0, 0, 1};
    const IndexBox box = centredBox(9);
    const Block block = sample(mesh, fields, centredLattice(9), std::span(&box, 1))[0];
    ASSERT_EQ(block.channels, 8);
    EXPECT_GT(coveredCount(block), 500);
    for (const auto& [a, b] : {std::pair(3, 4), std::pair(0, 5), std::pair(1, 6), std::pair(2, 7)})
        EXPECT_TRUE(std::ranges::equal(block.channel(a), block.channel(b))) << a;
}

TEST_P(RasterSceptic, SinglePointsAndRowsAreThoseOfTheWhole) {
    const TetMesh mesh = smallMesh(3);
    const std::vector<int> fields{0, 1, 2};
    const Lattice lattice = centredLattice(20);
    const IndexBox whole = centredBox(20);
    std::vector<IndexBox> boxes{whole};
    for (int a = 0; a < 3; ++a)
        for (const int at : {-7, -1, 0, 6}) {
            IndexBox row{Vec3i(at), Vec3i(at + 1)};
            row.min[a] = whole.min[a], row.max[a] = whole.max[a];
            boxes.push_back(row);
        }
    for (int i = -11; i < 12; ++i) boxes.push_back({{i, -i / 2, 3}, {i + 1, -i / 2 + 1, 4}});
    const auto together = sample(mesh, fields, lattice, boxes);
    EXPECT_GT(coveredCount(together[0]), 6000);
    for (std::size_t b = 1; b < boxes.size(); ++b) {
        EXPECT_EQ(contract::differences(together[b], together[0]), 0) << "box " << b;
        const auto alone = sample(mesh, fields, lattice, std::span(&boxes[b], 1));
        EXPECT_EQ(contract::differences(alone[0], together[0]), 0) << "box " << b << " alone";
    }
}

TEST_P(RasterSceptic, OverlappingAndRepeatedBoxesAgree) {
    const TetMesh mesh = smallMesh(3);
    const std::vector<int> fields{0};
    const Lattice lattice = centredLattice(30);
    const IndexBox whole = centredBox(30);
    std::vector<IndexBox> boxes{whole, whole, {{-3, -3, -3}, {4, 4, 4}}, {{-3, -3, -3}, {4, 4, 4}}};
    for (int i = -16; i < 10; i += 3) boxes.push_back(intersect({Vec3i(i), Vec3i(i + 12)}, whole));
    const auto blocks = sample(mesh, fields, lattice, boxes);
    for (const Block& block : blocks) EXPECT_EQ(contract::differences(block, blocks[0]), 0);
}

TEST_P(RasterSceptic, ABoxOfThreeHundredPointsASideStraddlesCells) {
    TetMesh mesh = sphereMesh(7);
    addPointField(mesh, "linear", {[](const Vec3d& p) { return p.x + 2 * p.y - 3 * p.z; }});
    const std::vector<int> fields{0};
    const Lattice lattice = Lattice::axisParallel({0.001, 0, 0}, 1.0 / 140);
    const IndexBox box{{-150, -170, -150}, {150, 130, 150}};
    const Block block = std::move(sample(mesh, fields, lattice, std::span(&box, 1))[0]);
    const Block software = std::move(bySoftware(mesh, fields, lattice, std::span(&box, 1))[0]);
    EXPECT_GT(expectSameCoverage(block, software, mesh), 9'000'000);
    double worst = 0;
    for (std::size_t i = 0; i < block.count(); ++i)
        if (block.coverage[i] && software.coverage[i])
            worst = std::max(worst, std::fabs(double(block.values[i]) - double(software.values[i])));
    // The gradient times a place that may be 2^-8 voxel off is the most; it is far less in plump elements.
    EXPECT_LT(worst, std::sqrt(14.0) / 140 * 0x1p-8);
}

TEST_P(RasterSceptic, IndicesOfABillionMatter) {
    const TetMesh mesh = smallMesh(2);
    const int away = 1'000'000'000;
    for (const Vec3i& offset : {Vec3i(away), Vec3i(-away), Vec3i(away, -away, 7)}) {
        // Origin and spacing are powers of two, so that the lattice about the mesh is exact.
        const Lattice lattice = Lattice::axisParallel(Vec3d(offset) * -0.0625, 0.0625);
        expectContract(subject(), mesh, lattice, {offset - 2, offset + 19});
    }
}

/// Lattices of every kind about the unit box; `box` holds it.
struct OddLattice {
    std::string_view name;
    Lattice lattice;
    IndexBox box;
};
std::vector<OddLattice> oddLattices() {
    return {{"very different spacings",
             {Vec3d(0), {0.5, 0, 0}, {0, 0.002, 0}, {0, 0, 0.1}},
             {{-1, 0, -1}, {4, 502, 12}}},
            {"other spacings",
             {Vec3d(0.3), {3e-3, 0, 0}, {0, 40, 0}, {0, 0, 0.07}},
             {{-110, -1, -6}, {240, 2, 12}}},
            {"left-handed", {Vec3d(0), {0, 0.1, 0}, {0.1, 0, 0}, {0, 0, 0.1}}, {Vec3i(-1), Vec3i(12)}},
            {"mirrored", {Vec3d(1), {-0.1, 0, 0}, {0, -0.125, 0}, {0, 0, -0.0625}}, {Vec3i(-1), Vec3i(18)}},
            {"turned", {Vec3d(0.5), {0.06, 0.08, 0}, {-0.08, 0.06, 0}, {0, 0, 0.1}}, {Vec3i(-8), Vec3i(9)}},
            {"oblique",
             {{0.5, 0.5, 0.2}, {0.1, 0.03, 0}, {0.09, 0.1, 0.01}, {0.02, -0.05, 0.1}},
             {Vec3i(-9), Vec3i(10)}},
            {"a plane",
             {{0.5, 0.5, 0.5}, {0.02, 0.01, 0}, {-0.01, 0.02, 0.02}, {0.1, 0.1, -0.3}},
             {{-40, -40, 0}, {40, 40, 1}}}};
}

TEST_P(RasterSceptic, OddLatticesKeepTheContract) {
    const TetMesh mesh = smallMesh(2);
    for (const OddLattice& odd : oddLattices()) {
        SCOPED_TRACE(odd.name);
        expectContract(subject(), mesh, odd.lattice, odd.box);
    }
}

TEST_P(RasterSceptic, OddLatticesCoverWhatSoftwareCovers) {
    TetMesh mesh = gradedDelaunayMesh(300, 2.5, 4);
    addPointField(mesh, "wavy", {wavyField});
    const std::vector<int> fields{0};
    for (const OddLattice& odd : oddLattices()) {
        SCOPED_TRACE(odd.name);
        const auto block = sample(mesh, fields, odd.lattice, std::span(&odd.box, 1));
        const auto software = bySoftware(mesh, fields, odd.lattice, std::span(&odd.box, 1));
        EXPECT_GT(expectSameCoverage(block[0], software[0], mesh), 100);
    }
}

TEST_P(RasterSceptic, TinyValuesBesideLargeOnesKeepTheContractInEveryChannel) {
    // Channels of different groups must not disagree about who owns a point, though the tiny values of one
    // need the processor.
    TetMesh mesh = boxMesh({.cells = Vec3i(3), .jitter = 0.25});
    appendMesh(mesh, thinClusterMesh(1e-3, 1, 40, 3));
    addElementIdField(mesh, "element");
    addRandomField(mesh, "random", FieldLocation::point, 3, 0, 1, 1);
    addPointField(mesh, "wide", {[](const Vec3d& p) { return p.x > 0.6 ? 1e10 : 1e-37 * (1 + p.y); }});
    addElementIdField(mesh, "element again");
    // On the mesh's boundary and shared faces, just beside them, and anywhere.
    for (const double beside : {0.0, -1e-6, 1e-6, 0.4})
        expectContract(subject(), mesh, Lattice::axisParallel(Vec3d(beside / 12), 1.0 / 12),
                       {Vec3i(-1), Vec3i(14)});
}

TEST_P(RasterSceptic, PointsJustBesideTheMeshAreTheSameInEveryBox) {
    // Where rounding may decide, it must decide alike: planes of the lattice lie a little outside of the
    // mesh, or inside, as with meshes whose coordinates were floats.
    for (const bool isTurned : {false, true}) {
        TetMesh mesh = boxMesh({.cells = Vec3i(3), .jitter = 0.25});
        if (isTurned) place(mesh, {0.7, Vec3d(0.4), true});
        addElementIdField(mesh, "element");
        const std::vector<int> fields{0};
        for (const double beside : {1e-8, 1e-7, 1e-6, 1e-5, 1e-4})
            for (const double points : {6.0, 15.0})
                for (const double sign : {1.0, -1.0}) {
                    const Lattice lattice = Lattice::axisParallel(Vec3d(sign * beside / points), 1 / points);
                    const IndexBox box{Vec3i(-1), Vec3i(int(points) + 2)};
                    const auto whole = sample(mesh, fields, lattice, std::span(&box, 1));
                    std::int64_t differing = 0;
                    // One call each: the boxes of one call share regions.
                    for (const IndexBox& part : contract::cut(box, points < 10 ? 3 : 5))
                        differing += contract::differences(
                            sample(mesh, fields, lattice, std::span(&part, 1))[0], whole[0]);
                    EXPECT_EQ(differing, 0)
                        << beside * sign << " voxel, " << points << (isTurned ? ", turned" : "");
                }
    }
}

TEST_P(RasterSceptic, ValuesFiftyDecadesApartInOneFieldKeepTheContract) {
    TetMesh mesh = boxMesh({.cells = Vec3i(3), .jitter = 0.25});
    addPointField(mesh, "wide", {[](const Vec3d& p) { return p.x > 0.5 ? 3e38 : 1e-12 * (1 + p.y); }});
    addCellField(mesh, "wide cells", {[](const Vec3d& p) { return p.x > 0.5 ? -1e20 : 1e-30 * (1 + p.y); }});
    expectContract(subject(), mesh, Lattice::axisParallel(Vec3d(0), 1.0 / 12), {Vec3i(-1), Vec3i(14)});
}

TEST_P(RasterSceptic, ValuesTooSmallForFloatsCostNothing) {
    TetMesh mesh = boxMesh({.cells = Vec3i(3)});
    addPointField(mesh, "fraction", {[](const Vec3d& p) { return p.x > 0.9 ? 1.0 : 1e-60 * (1 + p.y); }});
    const std::vector<int> fields{0};
    BindOptions options;
    options.target = "egl-surfaceless";
    const IndexBox box = centredBox(12);
    const Sampled sampled =
        sampleOnce(GetParam(), mesh, fields, options, centredLattice(12), std::span(&box, 1));
    EXPECT_EQ(sampled.statistics.count(counted::exactElements), 0);
    expectContract(subject(), mesh, centredLattice(12), box);
}

TEST_P(RasterSceptic, InvertedOverlappingAndHangingElementsKeepTheContract) {
    TetMesh mesh = overlappingMesh(60, 3);
    appendMesh(mesh, hangingNodeMesh(2, 3));
    addFlatElements(mesh);
    invertEverySecond(mesh);
    addPointField(mesh, "wavy", {wavyField});
    addElementIdField(mesh, "element");
    for (const SampleFormat format : {SampleFormat::r32f, SampleFormat::r8})
        expectContract(subject(format), mesh, Lattice::axisParallel(Vec3d(0), 1.0 / 16),
                       {Vec3i(-1), Vec3i(18)});
}

TEST_P(RasterSceptic, BadRequestsAreRefusedAndForgotten) {
    const TetMesh mesh = smallMesh(2);
    const std::vector<int> fields{0};
    BindOptions options;
    options.target = "no such platform";
    EXPECT_THROW(namedResampler(GetParam()).bind(mesh, fields, options), InputError);
    const IndexBox box = centredBox(8), tooFar{Vec3i(1 << 30), Vec3i((1 << 30) + 5)};
    const auto before = sample(mesh, fields, centredLattice(8), std::span(&box, 1));
    EXPECT_THROW(sample(mesh, fields, Lattice::axisParallel(Vec3d(0), 0), std::span(&box, 1)), InputError);
    EXPECT_THROW(sample(mesh, fields, Lattice::axisParallel(Vec3d(NAN), 1), std::span(&box, 1)), InputError);
    EXPECT_THROW(sample(mesh, fields, centredLattice(8), std::span(&tooFar, 1)), InputError);
    EXPECT_EQ(differences(sample(mesh, fields, centredLattice(8), std::span(&box, 1)), before), 0);
}

INSTANTIATE_TEST_SUITE_P(Algorithms, RasterSceptic, testing::Values("slicing", "hybrid", "compute"),
                         [](const testing::TestParamInfo<std::string_view>& param) {
                             return std::string(param.param);
                         });

}  // namespace
}  // namespace tessera
