#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>

#include "contract_suite.h"
#include "oracle_resampler.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "tessera/error.h"
#include "tessera/lattice.h"
#include "tessera/registry.h"

namespace tessera::contract {
namespace {

/// Every registered resampler with every target and format; among them, to try the suite itself, the oracle.
const std::vector<Subject>& subjects() {
    static const std::vector<Subject> all = [] {
        registerResampler(std::make_unique<OracleResampler>());
        return subjectsOf(resamplers());
    }();
    return all;
}

using OnMesh = std::tuple<Subject, MeshCase>;

class Contract : public testing::TestWithParam<OnMesh> {
  protected:
    void SetUp() override {
        TESSERA_CONTRACT_NEEDS(subject());
        mesh_ = meshCase().make();
        addTestFields(mesh_);
    }
    const Subject& subject() const { return std::get<0>(GetParam()); }
    const MeshCase& meshCase() const { return std::get<1>(GetParam()); }
    bool isSlow() const { return subject().resampler->name() == "oracle"; }
    template <class Wanted>
    std::vector<LatticeCase> lattices(const Wanted& wanted) const {
        std::vector<LatticeCase> cases =
            latticesAbout(mesh_, meshCase().alignedSpacing, isSlow() ? 8 : pointsFor(subject(), 24));
        std::erase_if(cases, [&](const LatticeCase& at) { return !wanted(at); });
        const auto mesh = std::find_if(meshCases().begin(), meshCases().end(),
                                       [&](const MeshCase& c) { return c.name == meshCase().name; });
        return inTurn(subject(), cases, std::size_t(mesh - meshCases().begin()));
    }

    TetMesh mesh_;
};

TEST_P(Contract, HasNoHolesSpillOvershootOrWrongValues) {
    ContractReport total;
    for (const LatticeCase& at : lattices([&](const LatticeCase& at) {
             return isSlow() ? at.name == "aligned" || at.name == "fine" || at.name == "cut plane"
                             : takes(subject(), at);
         }))
        total += expectContract(subject(), mesh_, at);
    RecordProperty("worst_accuracy_ratio", std::to_string(total.worstRatio));
    RecordProperty("covered", std::to_string(total.covered));
}

TEST_P(Contract, GivesTheSameBitsAlways) {
    for (const LatticeCase& at : lattices([&](const LatticeCase& at) {
             return isSlow() ? at.name == "coarse" : comparesBits(subject(), at);
         }))
        expectDeterministic(subject(), mesh_, at);
}

INSTANTIATE_TEST_SUITE_P(All, Contract,
                         testing::Combine(testing::ValuesIn(subjects()), testing::ValuesIn(meshCases())),
                         [](const testing::TestParamInfo<OnMesh>& param) {
                             return std::get<0>(param.param).name + "On" + std::get<1>(param.param).name;
                         });

class ContractOf : public testing::TestWithParam<Subject> {
  protected:
    void SetUp() override { TESSERA_CONTRACT_NEEDS(GetParam()); }
    const Resampler& resampler() const { return *GetParam().resampler; }
};

TEST_P(ContractOf, RunsTheTargetAskedForAndRefusesOthers) {
    const std::vector<std::string> targets = resampler().targets();
    ASSERT_FALSE(targets.empty());
    EXPECT_EQ(std::set<std::string>(targets.begin(), targets.end()).size(), targets.size());
    const TetMesh mesh = boxMesh({});
    for (const std::string& target : targets)
        EXPECT_EQ(resampler().bind(mesh, {}, {.target = target})->target(), target);
    EXPECT_EQ(resampler().bind(mesh, {})->target(), targets.front());
    EXPECT_THROW(resampler().bind(mesh, {}, {.target = "no such target"}), InputError);
}

TEST_P(ContractOf, OffersTheExactFormatFirstAndRefusesThoseItDoesNotOffer) {
    const std::vector<SampleFormat> formats = resampler().info().formats;
    ASSERT_FALSE(formats.empty());
    EXPECT_EQ(formats.front(), SampleFormat::r32f);
    const TetMesh mesh = boxMesh({});
    for (const SampleFormat format :
         {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8}) {
        const bool isOffered = std::count(formats.begin(), formats.end(), format) == 1;
        if (isOffered)
            EXPECT_NO_THROW(resampler().bind(mesh, {}, {{}, format})) << nameOf(format);
        else
            EXPECT_THROW(resampler().bind(mesh, {}, {{}, format}), InputError) << nameOf(format);
    }
}

TEST_P(ContractOf, CoversTheClosedBoxExactly) {
    // Closed forms: an aligned lattice has (cells + 1)^3 points in a box, one at half offset cells^3.
    TetMesh mesh = boxMesh({.cells = {2, 2, 2}, .sizeWorld = {8, 8, 8}});
    const IndexBox box{Vec3i(-2), Vec3i(12)};
    const auto count = [&](const Vec3d& origin) {
        const Block block = sample(GetParam(), mesh, {}, Lattice::axisParallel(origin, 1), box);
        return std::count(block.coverage.begin(), block.coverage.end(), 1);
    };
    EXPECT_EQ(count(Vec3d(0)), 9 * 9 * 9);
    EXPECT_EQ(count(Vec3d(0.5)), 8 * 8 * 8);
    EXPECT_EQ(count({0, 0.5, 1.0 / 3}), 9 * 8 * 8);
    // Just inside on one side, and outside on the other by less than a resampler may spill.
    EXPECT_GE(count({1e-300, 0, 0}), 8 * 9 * 9);
    EXPECT_LE(count({1e-300, 0, 0}), 9 * 9 * 9);
    // Outside by more than any may spill.
    EXPECT_EQ(count({0x1p-7, 0, 0}), 8 * 9 * 9);
}

TEST_P(ContractOf, TakesLatticePointsAsRealNumbers) {
    // An edge of tet i runs from 0 to the first double at or beyond i times the double 0.1, which often isn't
    // their rounded product.
    const Lattice lattice{Vec3d(0), {0.1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    constexpr int kTets = 59;
    TetMesh mesh;
    std::int64_t points = 0;
    for (int i = 1; i <= kTets; ++i) {
        const mpq_class point = mpq_class(0.1) * i;
        double node = point.get_d();
        if (mpq_class(node) < point) node = std::nextafter(node, 10.0);
        const auto n = std::int32_t(mesh.points.size());
        const double y = i;
        mesh.points.insert(mesh.points.end(), {{0, y, 0}, {node, y, 0}, {0, y + 0.01, 0}, {0, y, 1}});
        mesh.tets.push_back({n, n + 1, n + 2, n + 3});
        points += i + 1;
    }
    const IndexBox box{{-1, 0, 0}, {kTets + 3, kTets + 2, 1}};
    const Oracle oracle(mesh, lattice);
    const ContractBounds bounds = GetParam().bounds();
    const Block block = sample(GetParam(), mesh, {}, lattice, box);
    const ReferenceBlock reference = referenceBlock(oracle, box, {.toleranceVoxels = bounds.spillVoxels});
    const ContractReport report = checkContract(block, reference, oracle, {}, bounds);
    EXPECT_TRUE(report.isClean()) << report.summary();
    EXPECT_EQ(report.inMesh, points);
}

/// Largest error of a format for values from 0 to `most`, in closed form.
double formatError(SampleFormat format, double most) {
    switch (format) {
        case SampleFormat::r8:
            return most / 255;
        case SampleFormat::r16:
            return most / 65535;
        case SampleFormat::r16f:
            return most * 0x1p-10;
        case SampleFormat::r32f:
            break;
    }
    return 0;
}

TEST_P(ContractOf, ReproducesALinearFieldAtNodes) {
    TetMesh mesh = boxMesh({.cells = {3, 4, 5}, .sizeWorld = {3, 4, 5}});
    addPointField(mesh, "sum", {[](const Vec3d& p) { return p.x + 10 * p.y + 100 * p.z; }});
    const IndexBox box{{0, 0, 0}, {4, 5, 6}};
    const Block block = sample(GetParam(), mesh, std::vector{0}, Lattice::axisParallel(Vec3d(0), 1), box);
    // Four ulp of the largest value in the mesh, what the format loses, and the field's slope times the place
    // bound.
    const double allowed = 4 * 0x1p-14 + formatError(GetParam().format, 543) +
                           std::sqrt(1.0 + 100 + 10000) * GetParam().bounds().placeVoxels;
    Vec3i p;
    for (p.z = 0; p.z < 6; ++p.z)
        for (p.y = 0; p.y < 5; ++p.y)
            for (p.x = 0; p.x < 4; ++p.x) {
                ASSERT_TRUE(block.covered(p));
                EXPECT_NEAR(block.value(0, p), p.x + 10 * p.y + 100 * p.z, allowed);
            }
}

TEST_P(ContractOf, LeavesAnEmptyMeshAndAnEmptyBoxUncovered) {
    const IndexBox box{Vec3i(0), Vec3i(3)};
    const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1);
    EXPECT_EQ(sample(GetParam(), TetMesh{}, {}, lattice, box).coverage, std::vector<std::uint8_t>(27, 0));
    TetMesh flat;
    flat.points = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {1, 1, 0}};
    flat.tets = {{0, 1, 2, 3}};
    EXPECT_EQ(sample(GetParam(), flat, {}, lattice, box).coverage, std::vector<std::uint8_t>(27, 0));
    EXPECT_EQ(sample(GetParam(), boxMesh({}), {}, lattice, {Vec3i(1), Vec3i(1)}).count(), 0u);
}

TEST_P(ContractOf, CoversATenthOfAMillionElementsInOneVoxel) {
    // 102,480 elements in one voxel whose corner is the middle of their box, a lattice point and a node.
    TetMesh mesh = boxMesh({.cells = {20, 20, 20}, .originWorld = Vec3d(-0.125), .sizeWorld = Vec3d(0.25)});
    appendMesh(mesh, dustMesh(Vec3d(0.3), 0.2, 0.01, 54480, 5));
    addTestFields(mesh);
    const LatticeCase at{"one voxel", Lattice::axisParallel(Vec3d(0), 1), {Vec3i(-1), Vec3i(3)}};
    const ContractReport report = expectContract(GetParam(), mesh, at);
    EXPECT_EQ(report.inMesh, 1);
}

TEST_P(ContractOf, CoversElementsThatSpanHundredsOfVoxels) {
    if (resampler().name() == "oracle") GTEST_SKIP() << "the oracle takes too long for so many points";
    for (const bool isTurned : {false, true}) {
        TetMesh mesh = boxMesh({.cells = {1, 1, 1}, .isFiveSplit = true});
        place(mesh, {1, Vec3d(0), isTurned});
        addRandomField(mesh, "random", FieldLocation::point, 1, 0, 1, 61);
        addElementIdField(mesh, "element");
        const int points = scaledPoints(650);
        const LatticeCase at = latticeOver(mesh, points);
        for (const int axis : {0, 1, 2}) {
            LatticeCase slab = at;
            slab.box.min[axis] = points / 3, slab.box.max[axis] = points / 3 + 1;
            const ContractReport report = expectContract(GetParam(), mesh, slab, {.valuesEvery = 51});
            EXPECT_GT(report.inMesh, points * points / 8);
            EXPECT_GT(report.valued, report.inMesh / 100);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(All, ContractOf, testing::ValuesIn(subjects()),
                         [](const testing::TestParamInfo<Subject>& param) { return param.param.name; });

}  // namespace
}  // namespace tessera::contract
