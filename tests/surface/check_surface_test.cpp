#include "surface/check_surface.h"

#include <gmpxx.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "reference/random.h"
#include "surface/crossing_search.h"
#include "surface/triangle_crossing.h"
#include "surface_test_shapes.h"
#include "tessera/error.h"

namespace tessera {
namespace {

using namespace test;

constexpr double kPi = std::numbers::pi;

std::vector<SurfaceFinding> faultsOf(const Surface& surface, SurfaceShells* shells = nullptr) {
    return findSurfaceFaults(surface, {}, shells);
}

/// The findings' faults and counts: "open 3, crossing 1".
std::string summary(const std::vector<SurfaceFinding>& findings) {
    std::string text;
    for (const SurfaceFinding& finding : findings)
        text += (text.empty() ? "" : ", ") + std::string(nameOf(finding.fault)) + " " +
                std::to_string(finding.count);
    return text;
}
std::string faultSummary(const Surface& surface) {
    return summary(faultsOf(surface));
}

Surface unitBox() {
    Surface surface;
    appendBox(surface, Vec3d(0), Vec3d(1));
    return surface;
}

// ---- sound surfaces

TEST(SurfaceCheck, TakesABoxAndSaysItsVolume) {
    SurfaceShells shells;
    Surface surface;
    appendBox(surface, {1, 2, 3}, {2, 4, 6});
    surface.points.push_back({1.5, 3, 4});  // no triangle uses it
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 1u);
    EXPECT_DOUBLE_EQ(shells.shells[0].volumeWorld, 6);
    EXPECT_EQ(shells.shells[0].triangles, 12);
    EXPECT_EQ(shells.shells[0].around, 0);
    // Half of the shortest side is the most clearance that there is.
    EXPECT_DOUBLE_EQ(shells.shells[0].insideWorld.x, 1.5);
    EXPECT_EQ(shells.shellOf, std::vector<std::int32_t>(12, 0));
}

TEST(SurfaceCheck, TakesASphereAndATorusBesideEachOther) {
    Surface surface;
    appendSphere(surface, Vec3d(0), 1, 40);
    appendTorus(surface, {4, 0, 0}, 2, 0.5, 64, 32);
    SurfaceShells shells;
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 2u);
    EXPECT_NEAR(shells.shells[0].volumeWorld, 4 * kPi / 3, 0.03);
    EXPECT_NEAR(shells.shells[1].volumeWorld, 2 * kPi * kPi * 2 * 0.25, 0.1);
    EXPECT_LT(glm::length(shells.shells[0].insideWorld), 0.9);
    const Vec3d inTorus = shells.shells[1].insideWorld - Vec3d(4, 0, 0);
    EXPECT_LT(std::hypot(std::hypot(inTorus.x, inTorus.y) - 2, inTorus.z), 0.4);
}

TEST(SurfaceCheck, TakesTwoPartsThatShareAPoint) {
    Surface surface = unitBox();
    appendBox(surface, Vec3d(1), Vec3d(2));
    for (auto& triangle : surface.triangles)
        for (std::int32_t& point : triangle)
            if (surface.points[std::size_t(point)] == Vec3d(1)) point = cornerOfBox(0, {1, 1, 1});
    SurfaceShells shells;
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    EXPECT_EQ(shells.shells.size(), 2u);
}

TEST(SurfaceCheck, KnowsShellsInShellsWhicheverWayTheyLook) {
    for (const bool innerLooksInwards : {true, false}) {
        Surface surface;
        appendSphere(surface, {0.1, 0, 0}, 1, 20);
        if (innerLooksInwards) turnAll(surface, 0);
        const auto inner = std::int64_t(surface.triangles.size());
        appendSphere(surface, Vec3d(0), 2, 20);
        appendSphere(surface, {0, 0.1, 0}, 0.5, 20);
        appendSphere(surface, {3, 3, 0}, 1, 20);
        SurfaceShells shells;
        EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
        ASSERT_EQ(shells.shells.size(), 4u);
        EXPECT_EQ(shells.shells[1].firstTriangle, inner);
        EXPECT_EQ(shells.shells[0].volumeWorld < 0, innerLooksInwards);
        EXPECT_EQ(shells.shells[0].around, 1);
        EXPECT_EQ(shells.shells[1].around, 0);
        EXPECT_EQ(shells.shells[2].around, 2);
        EXPECT_EQ(shells.shells[3].around, 0);
        const auto distance = [&](std::size_t shell, const Vec3d& centre) {
            return glm::distance(shells.shells[shell].insideWorld, centre);
        };
        EXPECT_LT(distance(0, {0.1, 0, 0}), 1);
        EXPECT_GT(distance(0, {0, 0.1, 0}), 0.48);
        EXPECT_LT(distance(1, Vec3d(0)), 2);
        EXPECT_GT(distance(1, {0.1, 0, 0}), 0.97);
        EXPECT_LT(distance(2, {0, 0.1, 0}), 0.5);
    }
}

TEST(SurfaceCheck, FindsPlacesInThinShells) {
    Surface surface;
    appendOctahedron(surface, 1);
    appendOctahedron(surface, 1 - 1e-9);
    SurfaceShells shells;
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 2u);
    const Vec3d between = glm::abs(shells.shells[0].insideWorld);
    EXPECT_LT(between.x + between.y + between.z, 1 - 1e-10);
    EXPECT_GT(between.x + between.y + between.z, 1 - 9e-10);

    // A plate of a millionth of its length, askew: x + 2 y + 3 z runs over [0, 1e-6] across it.
    Surface plate;
    appendBox(plate, Vec3d(0), {1, 1, 1e-6 / 14});
    for (Vec3d& p : plate.points) p = p.x * Vec3d(2, -1, 0) + p.y * Vec3d(3, 6, -5) + p.z * Vec3d(1, 2, 3);
    EXPECT_EQ(summary(faultsOf(plate, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 1u);
    const double across = glm::dot(shells.shells[0].insideWorld, Vec3d(1, 2, 3));
    EXPECT_NEAR(across, 0.5e-6, 0.4e-6);
}

TEST(SurfaceCheck, FindsACavityThatTouchesItsShellWithAllItsCorners) {
    Surface surface;
    appendSphere(surface, Vec3d(0), 1, 8);
    const std::size_t cavity = surface.triangles.size();
    // Its points are the south pole and three points of a band in the north.
    appendTetrahedron(surface, Vec3d(0), {1, 0, 0}, {0, 1, 0}, {0, 0, 1});
    const std::int32_t own = surface.triangles[cavity][0], band = 1 + 5 * 16;
    for (std::size_t t = cavity; t < surface.triangles.size(); ++t)
        for (std::int32_t& point : surface.triangles[t])
            point = std::array{0, band, band + 5, band + 11}[std::size_t(point - own)];
    SurfaceShells shells;
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 2u);
    EXPECT_EQ(shells.shells[0].around, 0);
    EXPECT_EQ(shells.shells[1].around, 1);
    EXPECT_NE(shells.shells[1].volumeWorld, 0);
}

TEST(SurfaceCheck, FindsACavityThatAlmostTouchesItsShell) {
    Surface surface = unitBox();
    appendBox(surface, Vec3d(0x1p-53), Vec3d(1 - 0x1p-53));
    SurfaceShells shells;
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 2u);
    EXPECT_EQ(shells.shells[0].around, 0);
    EXPECT_EQ(shells.shells[1].around, 1);
    // Between 0 and 2^-53 there are doubles.
    const Vec3d between = shells.shells[0].insideWorld;
    EXPECT_GT(std::min({between.x, between.y, between.z}), 0);
    EXPECT_LT(std::min({between.x, between.y, between.z}), 0x1p-53);
}

TEST(SurfaceCheck, HasNoShellsWithoutTriangles) {
    SurfaceShells shells;
    EXPECT_TRUE(faultsOf({}, &shells).empty());
    EXPECT_TRUE(shells.shells.empty());
}

// ---- each fault

TEST(SurfaceCheck, FindsTrianglesWithoutArea) {
    Surface surface = unitBox();
    surface.triangles.push_back({3, 3, 5});
    // On a line through 0, exactly, as they are multiples of one place by powers of 2.
    for (const double factor : {-1.0, -2.0, -4.0}) surface.points.push_back(factor * Vec3d(0.1, 0.2, 0.3));
    surface.triangles.push_back({8, 9, 10});
    const auto findings = faultsOf(surface);
    EXPECT_EQ(summary(findings), "degenerate 2");
    EXPECT_EQ(findings[0].triangles, (std::vector<std::int64_t>{12, 13}));
    surface.points[10].z = std::nextafter(surface.points[10].z, 0);
    EXPECT_EQ(faultSummary(surface), "degenerate 1, open 3");
}

TEST(SurfaceCheck, FindsTrianglesThatAreThereTwice) {
    Surface surface = unitBox();
    const auto t = surface.triangles[4];
    surface.triangles.push_back({t[2], t[1], t[0]});
    const auto findings = faultsOf(surface);
    EXPECT_EQ(summary(findings), "duplicate 1");
    EXPECT_EQ(findings[0].triangles, std::vector<std::int64_t>{12});
}

TEST(SurfaceCheck, FindsHoles) {
    Surface surface = unitBox();
    surface.triangles.erase(surface.triangles.begin() + 3);
    const auto findings = faultsOf(surface);
    EXPECT_EQ(summary(findings), "open 3");
    EXPECT_EQ(findings[0].triangles.size(), 3u);
    EXPECT_TRUE(std::is_sorted(findings[0].triangles.begin(), findings[0].triangles.end()));
}

TEST(SurfaceCheck, FindsEdgesOfManyTriangles) {
    Surface surface = unitBox();
    const std::int32_t a = cornerOfBox(0, {0, 0, 0}), b = cornerOfBox(0, {1, 0, 0});
    surface.points.push_back({0.5, -1, -1});
    surface.triangles.push_back({a, b, 8});
    const auto findings = faultsOf(surface);
    EXPECT_EQ(summary(findings), "non-manifold 1, open 2");
    EXPECT_EQ(findings[0].placeWorld, Vec3d(0.5, 0, 0));
    EXPECT_EQ(findings[0].triangles.size(), 3u);
}

TEST(SurfaceCheck, FindsTrianglesThatAreTurned) {
    Surface surface = unitBox();
    for (const std::size_t t : {2u, 3u, 9u}) turn(surface, t);
    const auto findings = faultsOf(surface);
    EXPECT_EQ(summary(findings), "turned 3");
    EXPECT_EQ(findings[0].triangles, (std::vector<std::int64_t>{2, 3, 9}));
}

TEST(SurfaceCheck, FindsAMoebiusStripOpenAndOneSided) {
    const auto findings = faultsOf(moebiusStrip(24));
    EXPECT_EQ(summary(findings), "open 48, non-orientable 1");
    EXPECT_GE(findings[1].triangles.size(), 2u);
}

TEST(SurfaceCheck, FindsAClosedOneSidedSurfaceCrossingItself) {
    const auto findings = faultsOf(kleinBottle(40, 20));
    ASSERT_EQ(findings.size(), 2u);
    EXPECT_EQ(findings[0].fault, SurfaceFault::nonOrientable);
    EXPECT_EQ(findings[0].count, 1);
    EXPECT_EQ(findings[1].fault, SurfaceFault::crossing);
}

TEST(SurfaceCheck, FindsPartsThatCross) {
    Surface surface = unitBox();
    // Its tip pierces the top face inside of one of its triangles: that crosses the three sides.
    appendTetrahedron(surface, {0.2, 0.7, 0.9}, {0.1, 0.6, 2}, {0.3, 0.6, 2}, {0.2, 0.8, 2});
    const auto findings = faultsOf(surface);
    EXPECT_EQ(summary(findings), "crossing 3");
    EXPECT_EQ(findings[0].triangles.size(), 4u);
    EXPECT_NEAR(findings[0].placeWorld.z, 1, 1e-12);
}

TEST(SurfaceCheck, TakesTouchingForCrossing) {
    for (const double gap : {1e-16, 0.0}) {
        Surface surface;
        appendTetrahedron(surface, {-1, -1, 0}, {2, -1, 0}, {-1, 2, 0}, {0, 0, -1});
        appendTetrahedron(surface, {0, 0, gap}, {-1, 0, 1}, {1, 0, 1}, {0, 1, 1});
        EXPECT_EQ(faultSummary(surface), gap > 0 ? "" : "crossing 3");
    }
}

TEST(SurfaceCheck, FindsTrianglesFoldedOntoEachOther) {
    Surface surface;
    surface.points = {{0, 0, 0}, {1, 0, 0}, {0.3, 1, 0}, {0.5, 2, 0}, {0.5, -1, 0}};
    surface.triangles = {{0, 1, 2}, {1, 0, 3}};
    EXPECT_EQ(faultSummary(surface), "open 4, crossing 1");
    surface.points[3].z = 1e-300;
    EXPECT_EQ(faultSummary(surface), "open 4");
    surface.triangles[1][2] = 4;
    EXPECT_EQ(faultSummary(surface), "open 4");
}

TEST(SurfaceCheck, FindsOutermostShellsThatLookInwards) {
    Surface surface;
    appendSphere(surface, Vec3d(0), 1, 10);
    const auto first = std::int64_t(surface.triangles.size());
    appendSphere(surface, {3, 0, 0}, 1, 10);
    turnAll(surface, std::size_t(first));
    SurfaceShells shells;
    const auto findings = faultsOf(surface, &shells);
    EXPECT_EQ(summary(findings), "inverted 1");
    EXPECT_EQ(findings[0].triangles, std::vector<std::int64_t>{first});
    EXPECT_TRUE(shells.shells.empty());
}

// ---- the crossing of two triangles

using Rational3 = std::array<mpq_class, 3>;

mpq_class dot(const Rational3& a, const Rational3& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Rational3 cross(const Rational3& a, const Rational3& b) {
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Rational3 minus(const Rational3& a, const Rational3& b) {
    return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

/// What of a convex polygon lies where the normal's product with (x - origin) isn't negative.
std::vector<Rational3> clip(const std::vector<Rational3>& polygon, const Rational3& origin,
                            const Rational3& normal) {
    std::vector<Rational3> kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
        const Rational3 &p = polygon[i], &q = polygon[(i + 1) % polygon.size()];
        const mpq_class sp = dot(normal, minus(p, origin)), sq = dot(normal, minus(q, origin));
        if (sp >= 0) kept.push_back(p);
        if (sgn(sp) * sgn(sq) < 0) {
            const mpq_class part = sp / (sp - sq);
            Rational3 at;
            for (std::size_t k = 0; k < 3; ++k) at[k] = p[k] + part * (q[k] - p[k]);
            kept.push_back(at);
        }
    }
    return kept;
}

/// Clips the second triangle by the planes that bound the first, and looks for corners outside of what they
/// share by index.
bool crossByClipping(const Surface& surface) {
    std::array<std::array<Rational3, 3>, 2> corners;
    for (std::size_t t = 0; t < 2; ++t)
        for (std::size_t i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k)
                corners[t][i][std::size_t(k)] = surface.points[std::size_t(surface.triangles[t][i])][k];
    const auto& [a, b, c] = corners[0];
    const Rational3 normal = cross(minus(b, a), minus(c, a)), opposite = minus({}, normal);
    std::vector<Rational3> common(corners[1].begin(), corners[1].end());
    common = clip(clip(common, a, normal), a, opposite);
    for (std::size_t i = 0; i < 3; ++i)
        common = clip(common, corners[0][i], cross(normal, minus(corners[0][(i + 1) % 3], corners[0][i])));
    std::vector<Rational3> shared;
    for (std::size_t i = 0; i < 3; ++i)
        for (const std::int32_t other : surface.triangles[1])
            if (surface.triangles[0][i] == other) shared.push_back(corners[0][i]);
    return std::any_of(common.begin(), common.end(), [&](const Rational3& point) {
        if (shared.empty()) return true;
        const Rational3 along = shared.size() > 1 ? minus(shared[1], shared[0]) : Rational3{};
        const Rational3 off = cross(along, minus(point, shared[0]));
        return shared.size() > 1 ? dot(off, off) != 0 : point != shared[0];
    });
}

bool isFlat(const Surface& surface, std::size_t triangle) {
    Rational3 corners[3];
    for (std::size_t i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k)
            corners[i][std::size_t(k)] = surface.points[std::size_t(surface.triangles[triangle][i])][k];
    const Rational3 normal = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]));
    return dot(normal, normal) == 0;
}

TEST(TriangleCrossing, AgreesWithClippingInRationals) {
    Random random(7);
    int crossing = 0, apart = 0;
    for (int round = 0; round < 24000; ++round) {
        const int shared = round % 3, grid = 2 + round % 4;
        // As they are, in one plane, and where differences or products don't fit into doubles.
        const int kind = random.below(6);
        Surface surface;
        for (int p = 0; p < 6 - shared; ++p) {
            Vec3d place(random.below(grid), random.below(grid), random.below(grid));
            if (kind == 1 || kind == 2) place.z = kind == 1 ? 1 : place.x + 2 * place.y;
            if (kind == 2 || kind == 3) place = 0.1 * place + Vec3d(0.7, 1e-3, -3.3);
            if (kind == 4) place = (place - 1.0) * 5e307;
            if (kind == 5) place = place * 3e-308;
            surface.points.push_back(place);
        }
        surface.triangles = {{0, 1, 2}, {3 - shared, 4 - shared, 5 - shared}};
        for (auto& triangle : surface.triangles)
            std::rotate(triangle.begin(), triangle.begin() + random.below(3), triangle.end());
        if (isFlat(surface, 0) || isFlat(surface, 1)) continue;
        const bool expected = crossByClipping(surface);
        (expected ? crossing : apart) += 1;
        ASSERT_EQ(trianglesCross(surface, 0, 1), expected) << "round " << round;
        ASSERT_EQ(trianglesCross(surface, 1, 0), expected) << "round " << round;
    }
    EXPECT_GT(crossing, 3000);
    EXPECT_GT(apart, 3000);
}

TEST(TriangleCrossing, IsCountedTheSameForAnyThreadsAndOrder) {
    Surface surface;
    appendSphere(surface, Vec3d(0), 1, 30);
    Random random(3);
    for (Vec3d& point : surface.points) point += 0.05 * random.offset();
    std::vector<SurfaceFinding> first;
    for (const int threads : {1, 2, 5}) {
        Execution execution;
        execution.threads = threads;
        const auto findings = findSurfaceFaults(surface, execution, nullptr);
        ASSERT_EQ(findings.size(), 1u);
        if (first.empty()) first = findings;
        EXPECT_EQ(findings[0].count, first[0].count);
        EXPECT_EQ(findings[0].triangles, first[0].triangles);
        EXPECT_EQ(findings[0].placeWorld, first[0].placeWorld);
    }
    std::int64_t pairs = 0;
    for (std::size_t t = 0; t < surface.triangles.size(); ++t)
        for (std::size_t o = 0; o < t; ++o)
            pairs += trianglesCross(surface, std::int64_t(t), std::int64_t(o));
    EXPECT_EQ(first[0].count, pairs);
    for (std::size_t t = surface.triangles.size() - 1; t > 0; --t)
        std::swap(surface.triangles[t], surface.triangles[std::size_t(random.below(int(t) + 1))]);
    EXPECT_EQ(faultsOf(surface)[0].count, first[0].count);
}

TEST(TriangleCrossing, EndsWhereTooManyLieTogether) {
    Surface stack;  // boxes that all meet, triangles that don't
    for (int i = 0; i < 100; ++i) {
        const double z = 1e-3 * i;
        const auto first = std::int32_t(stack.points.size());
        stack.points.insert(stack.points.end(), {{0, 0, z}, {1, 0, z + 1}, {0, 1, z + 1}});
        stack.triangles.push_back({first, first + 1, first + 2});
    }
    const std::vector<std::uint8_t> none(stack.triangles.size() + 1, 0);
    const CrossingLimits few{2, 100};
    {
        const TriangleTree tree(stack, none, {});
        EXPECT_EQ(findCrossings(tree, {}, {}).pairs, 0);
        EXPECT_THROW(findCrossings(tree, few, {}), InputError);
    }
    stack.points.insert(stack.points.end(), {{0.2, 0.2, -5}, {0.25, 0.2, -5}, {0.2, 0.2, 9}});
    stack.triangles.push_back({300, 301, 302});
    const TriangleTree tree(stack, none, {});
    EXPECT_EQ(findCrossings(tree, {}, {}).pairs, 100);
    std::int64_t pairs = -1;
    for (const int threads : {1, 4}) {
        Execution execution;
        execution.threads = threads;
        try {
            const std::int64_t found = findCrossings(tree, few, execution).pairs;
            EXPECT_LE(found, 100);
            EXPECT_TRUE(pairs == -1 || pairs == found);
            pairs = found;
        } catch (const InputError&) {
            EXPECT_TRUE(pairs == -1 || pairs == 0);
            pairs = 0;
        }
    }
}

TEST(SurfaceCheck, EndsOnPlacesAtTheEndsOfDoubles) {
    for (const double scale : {1e308, 1e-308, 4e-320}) {
        Surface surface;
        appendBox(surface, Vec3d(-scale), Vec3d(scale));
        SurfaceShells shells;
        EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
        ASSERT_EQ(shells.shells.size(), 1u);
        EXPECT_GT(shells.shells[0].volumeWorld, 0);
        EXPECT_TRUE(std::isfinite(shells.shells[0].volumeWorld));
        EXPECT_LT(std::fabs(shells.shells[0].insideWorld.x), scale);
        turnAll(surface, 0);
        const auto findings = faultsOf(surface);
        EXPECT_EQ(summary(findings), "inverted 1");
    }
    Random random(5);
    Surface wild;
    for (int p = 0; p < 60; ++p)
        wild.points.push_back(random.offset() * std::pow(10.0, 600 * random.unit() - 300));
    for (std::int32_t p = 0; p < 60; p += 2) wild.triangles.push_back({p, (p + 7) % 60, (p + 23) % 60});
    EXPECT_LT(faultSentence(faultsOf(wild), wild).size(), 400u);
    repairSurface(wild, {});
}

// ---- sentences

TEST(FaultSentence, SaysWhatIsWrongAndWhere) {
    Surface surface = unitBox();
    surface.triangles.erase(surface.triangles.begin());
    auto findings = faultsOf(surface);
    findings[0].placeWorld = {1, 0, 2};
    findings[0].triangles = {17, 18, 40};
    EXPECT_EQ(faultSentence(findings, surface),
              "3 edges belong to one triangle only, so the surface is open, the first near (1, 0, 2): "
              "triangles 17, 18, 40 (counted from 0)");
    findings.push_back({SurfaceFault::turned, 1, Vec3d(0), {2}});
    findings.push_back({SurfaceFault::crossing, 12, Vec3d(0), {5, 6}});
    EXPECT_EQ(faultSentence(findings, surface),
              "3 edges belong to one triangle only, so the surface is open, the first near (1, 0, 2): "
              "triangles 17, 18, 40 (counted from 0); also 1 turned triangle and 12 pairs of triangles that "
              "cross; tessera-tetrahedralize --repair-surface merges points and turns triangles");
    EXPECT_EQ(faultSentence({}, surface), "");
}

TEST(FaultSentence, SaysWhenPointsLieAtOnePlace) {
    const Surface soup = asSoup(unitBox());
    const std::string sentence = faultSentence(faultsOf(soup), soup);
    EXPECT_NE(sentence.find("36 edges belong to one triangle only"), std::string::npos) << sentence;
    EXPECT_NE(sentence.find("; 28 points lie at the same place as others: tessera-tetrahedralize "
                            "--repair-surface merges them"),
              std::string::npos)
        << sentence;
}

TEST(FaultSentence, IsShortWithAllFaultsAtOnce) {
    std::vector<SurfaceFinding> findings;
    for (int f = 0; f < 8; ++f)
        findings.push_back(
            {SurfaceFault(f), 123456789, Vec3d(-1.23456e-105), std::vector<std::int64_t>(10, 123456789)});
    Surface surface;
    surface.points.resize(1);
    for (SurfaceFinding& finding : findings) {
        if (finding.fault == SurfaceFault::degenerate) finding.triangles.clear();
        EXPECT_LT(faultSentence({finding}, surface).size(), 400u);
    }
    EXPECT_LT(faultSentence(findings, surface).size(), 500u);
}

// ---- repair

TEST(SurfaceRepair, MendsLooseTurnedTriangles) {
    Surface sphere;
    appendSphere(sphere, Vec3d(0), 1, 12);
    Surface surface = asSoup(sphere);
    std::int64_t turned = 0;
    for (std::size_t t = 0; t < surface.triangles.size(); t += 3, ++turned) turn(surface, t);
    surface.triangles.push_back({0, 0, 1});
    surface.triangles.push_back({5, 4, 3});
    const auto coincident = std::int64_t(surface.points.size() - sphere.points.size());
    const SurfaceRepair repair = repairSurface(surface, {});
    EXPECT_EQ(repair.mergedPoints, coincident);
    EXPECT_EQ(repair.removedTriangles, 2);
    EXPECT_EQ(repair.turnedTriangles, turned);
    EXPECT_EQ(surface.points.size(), sphere.points.size());
    SurfaceShells shells;
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 1u);
    EXPECT_GT(shells.shells[0].volumeWorld, 0);
}

TEST(SurfaceRepair, TakesMeansOfWhatIsMerged) {
    Surface surface;
    surface.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    surface.triangles = {{0, 1, 2}, {3, 4, 5}};
    surface.fields = {{"t", FieldLocation::point, 2, {0, 0, 1, -1, 2, -2, 3, -3, 4, -4, 5, -5}}};
    const SurfaceRepair repair = repairSurface(surface, {});
    EXPECT_EQ(repair.mergedPoints, 2);
    EXPECT_EQ(repair.turnedTriangles, 0);
    EXPECT_EQ(surface.points, (std::vector<Vec3d>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}));
    EXPECT_EQ(surface.fields[0].values, (std::vector<double>{0, 0, 2, -2, 3.5, -3.5, 4, -4}));
    EXPECT_EQ(surface.triangles[1], (std::array<std::int32_t, 3>{1, 3, 2}));
}

TEST(SurfaceRepair, TurnsOutermostShellsOutwardsAndLeavesInnerOnesAsMostTrianglesAre) {
    Surface surface;
    appendSphere(surface, Vec3d(0), 2, 16);
    turnAll(surface, 0);
    const std::size_t inner = surface.triangles.size();
    turn(surface, 3);
    appendSphere(surface, Vec3d(0), 1, 16);
    turnAll(surface, inner);
    turn(surface, inner + 5);
    const SurfaceRepair repair = repairSurface(surface, {});
    EXPECT_EQ(repair.turnedTriangles, std::int64_t(inner));  // all but one of the outer, one of the inner
    SurfaceShells shells;
    EXPECT_EQ(summary(faultsOf(surface, &shells)), "");
    ASSERT_EQ(shells.shells.size(), 2u);
    EXPECT_GT(shells.shells[0].volumeWorld, 0);
    EXPECT_LT(shells.shells[1].volumeWorld, 0);
    const SurfaceRepair again = repairSurface(surface, {});
    EXPECT_EQ(again.mergedPoints + again.removedTriangles + again.turnedTriangles, 0);
}

TEST(SurfaceRepair, LeavesHolesAndOneSidedPartsAlone) {
    Surface strip = moebiusStrip(24);
    const auto triangles = strip.triangles;
    const SurfaceRepair repair = repairSurface(strip, {});
    EXPECT_EQ(repair.mergedPoints + repair.removedTriangles + repair.turnedTriangles, 0);
    EXPECT_EQ(strip.triangles, triangles);
}

}  // namespace
}  // namespace tessera
