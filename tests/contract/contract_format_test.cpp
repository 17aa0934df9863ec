// Clauses 3 and 4 for the normalised formats: values just inside the bounds pass and those just outside
// don't; resamplers whose values go through such a format pass, and those that cheat are caught.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "contract_suite.h"
#include "mesh/field_range.h"
#include "oracle_resampler.h"
#include "quantised_resampler.h"
#include "reference/fields.h"
#include "reference/format_allowance.h"
#include "reference/generators.h"
#include "software/software_resampler.h"
#include "tessera/lattice.h"

namespace tessera::contract {
namespace {

constexpr SampleFormat kSteppedFormats[] = {SampleFormat::r8, SampleFormat::r16, SampleFormat::r16f};
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(FormatAllowance, KnowsTheStepsOfFloatAndHalf) {
    EXPECT_EQ(floatUlp(1), 0x1p-23);
    EXPECT_EQ(floatUlp(-1.5), 0x1p-23);
    EXPECT_EQ(floatUlp(std::nextafter(1.0, 0.0)), 0x1p-24);
    EXPECT_EQ(floatUlp(0x1p-126), 0x1p-149);
    EXPECT_EQ(floatUlp(0), 0x1p-149);
    EXPECT_EQ(halfUlp(1), 0x1p-10);
    EXPECT_EQ(halfUlp(0.999), 0x1p-11);
    EXPECT_EQ(halfUlp(0x1p-14), 0x1p-24);
    EXPECT_EQ(halfUlp(1e-9), 0x1p-24);
    EXPECT_EQ(halfUlp(0), 0x1p-24);
}

TEST(FormatAllowance, TakesTheRangeOverWhatIsFiniteInFloat) {
    const Field field{"f", FieldLocation::point, 2, {1, -5, kInfinity, 1e39, -3, -6, NAN, 1e300, 2, 7}};
    EXPECT_EQ(finiteFloatRange(field, 0).min, -3);
    EXPECT_EQ(finiteFloatRange(field, 0).max, 2);
    EXPECT_EQ(finiteFloatRange(field, 1).min, -6);
    EXPECT_EQ(finiteFloatRange(field, 1).max, 7);
    EXPECT_TRUE(finiteFloatRange({"g", FieldLocation::point, 1, {NAN, 1e300}}, 0).empty());
}

/// One element with values 10, 12, 14 and 18 at its nodes, and another far away that gives the field its
/// range.
struct TwoElements {
    TwoElements(SampleFormat format, const std::vector<double>& range, FieldLocation location,
                const ContractBounds& given = {})
        : bounds(given) {
        bounds.format = format;
        mesh.points = {{0, 0, 0},  {8, 0, 0},  {0, 8, 0},  {0, 0, 8},
                       {50, 0, 0}, {58, 0, 0}, {50, 8, 0}, {50, 0, 8}};
        mesh.tets = {{0, 1, 2, 3}, {4, 5, 6, 7}};
        std::vector<double> values{10, 12, 14, 18};
        if (location == FieldLocation::cell) values = {10};
        values.insert(values.end(), range.begin(), range.end());
        mesh.fields.push_back({"f", location, 1, values});
    }
    ContractReport check(const Vec3i& p, float value) const {
        const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1);
        const Oracle oracle(mesh, lattice);
        const IndexBox box{p, p + 1};
        const ReferenceBlock reference = referenceBlock(oracle, box, {.toleranceVoxels = bounds.spillVoxels});
        const Block block{lattice, box, 1, {value}, {1}};
        return checkContract(block, reference, oracle, std::vector{0}, bounds);
    }
    /// The last float within `allowed` of the exact value passes, the next is caught.
    void expectLimits(const Vec3i& p, double exact, double allowed) const {
        for (const double sign : {-1.0, 1.0}) {
            const float beyond = float(sign) * std::numeric_limits<float>::infinity();
            const auto error = [&](float value) { return std::abs(double(value) - exact); };
            auto in = float(exact + sign * allowed);
            while (error(in) > allowed) in = std::nextafter(in, float(exact));
            // The place bound adds less than this for the slopes here.
            float out = in;
            while (error(out) <= allowed + 1e-7) out = std::nextafter(out, beyond);
            ASSERT_LT(error(out), allowed + 4e-6);
            const ContractReport inside = check(p, in), outside = check(p, out);
            EXPECT_TRUE(inside.isClean()) << inside.summary();
            EXPECT_NEAR(inside.worstRatio, 1, 4e-6 / allowed);
            EXPECT_EQ(outside.inaccurate, 1) << outside.summary();
        }
    }

    TetMesh mesh;
    ContractBounds bounds;
};

constexpr Vec3i kPoint{2, 1, 1};  // exact value 10 + 2/8 * 2 + 1/8 * 4 + 1/8 * 8 = 12
constexpr double kExact = 12;
constexpr double kFloatPart = 0x1p-17;  // 4 ulp of 18

TEST(CheckFormats, AllowsAStepOfTheNormalisedFormatsAndNoMore) {
    TwoElements(SampleFormat::r8, {0, 255, 3, 4}, FieldLocation::point)
        .expectLimits(kPoint, kExact, 1 + kFloatPart);
    TwoElements(SampleFormat::r16, {0, 65535, 3, 4}, FieldLocation::point)
        .expectLimits(kPoint, kExact, 1 + kFloatPart);
    // The range runs from -33 to the element's own 18, and the float part is of 18 + 33.
    TwoElements(SampleFormat::r8, {-33, 0, 0, 0}, FieldLocation::point)
        .expectLimits(kPoint, kExact, 0.2 + 2 * kFloatPart);
}

TEST(CheckFormats, AllowsAnUlpOfHalfAtTheElementsLargestNormalisedValue) {
    // t = 18 / 1024 lies between 2^-6 and 2^-5: steps of 2^-16.
    TwoElements(SampleFormat::r16f, {0, 1024, 3, 4}, FieldLocation::point)
        .expectLimits(kPoint, kExact, 0x1p-6 + kFloatPart);
    // t = 18 / 2^20 is below 2^-14: steps of 2^-24.
    TwoElements(SampleFormat::r16f, {0, 0x1p20, 3, 4}, FieldLocation::point)
        .expectLimits(kPoint, kExact, 0x1p-4 + kFloatPart);
    // t = 1 at the largest node value.
    TwoElements(SampleFormat::r16f, {2, 3, 4, 5}, FieldLocation::point)
        .expectLimits(kPoint, kExact, 0x1p-10 * 16 + kFloatPart);
}

TEST(CheckFormats, DoesNotCountValuesThatAreNotFiniteInTheRange) {
    TwoElements(SampleFormat::r8, {0, 255, kInfinity, -1e300}, FieldLocation::point)
        .expectLimits(kPoint, kExact, 1 + kFloatPart);
}

TEST(CheckFormats, CatchesOvershootByMoreThanAStep) {
    // A wide place bound, so that clause 4 lets pass what clause 3 doesn't. The first node: exact value 10,
    // the element's least.
    const ContractBounds wide{.placeVoxels = 1};
    for (const SampleFormat format : {SampleFormat::r8, SampleFormat::r16}) {
        const TwoElements s(format, {0, format == SampleFormat::r8 ? 255.0 : 65535.0, 3, 4},
                            FieldLocation::point, wide);
        EXPECT_TRUE(s.check({0, 0, 0}, 9).isClean());
        EXPECT_EQ(s.check({0, 0, 0}, float(9 - 2 * kFloatPart)).overshoot, 1);
        EXPECT_TRUE(s.check({0, 0, 8}, 19).isClean());
        EXPECT_EQ(s.check({0, 0, 8}, float(19 + 2 * kFloatPart)).overshoot, 1);
    }
    const TwoElements half(SampleFormat::r16f, {0, 1024, 3, 4}, FieldLocation::point, wide);
    EXPECT_TRUE(half.check({0, 0, 0}, 10 - 0x1p-6f).isClean());
    EXPECT_EQ(half.check({0, 0, 0}, 10 - 0x1.01p-6f).overshoot, 1);
    const TwoElements exact(SampleFormat::r32f, {0, 1024, 3, 4}, FieldLocation::point, wide);
    EXPECT_TRUE(exact.check({0, 0, 0}, 10.5f).isClean());
    EXPECT_EQ(exact.check({0, 0, 0}, std::nextafter(10.0f, 9.0f)).overshoot, 1);
}

TEST(CheckFormats, CatchesValuesOutsideTheFieldsRange) {
    for (const SampleFormat format : kSteppedFormats) {
        const TwoElements s(format, {10, 11, 12, 18}, FieldLocation::point);
        EXPECT_TRUE(s.check({0, 0, 0}, 10).isClean());
        EXPECT_EQ(s.check({0, 0, 0}, std::nextafter(10.0f, 9.0f)).overshoot, 1);
        EXPECT_TRUE(s.check({0, 0, 8}, 18).isClean());
        EXPECT_EQ(s.check({0, 0, 8}, std::nextafter(18.0f, 19.0f)).overshoot, 1);
    }
}

TEST(CheckFormats, WantsAFieldOfOneValueExactly) {
    for (const SampleFormat format : kSteppedFormats) {
        TwoElements s(format, {10, 10, 10, 10}, FieldLocation::point);
        s.mesh.fields[0].values.assign(8, 0.1);
        EXPECT_TRUE(s.check(kPoint, 0.1f).isClean());
        EXPECT_EQ(s.check(kPoint, std::nextafter(0.1f, 1.0f)).overshoot, 1);
        EXPECT_EQ(s.check(kPoint, std::nextafter(0.1f, 0.0f)).overshoot, 1);
        TwoElements cell(format, {10}, FieldLocation::cell);
        EXPECT_TRUE(cell.check(kPoint, 10).isClean());
        EXPECT_FALSE(cell.check(kPoint, std::nextafter(10.0f, 11.0f)).isClean());
    }
}

TEST(CheckFormats, AllowsAStepForCellFieldsToo) {
    constexpr double kFloatPartOfTen = 0x1p-18;  // 4 ulp of 10
    const auto expectLimits = [](const TwoElements& s, double step) {
        s.expectLimits(kPoint, 10, step + kFloatPartOfTen);
    };
    TwoElements s(SampleFormat::r8, {255}, FieldLocation::cell);
    s.mesh.tets.push_back({4, 5, 6, 7});
    s.mesh.fields[0].values.push_back(0);
    expectLimits(s, 1);
    s.bounds.format = SampleFormat::r16;
    expectLimits(s, 255.0 / 65535);
    s.bounds.format = SampleFormat::r16f;
    expectLimits(s, 255 * 0x1p-15);  // 10 / 255 lies between 2^-5 and 2^-4
    s.bounds.format = SampleFormat::r32f;
    EXPECT_TRUE(s.check(kPoint, 10).isClean());
    EXPECT_EQ(s.check(kPoint, std::nextafter(10.0f, 11.0f)).wrongOwner, 1);
}

TEST(CheckFormats, WantsValidityExactly) {
    for (const SampleFormat format : kSteppedFormats) {
        TwoElements s(format, {0, 255, 3, 4}, FieldLocation::point);
        EXPECT_EQ(s.check(kPoint, kNaN).wrongValidity, 1);
        for (const double hole : {double(kNaN), kInfinity, 1e300, -1e39}) {
            s.mesh.fields[0].values[2] = hole;
            EXPECT_TRUE(s.check(kPoint, kNaN).isClean());
            EXPECT_EQ(s.check(kPoint, 0).wrongValidity, 1);
            EXPECT_EQ(s.check(kPoint, std::numeric_limits<float>::infinity()).wrongValidity, 1);
        }
        TwoElements cell(format, {255}, FieldLocation::cell);
        EXPECT_EQ(cell.check(kPoint, kNaN).wrongValidity, 1);
        cell.mesh.fields[0].values[0] = kInfinity;
        EXPECT_TRUE(cell.check(kPoint, kNaN).isClean());
        EXPECT_EQ(cell.check(kPoint, 255).wrongOwner + cell.check(kPoint, 255).wrongValidity, 1);
    }
}

TEST(CheckFormats, TakesEveryChannelsOwnRange) {
    TetMesh mesh = TwoElements(SampleFormat::r8, {0, 255, 3, 4}, FieldLocation::point).mesh;
    mesh.fields[0] = {
        "f", FieldLocation::point, 2, {10, 1, 12, 2, 14, 3, 18, 9, 0, 0, 255, 25.5, 3, 3, 4, 4}};
    const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1);
    const Oracle oracle(mesh, lattice);
    const IndexBox box{{0, 0, 0}, {1, 1, 1}};
    const ContractBounds bounds{.format = SampleFormat::r8};
    const ReferenceBlock reference = referenceBlock(oracle, box, {});
    const auto check = [&](float a, float b) {
        return checkContract({lattice, box, 2, {a, b}, {1}}, reference, oracle, std::vector{0}, bounds);
    };
    EXPECT_TRUE(check(10.9f, 1.09f).isClean());
    EXPECT_EQ(check(10.9f, 1.9f).inaccurate, 1);
    EXPECT_EQ(check(11.9f, 1.9f).inaccurate, 2);
}

TEST(CheckFormats, CatchesTheWrongOwner) {
    // Both elements hold the point, the second less deep; their values are 40 steps of r8 apart.
    TwoElements s(SampleFormat::r8, {255}, FieldLocation::cell);
    for (std::size_t i = 0; i < 4; ++i) s.mesh.points[4 + i] = s.mesh.points[i] + Vec3d(0.5, 0.25, 0);
    s.mesh.fields[0].values = {10, 50};
    s.mesh.points.insert(s.mesh.points.end(), {{90, 0, 0}, {98, 0, 0}, {90, 8, 0}, {90, 0, 8}});
    s.mesh.tets.push_back({8, 9, 10, 11});
    s.mesh.fields[0].values.push_back(265);  // a range of 255: steps of 1
    EXPECT_TRUE(s.check(kPoint, 10).isClean());
    EXPECT_EQ(s.check(kPoint, 50).wrongOwner, 1);
    EXPECT_EQ(s.check(kPoint, 30).inaccurate, 1);
}

TEST(CheckBounds, FollowTheResampler) {
    // Two elements that hold the point (1, 1.5, 1.5), the second less deep by `shift`; then the point lies
    // outside both by as much.
    const auto check = [](double bound, double shift, double outside, float value) {
        TetMesh mesh;
        mesh.points = {{0, 0, 0},     {9, 0, 0},         {0, 9, 0},     {0, 0, 9},
                       {shift, 0, 0}, {9 + shift, 0, 0}, {shift, 9, 0}, {shift, 0, 9}};
        mesh.tets = {{0, 1, 2, 3}, {4, 5, 6, 7}};
        mesh.fields.push_back({"element", FieldLocation::cell, 1, {1, 2}});
        const Lattice lattice = Lattice::axisParallel({outside > 0 ? -outside : 1, 1.5, 1.5}, 1);
        const Oracle oracle(mesh, lattice);
        const IndexBox box{Vec3i(0), Vec3i(1)};
        const ReferenceBlock reference = referenceBlock(oracle, box, {.toleranceVoxels = bound});
        return checkContract({lattice, box, 1, {value}, {1}}, reference, oracle, std::vector{0},
                             {bound, bound});
    };
    for (const double bound : {0x1p-12, 0x1p-8}) {
        EXPECT_TRUE(check(bound, 0.9 * bound, 0, 2).isClean());
        EXPECT_EQ(check(bound, 1.1 * bound, 0, 2).wrongOwner, 1);
        EXPECT_TRUE(check(bound, 0.1 * bound, 0.85 * bound, 2).isClean());
        EXPECT_TRUE(check(bound, 0, bound, 1).isClean());
        EXPECT_EQ(check(bound, 0, std::nextafter(bound, 1.0), 1).spill, 1);
    }
}

TEST(CheckBounds, AllowPlacesWithinTheBoundOfDevicesAndNoMore) {
    TetMesh mesh = boxMesh({.cells = {5, 5, 5}, .jitter = 0.2});
    addPointField(mesh, "wavy", {wavyField});
    addElementIdField(mesh, "element");
    const std::vector<int> fields{0, 1};
    const IndexBox box{Vec3i(4), Vec3i(28)};  // inside the mesh, so that only values can be wrong
    const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1.0 / 32);
    const Oracle oracle(mesh, lattice);
    const ContractBounds bounds{0x1p-8, 0x1p-8};
    const ReferenceBlock reference = referenceBlock(oracle, box, {.toleranceVoxels = bounds.spillVoxels});
    const auto shifted = [&](double voxels) {
        Lattice other = lattice;
        other.originWorld += Vec3d(voxels / 32 / std::sqrt(3.0));
        Block block = resampleBlock(SoftwareResampler(), mesh, fields, other, box);
        block.lattice = lattice;
        return checkContract(block, reference, oracle, fields, bounds);
    };
    const ContractReport within = shifted(0.45 * 0x1p-8), beyond = shifted(3 * 0x1p-8);
    EXPECT_TRUE(within.isClean()) << within.summary();
    EXPECT_GT(within.worstRatio, 0.3);
    EXPECT_GT(beyond.inaccurate, beyond.points / 2) << beyond.summary();
}

TEST(CheckContract, ChecksCoverageEverywhereAndValuesAtSomePoints) {
    TetMesh mesh = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
    addPointField(mesh, "wavy", {wavyField});
    const Lattice lattice = Lattice::axisParallel(Vec3d(0), 1.0 / 32);
    const IndexBox box{Vec3i(-1), Vec3i(34)};
    const Oracle oracle(mesh, lattice);
    const ReferenceBlock reference = referenceBlock(oracle, box);
    Block block = resampleBlock(SoftwareResampler(), mesh, std::vector{0}, lattice, box);
    for (float& value : block.values) value = 0.25f;
    block.coverage[block.offset({3, 4, 5})] = 0;
    const ContractReport report =
        checkContract(block, reference, oracle, std::vector{0}, {}, {.valuesEvery = 10});
    EXPECT_EQ(report.holes, 1);
    EXPECT_NEAR(double(report.valued), double(report.covered) / 10, 0.01 * double(report.covered));
    EXPECT_GT(report.inaccurate + report.overshoot, report.valued * 9 / 10);
}

// A resampler whose values go through a format.

Subject subjectOf(const QuantisedResampler& resampler, SampleFormat format) {
    return {&resampler, {}, format, false, false, "Quantised" + std::string(nameOf(format))};
}

const SoftwareResampler& software() {
    static const SoftwareResampler resampler;
    return resampler;
}

std::vector<LatticeCase> someLattices(const MeshCase& meshCase, const TetMesh& mesh) {
    std::vector<LatticeCase> some;
    for (const LatticeCase& at : latticesAbout(mesh, meshCase.alignedSpacing, 10))
        if (at.name == "aligned" || at.name == "third offset" || at.name == "fine") some.push_back(at);
    return some;
}

TEST(QuantisedResampler, MeetsTheContractOnEveryMesh) {
    const QuantisedResampler strict(software());
    const QuantisedResampler loose(software(), {Cheat::none, 0x1p-8});
    int i = 0;
    for (const MeshCase& meshCase : meshCases()) {
        SCOPED_TRACE(meshCase.name);
        TetMesh mesh = meshCase.make();
        addTestFields(mesh);
        for (const LatticeCase& at : someLattices(meshCase, mesh)) {
            const SampleFormat format = kSteppedFormats[++i % 3];
            expectContract(subjectOf(strict, format), mesh, at);
            expectContract(subjectOf(loose, i % 2 == 0 ? format : SampleFormat::r32f), mesh, at);
        }
    }
}

/// The mesh, with fields that cover their range well, that cheats are tried on.
struct TrialGround {
    TrialGround() : mesh(gradedDelaunayMesh(100, 1.5, 4)) {
        const int wavy = addPointField(mesh, "wavy", {wavyField});
        addPointField(mesh, "linear", {[](const Vec3d& p) { return 3 + p.x + 2 * p.y; }});
        addHoledCopy(mesh, wavy, "holed", 7);
        addPointField(mesh, "constant", {[](const Vec3d&) { return 0.1; }});
        at = latticeOver(mesh, 16);
    }
    ContractReport measure(Cheat cheat, SampleFormat format) const {
        const QuantisedResampler resampler(software(), {cheat, 0});
        return measureContract(subjectOf(resampler, format), mesh, at);
    }
    TetMesh mesh;
    LatticeCase at;
};

TEST(QuantisedResampler, IsCaughtWhenItCheats) {
    const TrialGround ground;
    for (const SampleFormat format : kSteppedFormats) {
        SCOPED_TRACE(nameOf(format));
        const ContractReport honest = ground.measure(Cheat::none, format);
        EXPECT_TRUE(honest.isClean()) << honest.summary();
        EXPECT_GT(honest.worstRatio, 0.9);  // truncation comes near to a whole step
        const ContractReport twice = ground.measure(Cheat::truncatesTwice, format);
        EXPECT_GT(twice.inaccurate + twice.overshoot, honest.covered / 10) << twice.summary();
        const ContractReport off = ground.measure(Cheat::oneAndAHalfStepsOff, format);
        EXPECT_GT(off.inaccurate + off.overshoot, honest.covered / 4) << off.summary();
        EXPECT_GT(ground.measure(Cheat::losesInvalidPoints, format).wrongValidity, 0);
        EXPECT_GT(ground.measure(Cheat::leavesCoverageOut, format).holes, 0);
    }
}

TEST(QuantisedResampler, IsCaughtWhenItsValuesDependOnTheBox) {
    const TrialGround ground;
    for (const SampleFormat format : kSteppedFormats) {
        const QuantisedResampler honest(software());
        EXPECT_EQ(findChangedBits(subjectOf(honest, format), ground.mesh, ground.at),
                  std::vector<std::string>{});
        const QuantisedResampler cheat(software(), {Cheat::takesRangeOfBox, 0});
        const auto changed = findChangedBits(subjectOf(cheat, format), ground.mesh, ground.at);
        EXPECT_GE(changed.size(), 2u);
        for (const std::string& what : changed)
            EXPECT_EQ(what.find("threads"), std::string::npos)
                << what << ": one box is the same on any threads";
    }
}

TEST(Subjects, HaveEveryFormatOnceAndEveryDeviceInTheExactOne) {
    /// Stands for a resampler whose targets are devices, of which this machine has none.
    class OnDevices : public QuantisedResampler {
      public:
        explicit OnDevices(const Resampler& exact) : QuantisedResampler(exact, {}, infoHere(exact)) {}
        static ResamplerInfo infoHere(const Resampler& exact) {
            ResamplerInfo info = infoOf(exact, {});
            info.name = "on devices";
            info.isOnDevice = true;
            info.targetsAgree = false;
            return info;
        }
        std::vector<std::string> targets() const override { return {}; }
        std::string unavailableReason() const override { return "no device"; }
    };
    std::vector<std::string> names;
    const QuantisedResampler quantised(software());
    for (const Subject& subject : subjectsOf(quantised)) {
        names.push_back(subject.name);
        EXPECT_EQ(subject.unavailableReason(), "");
        EXPECT_FALSE(subject.isRequired);
        EXPECT_EQ(subject.isPrimary, subject.format == SampleFormat::r32f);
    }
    EXPECT_EQ(names, (std::vector<std::string>{"Quantised", "QuantisedR16f", "QuantisedR16", "QuantisedR8"}));
    const OnDevices devices(software());
    for (const Subject& subject : subjectsOf(devices)) {
        EXPECT_EQ(subject.unavailableReason(), "no device");
        EXPECT_EQ(subject.isRequired, subject.target != "egl-device") << subject.name;
        EXPECT_EQ(subject.target.empty(), subject.format != SampleFormat::r32f) << subject.name;
        EXPECT_EQ(subject.name.rfind("OnDevices", 0), 0u) << subject.name;
    }
}

}  // namespace
}  // namespace tessera::contract
