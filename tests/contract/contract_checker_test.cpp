// A checker that can't fail is worth nothing: right blocks pass, and blocks with one thing wrong are caught,
// each for that thing.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "contract_suite.h"
#include "mesh/field_range.h"
#include "oracle_resampler.h"
#include "reference/check_contract.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "tessera/lattice.h"

namespace tessera::contract {
namespace {

constexpr ContractBounds kBounds;

/// A mesh, the oracle's own block of it, and the reference to check against.
struct Setting {
    Setting(TetMesh given, const Lattice& lattice, const IndexBox& box)
        : mesh(std::move(given)),
          fields(everyField(mesh)),
          oracle(mesh, lattice),
          reference(referenceBlock(oracle, box, {.toleranceVoxels = kBounds.spillVoxels})),
          block(resampleBlock(OracleResampler(), mesh, fields, lattice, box)) {}

    ContractReport check() const { return checkContract(block, reference, oracle, fields, kBounds); }
    float& value(int channel, const Vec3i& p) {
        return block.values[std::size_t(channel) * block.count() + block.offset(p)];
    }

    TetMesh mesh;
    std::vector<int> fields;
    Oracle oracle;
    ReferenceBlock reference;
    Block block;
};

/// Channels: 0 wavy, 1 the same with holes, 2 element index.
Setting jitteredBox() {
    TetMesh mesh = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
    const int wavy = addPointField(mesh, "wavy", {wavyField});
    addHoledCopy(mesh, wavy, "holed", 9);
    addElementIdField(mesh, "element");
    return {std::move(mesh), Lattice::axisParallel(Vec3d(0), 1.0 / 11), {Vec3i(-1), Vec3i(13)}};
}

constexpr Vec3i kInside{4, 5, 6};

TEST(CheckContract, PassesTheOraclesOwnBlock) {
    const Setting s = jitteredBox();
    const ContractReport report = s.check();
    EXPECT_TRUE(report.isClean()) << report.summary();
    EXPECT_GE(report.covered, 11 * 11 * 11);  // 1 / 11 rounds up or down: the last layer may be out
    EXPECT_EQ(report.covered, report.inMesh);
    EXPECT_GT(report.worstRatio, 0);
    EXPECT_LE(report.worstRatio, 0.13);  // half an ulp of the value over four of the largest
}

TEST(CheckContract, CatchesAHole) {
    Setting s = jitteredBox();
    s.block.coverage[s.block.offset({0, 0, 0})] = 0;
    const ContractReport report = s.check();
    EXPECT_EQ(report.holes, 1);
    EXPECT_FALSE(report.isClean());
    EXPECT_NE(report.firstOffence.find("hole at lattice point (0 0 0)"), std::string::npos)
        << report.firstOffence;
    EXPECT_NE(report.firstOffence.find("element"), std::string::npos) << report.firstOffence;
}

TEST(CheckContract, CatchesSpill) {
    Setting s = jitteredBox();
    s.block.coverage[s.block.offset({-1, 4, 4})] = 1;
    const ContractReport report = s.check();
    EXPECT_EQ(report.spill, 1);
    EXPECT_EQ(report.holes + report.overshoot + report.inaccurate + report.wrongOwner + report.wrongValidity,
              0);
}

TEST(CheckContract, AllowsSpillWithinTheBoundOnly) {
    for (const double distance : {0.9 * kBounds.spillVoxels, 1.1 * kBounds.spillVoxels}) {
        TetMesh mesh = boxMesh({.cells = {2, 2, 2}, .sizeWorld = {4, 4, 4}});
        addPointField(mesh, "x", {[](const Vec3d& p) { return 3 + p.x; }});
        Setting s(std::move(mesh), Lattice::axisParallel({-distance, 0.3, 0.4}, 1), {{0, 1, 1}, {1, 2, 2}});
        ASSERT_EQ(s.block.coverage[0], 0);
        s.block.coverage[0] = 1;
        s.value(0, {0, 1, 1}) = 3;  // the value at the nearest point
        EXPECT_EQ(s.check().isClean(), distance < kBounds.spillVoxels) << s.check().summary();
        if (distance > kBounds.spillVoxels) continue;
        s.value(0, {0, 1, 1}) = 3.001f;
        EXPECT_EQ(s.check().inaccurate, 1);
    }
}

TEST(CheckContract, CatchesOvershootByOneUlp) {
    TetMesh mesh = boxMesh({.cells = {1, 1, 1}, .sizeWorld = {4, 4, 4}});
    addPointField(mesh, "constant", {[](const Vec3d&) { return 0.1; }});
    Setting s(std::move(mesh), Lattice::axisParallel(Vec3d(0), 1), {Vec3i(0), Vec3i(5)});
    ASSERT_TRUE(s.check().isClean());
    s.value(0, {1, 2, 3}) = std::nextafter(0.1f, 1.0f);
    EXPECT_EQ(s.check().overshoot, 1);
    s.value(0, {1, 2, 3}) = std::nextafter(0.1f, 0.0f);
    EXPECT_EQ(s.check().overshoot, 1);
}

TEST(CheckContract, CatchesAValueFiveUlpOff) {
    Setting s = jitteredBox();
    // Move by ulps of the largest node value, as clause 4 counts them.
    const auto& candidate = s.reference.candidatesOf(s.block.offset(kInside))[0];
    double largest = 0;
    for (const std::int32_t n : s.mesh.tets[std::size_t(candidate.element)])
        largest = std::max(largest, std::abs(s.mesh.fields[0].at(n, 0)));
    const double ulp = std::ldexp(1.0, std::ilogb(largest) - 23);
    const float right = s.value(0, kInside);
    s.value(0, kInside) = float(double(right) + 3 * ulp);
    EXPECT_TRUE(s.check().isClean()) << s.check().summary();
    EXPECT_GT(s.check().worstRatio, 0.5);
    s.value(0, kInside) = float(double(right) - 5 * ulp);
    EXPECT_EQ(s.check().inaccurate, 1);
    EXPECT_NE(s.check().firstOffence.find("exact value"), std::string::npos);
}

TEST(CheckContract, AllowsForThePlaceBound) {
    // A field of slope 2^24 a voxel: a place 2^-24 voxel off moves the value by 1, which is far above 4 ulp
    // of small node values.
    TetMesh mesh = thinTetsMesh(ThinKind::cap, 1e-7, 1, 1, 4);
    for (Vec3d& p : mesh.points) p -= mesh.points[3];
    addRandomField(mesh, "random", FieldLocation::point, 1, 0, 1, 3);
    Setting s(std::move(mesh), Lattice::axisParallel(Vec3d(0), 1), {Vec3i(0), Vec3i(1)});
    ASSERT_EQ(s.block.coverage[0], 1);
    const double gradient = std::sqrt(s.oracle.squaredGradient(s.mesh.fields[0], 0, 0).get_d());
    const double allowed = gradient * kBounds.placeVoxels;
    ASSERT_GT(allowed, 1e-5);
    const auto range = fieldRange(s.mesh.fields[0], 0);
    const double right = s.mesh.fields[0].at(3, 0), middle = 0.5 * (range.min + range.max);
    const double inwards = right < middle ? 1 : -1;
    s.value(0, Vec3i(0)) = float(right + inwards * 0.95 * allowed);
    EXPECT_TRUE(s.check().isClean()) << s.check().summary();
    s.value(0, Vec3i(0)) = float(right + inwards * (1.05 * allowed + 1e-6));
    EXPECT_EQ(s.check().inaccurate + s.check().overshoot, 1) << s.check().summary();
}

TEST(CheckContract, CatchesTheWrongElementOfACellField) {
    Setting s = jitteredBox();
    s.value(2, kInside) += 1;
    EXPECT_EQ(s.check().wrongOwner, 1);
}

/// Two tets that overlap about the lattice point (1, 1, 1), deeper in the first, with different constant
/// fields.
Setting twoOverlapping() {
    TetMesh mesh;
    mesh.points = {{0, 0, 0},    {9, 0, 0},    {0, 9, 0},    {0, 0, 9},
                   {0.75, 0, 0}, {9.75, 0, 0}, {0.75, 9, 0}, {0.75, 0, 9}};
    mesh.tets = {{0, 1, 2, 3}, {4, 5, 6, 7}};
    mesh.fields.push_back({"a", FieldLocation::point, 1, {1, 1, 1, 1, 2, 2, 2, 2}});
    mesh.fields.push_back({"b", FieldLocation::point, 1, {1, 1, 1, 1, 2, 2, 2, 2}});
    return {std::move(mesh), Lattice::axisParallel(Vec3d(0), 1), {Vec3i(1), Vec3i(2)}};
}

TEST(CheckContract, CatchesAnOwnerThatIsNotTheDeepest) {
    Setting s = twoOverlapping();
    EXPECT_EQ(s.value(0, Vec3i(1)), 1);
    ASSERT_TRUE(s.check().isClean());
    s.value(0, Vec3i(1)) = s.value(1, Vec3i(1)) = 2;
    EXPECT_EQ(s.check().wrongOwner, 2);
}

TEST(CheckContract, CatchesChannelsOfDifferentOwners) {
    TetMesh mesh = boxMesh({.cells = {1, 1, 1}, .sizeWorld = {2, 2, 2}});
    addElementIdField(mesh, "a");
    addElementIdField(mesh, "b");
    Setting s(std::move(mesh), Lattice::axisParallel(Vec3d(0), 1), {Vec3i(1), Vec3i(2)});
    // All six elements meet at the middle of the cell: each is a right owner, but one of them for both
    // fields.
    for (int e = 0; e < 6; ++e) {
        s.value(0, Vec3i(1)) = s.value(1, Vec3i(1)) = float(e);
        EXPECT_TRUE(s.check().isClean()) << s.check().summary();
    }
    s.value(0, Vec3i(1)) = 2;
    EXPECT_EQ(s.check().wrongOwner, 1);
}

TEST(CheckContract, CatchesWrongValidity) {
    Setting s = jitteredBox();
    constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
    Vec3i valid{-1}, invalid{-1}, p;
    for (p.z = 1; p.z < 10; ++p.z)
        for (p.y = 1; p.y < 10; ++p.y)
            for (p.x = 1; p.x < 10; ++p.x) (std::isnan(s.value(1, p)) ? invalid : valid) = p;
    ASSERT_GE(valid.x, 0);
    ASSERT_GE(invalid.x, 0);
    s.value(1, valid) = kNaN;
    EXPECT_EQ(s.check().wrongValidity, 1);
    s.value(1, invalid) = 0.5f;
    EXPECT_EQ(s.check().wrongValidity, 2);
    s.value(0, kInside) = kNaN;
    EXPECT_EQ(s.check().wrongValidity, 3);
}

TEST(CheckContract, CatchesAShiftByAThousandthOfAVoxel) {
    Setting s = jitteredBox();
    Lattice shifted = s.block.lattice;
    shifted.originWorld.x += 1e-3 / 11;
    Block moved = resampleBlock(OracleResampler(), s.mesh, s.fields, shifted, s.block.box);
    moved.lattice = s.block.lattice;
    s.block = moved;
    const ContractReport report = s.check();
    EXPECT_GT(report.inaccurate, report.points / 10) << report.summary();
}

/// In the element by a plain test in float.
bool containsInFloat(const TetMesh& mesh, std::int64_t element, const Vec3d& p) {
    using Vec3f = glm::vec3;
    std::array<Vec3f, 4> at;
    for (std::size_t i = 0; i < 4; ++i)
        at[i] = Vec3f(mesh.points[std::size_t(mesh.tets[std::size_t(element)][i])]);
    const Vec3f q(p);
    int positive = 0, negative = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const Vec3f a = at[(i + 1) % 4], n = cross(at[(i + 2) % 4] - a, at[(i + 3) % 4] - a);
        const float side = dot(n, q - a) * dot(n, at[i] - a);
        positive += side > 0;
        negative += side < 0;
    }
    return negative == 0 && positive > 0;
}

TEST(CheckContract, CatchesPlainFloatArithmetic) {
    TetMesh mesh = thinClusterMesh(1e-6, 1, 60, 8);
    Setting s(std::move(mesh), Lattice::axisParallel(Vec3d(0.5), 2e-7), {Vec3i(-10), Vec3i(11)});
    ASSERT_TRUE(s.check().isClean());
    Vec3i p;
    for (p.z = -10; p.z < 11; ++p.z)
        for (p.y = -10; p.y < 11; ++p.y)
            for (p.x = -10; p.x < 11; ++p.x) {
                bool isIn = false;
                for (std::int64_t e = 0; e < s.mesh.elementCount() && !isIn; ++e)
                    isIn = containsInFloat(s.mesh, e, s.block.lattice.worldFromIndex(Vec3d(p)));
                s.block.coverage[s.block.offset(p)] = isIn;
            }
    const ContractReport report = s.check();
    EXPECT_GT(report.holes + report.spill, 0) << report.summary();
}

TEST(CheckContract, AddsReportsUp) {
    Setting s = jitteredBox();
    ContractReport total = s.check();
    s.block.coverage[s.block.offset(kInside)] = 0;
    total += s.check();
    EXPECT_EQ(total.holes, 1);
    EXPECT_EQ(total.points, 2 * s.block.box.count());
    EXPECT_FALSE(total.firstOffence.empty());
}

TEST(ContractSuite, SeesBlocksThatDiffer) {
    Setting s = jitteredBox();
    Block other = s.block;
    EXPECT_EQ(differences(other, s.block), 0);
    other.values[other.offset({-1, -1, -1})] = 7;  // not covered: no matter
    EXPECT_EQ(differences(other, s.block), 0);
    other.values[other.offset(kInside)] = std::nextafter(other.values[other.offset(kInside)], 9.0f);
    EXPECT_EQ(differences(other, s.block), 1);
    other.coverage[other.offset({1, 1, 1})] = 0;
    EXPECT_EQ(differences(other, s.block), 2);
}

}  // namespace
}  // namespace tessera::contract
