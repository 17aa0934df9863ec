#include "surface/extend_fields.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "reference/generators.h"
#include "surface/shell_of_place.h"
#include "surface/size_field.h"
#include "tessera/error.h"

namespace tessera {
namespace {

/// A box with a point field; the nodes inside have no value of their own.
struct HalfKnown {
    TetMesh mesh = boxMesh({.cells = Vec3i(6), .jitter = 0.2});
    std::vector<char> isKnown;

    template <class Value>
    explicit HalfKnown(const Value& value) {
        Field field{"f", FieldLocation::point, 1, {}};
        for (const Vec3d& p : mesh.points) {
            bool onBoundary = false;
            for (int k = 0; k < 3; ++k) onBoundary |= p[k] == 0 || p[k] == 1;
            isKnown.push_back(onBoundary);
            field.values.push_back(onBoundary ? value(p) : std::numeric_limits<double>::quiet_NaN());
        }
        mesh.fields.push_back(std::move(field));
        extendFields(mesh, isKnown);
    }
    double at(std::size_t node) const { return mesh.fields[0].values[node]; }
};

TEST(ExtendFields, MakesALinearFunctionOfALinearOne) {
    const auto linear = [](const Vec3d& p) { return 3 + p.x - 2 * p.y + 0.5 * p.z; };
    const HalfKnown box(linear);
    for (std::size_t n = 0; n < box.mesh.points.size(); ++n)
        EXPECT_NEAR(box.at(n), linear(box.mesh.points[n]), box.isKnown[n] ? 0 : 1e-9);
}

TEST(ExtendFields, StaysWithinTheRangeOfWhatIsKnown) {
    const HalfKnown box([](const Vec3d& p) { return p.x > 0.5 ? 7.0 : -1.0; });
    for (std::size_t n = 0; n < box.mesh.points.size(); ++n) {
        EXPECT_GE(box.at(n), -1);
        EXPECT_LE(box.at(n), 7);
    }
}

TEST(ExtendFields, KeepsValuesThatAreNotFiniteToThemselves) {
    const HalfKnown box(
        [](const Vec3d& p) { return p == Vec3d(0) ? std::numeric_limits<double>::infinity() : p.y; });
    for (std::size_t n = 0; n < box.mesh.points.size(); ++n) {
        const bool isCorner = box.mesh.points[n] == Vec3d(0);
        EXPECT_EQ(std::isfinite(box.at(n)), !isCorner);
    }
}

TEST(ExtendFields, HasNoValueWhereNothingIsKnown) {
    const HalfKnown box([](const Vec3d&) { return std::numeric_limits<double>::quiet_NaN(); });
    for (std::size_t n = 0; n < box.mesh.points.size(); ++n) EXPECT_TRUE(std::isnan(box.at(n)));
}

/// Two large triangles, the unit square, with a field of lengths.
Surface square() {
    Surface surface;
    surface.points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    surface.triangles = {{0, 1, 2}, {0, 2, 3}};
    surface.fields = {{"h", FieldLocation::point, 1, {0.1, 0.3, 0.3, 0.1}}};
    return surface;
}

TEST(SizeField, GrowsWithTheDistanceFromTheTriangles) {
    SizeWishes wishes;
    wishes.atSurface = 0.1;
    wishes.growth = 0.5;
    const SizeField size(square(), wishes, {});
    EXPECT_DOUBLE_EQ(size.at({0.4, 0.6, 0}), 0.1);  // far from every point, on a triangle
    EXPECT_DOUBLE_EQ(size.at({0.4, 0.6, -2}), 1.1);
    EXPECT_DOUBLE_EQ(size.at({4, 5, 0}), 0.1 + 0.5 * 5);
    EXPECT_EQ(size.least(), 0.1);
    wishes.everywhere = 0.7;
    EXPECT_DOUBLE_EQ(SizeField(square(), wishes, {}).at({4, 5, 0}), 0.7);
}

TEST(SizeField, TakesLengthsOfAField) {
    SizeWishes wishes;
    wishes.field = "h";
    const SizeField size(square(), wishes, {});
    EXPECT_NEAR(size.at({0.5, 0.5, 0}), 0.2, 1e-15);
    EXPECT_NEAR(size.at({0, 0.2, 0}), 0.1, 1e-15);
    wishes.smallest = 0.25;
    EXPECT_NEAR(SizeField(square(), wishes, {}).at({0, 0.2, 0}), 0.25, 1e-15);
    wishes.field = "k";
    EXPECT_THROW(SizeField(square(), wishes, {}), InputError);
    wishes.field = "h";
    Surface surface = square();
    surface.fields[0].values[2] = 0;
    EXPECT_THROW(SizeField(surface, wishes, {}), InputError);
}

TEST(SizeField, IsTheLeastOverAllTriangles) {
    Surface surface;  // a fan of random triangles with random lengths
    for (int i = 0; i < 300; ++i)
        surface.points.emplace_back(std::sin(i * 1.7), std::cos(i * 2.3), std::sin(i * 0.9));
    for (std::int32_t i = 0; i + 2 < 300; i += 3) surface.triangles.push_back({i, i + 1, i + 2});
    Field lengths{"h", FieldLocation::point, 1, {}};
    for (int i = 0; i < 300; ++i) lengths.values.push_back(0.01 + std::abs(std::sin(i * 5.1)));
    surface.fields.push_back(lengths);
    SizeWishes wishes;
    wishes.field = "h";
    wishes.growth = 0.3;
    const SizeField all(surface, wishes, {});
    for (int q = 0; q < 50; ++q) {
        const Vec3d place{std::sin(q * 3.3), std::cos(q * 1.1), std::sin(q * 7.7)};
        double least = std::numeric_limits<double>::infinity();
        for (const auto& triangle : surface.triangles) {
            Surface one = surface;
            one.triangles = {triangle};
            least = std::min(least, SizeField(one, wishes, {}).at(place));
        }
        EXPECT_EQ(all.at(place), least);
    }
}

TEST(CurvatureRadii, AreThoseOfASphere) {
    Surface sphere;
    constexpr int kRings = 24, kSides = 48;
    constexpr double kRadius = 3, kPi = 3.14159265358979323846;
    for (int r = 1; r < kRings; ++r)
        for (int s = 0; s < kSides; ++s) {
            const double polar = kPi * r / kRings, around = 2 * kPi * s / kSides;
            sphere.points.push_back(kRadius * Vec3d(std::sin(polar) * std::cos(around),
                                                    std::sin(polar) * std::sin(around), std::cos(polar)));
        }
    const auto at = [](int r, int s) { return std::int32_t((r - 1) * kSides + s % kSides); };
    for (int r = 1; r + 1 < kRings; ++r)
        for (int s = 0; s < kSides; ++s) {
            sphere.triangles.push_back({at(r, s), at(r + 1, s), at(r + 1, s + 1)});
            sphere.triangles.push_back({at(r, s), at(r + 1, s + 1), at(r, s + 1)});
        }
    const std::vector<double> radii = curvatureRadii(sphere);
    for (int s = 0; s < kSides; ++s)
        EXPECT_NEAR(radii[std::size_t(at(kRings / 2, s))], kRadius, 0.02 * kRadius);
}

TEST(ShellOfPlace, IsTheInnermost) {
    Surface two;  // a tetrahedron in another one, the inner one turned inwards
    for (const double size : {8.0, 1.0})
        for (const Vec3d& p : {Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)})
            two.points.push_back(size * (p - 0.25));
    two.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}, {4, 5, 6}, {4, 7, 5}, {4, 6, 7}, {5, 7, 6}};
    SurfaceShells shells;
    ASSERT_TRUE(findSurfaceFaults(two, {}, &shells).empty());
    ASSERT_EQ(shells.shells.size(), 2u);
    EXPECT_EQ(shells.shells[0].parent, -1);
    EXPECT_EQ(shells.shells[1].parent, 0);
    EXPECT_EQ(findShell(two, shells, {-1, -1, -1}).shell, 0);
    EXPECT_EQ(findShell(two, shells, {0, 0, 0}).shell, 1);
    EXPECT_EQ(findShell(two, shells, {9, 0, 0}).shell, -1);
    EXPECT_FALSE(findShell(two, shells, {9, 0, 0}).isOnSurface);
    EXPECT_TRUE(findShell(two, shells, {-0.25, 0, 0}).isOnSurface);
}

}  // namespace
}  // namespace tessera
