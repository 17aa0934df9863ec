#include "mesh/repair.h"

#include <gmpxx.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <sstream>

#include "base/error.h"
#include "mesh/mesh_quality.h"
#include "reference/fields.h"
#include "reference/random.h"
#include "repair_test_meshes.h"

namespace tessera {
namespace {

using test::countFaceUsers;
using test::signOf;

constexpr double kAspects[] = {1e-7, 1e-8, 1e-10, 1e-12};

void addFields(TetMesh& mesh) {
    addPointField(mesh, "linear", {[](const Vec3d& p) { return 3 * p.x - 2 * p.y + p.z; }});
    addPointField(mesh, "wavy", {wavyField, [](const Vec3d& p) { return p.x * p.y; }});
    addRandomField(mesh, "noise", FieldLocation::point, 1, 5, 1, 11);
    addRandomField(mesh, "perCell", FieldLocation::cell, 2, 0, 1, 12);
}

struct Outcome {
    TetMesh mesh;
    RepairReport report;
};

Outcome repaired(const TetMesh& mesh, const RepairOptions& options = {}, int threads = 0) {
    Outcome outcome;
    Execution execution;
    execution.threads = threads;
    outcome.mesh = repair(mesh, options, outcome.report, execution);
    return outcome;
}

std::string describe(const RepairReport& r) {
    std::ostringstream text;
    for (std::size_t c = 1; c < kElementClasses; ++c)
        text << nameOf(ElementClass(c)) << ' ' << r.before.of[c] << '>' << r.after.of[c] << ' ';
    text << "ops " << r.collapses << '/' << r.edgeSplits << '/' << r.edgePairSplits << '/' << r.faceSplits
         << " dropped " << r.dropped << '/' << r.droppedFlat << '/' << r.unmatchedFlat << " kept";
    for (const std::int64_t count : r.kept) text << ' ' << count;
    text << " volume " << r.relativeVolumeChange() << " moved " << r.boundaryDeviationWorld;
    return text.str();
}

/// Sum of |volume| in rational arithmetic.
double exactVolume(const TetMesh& mesh) {
    mpq_class sum;
    for (const auto& tet : mesh.tets) {
        mpq_class m[3][3];
        for (std::size_t i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k)
                m[i][k] = mpq_class(mesh.points[std::size_t(tet[i + 1])][k]) -
                          mpq_class(mesh.points[std::size_t(tet[0])][k]);
        sum += abs(m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                   m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                   m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])) /
               6;
    }
    return sum.get_d();
}

/// What holds after every repair.
void expectSound(const TetMesh& before, const Outcome& outcome, const RepairOptions& options = {}) {
    const TetMesh& mesh = outcome.mesh;
    const RepairReport& report = outcome.report;
    ASSERT_NO_THROW(checkMesh(mesh));
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) {
        if (report.after[ElementClass::flat] == 0)
            ASSERT_EQ(signOf(mesh, e), 1) << "element " << e;
        else
            ASSERT_GE(signOf(mesh, e), 0) << "element " << e;
    }
    std::int64_t kept = 0;
    for (const std::int64_t count : report.kept) kept += count;
    EXPECT_EQ(kept, report.keptElements());
    EXPECT_EQ(report.after.degenerate(), countClasses(mesh, options.limits, {}).degenerate());
    const double volumeBefore = exactVolume(before), volumeAfter = exactVolume(mesh);
    EXPECT_LE(std::fabs(volumeAfter - volumeBefore), (options.maxVolumeLoss + 1e-12) * volumeBefore);
    EXPECT_FALSE(report.rangesGrew());
    ASSERT_EQ(mesh.fields.size(), before.fields.size());
    for (std::size_t f = 0; f < mesh.fields.size(); ++f)
        for (int c = 0; c < mesh.fields[f].components; ++c) {
            const ValueRange was = fieldRange(before.fields[f], c), is = fieldRange(mesh.fields[f], c);
            EXPECT_GE(is.min, was.min);
            EXPECT_LE(is.max, was.max);
        }
}

bool same(const TetMesh& a, const TetMesh& b) {
    if (a.points != b.points || a.tets != b.tets || a.fields.size() != b.fields.size()) return false;
    for (std::size_t f = 0; f < a.fields.size(); ++f)
        if (a.fields[f].values != b.fields[f].values) return false;
    return true;
}

void expectRepeatable(const TetMesh& before, const Outcome& outcome, const RepairOptions& options = {}) {
    // Where the bound on volume stopped a repair, a second one has a bound of its own to spend.
    if (outcome.report.keptElements() == 0) {
        EXPECT_TRUE(same(repaired(outcome.mesh, options).mesh, outcome.mesh)) << "a second repair";
    }
    for (const int threads : {1, 5})
        EXPECT_TRUE(same(repaired(before, options, threads).mesh, outcome.mesh)) << threads << " threads";
}

/// Area of the faces of one element only, by the side of the box that they lie on; -1 for one that doesn't.
std::array<double, 6> sideAreas(const TetMesh& mesh, const Box3d& box, double tolerance) {
    std::array<double, 6> areas{};
    for (const auto& [face, users] : countFaceUsers(mesh)) {
        if (users != 1) continue;
        const Vec3d a = mesh.points[std::size_t(face[0])], b = mesh.points[std::size_t(face[1])],
                    c = mesh.points[std::size_t(face[2])];
        bool found = false;
        for (int side = 0; side < 6 && !found; ++side) {
            const double plane = (side < 3 ? box.min : box.max)[side % 3];
            const auto on = [&](const Vec3d& p) { return std::fabs(p[side % 3] - plane) <= tolerance; };
            if (!on(a) || !on(b) || !on(c)) continue;
            areas[std::size_t(side)] += 0.5 * glm::length(glm::cross(b - a, c - a));
            found = true;
        }
        if (!found) return {-1, -1, -1, -1, -1, -1};
    }
    return areas;
}

/// No hanging nodes, and the surface of a box that was conforming before.
void expectWholeBox(const TetMesh& mesh, const Box3d& box, double tolerance = 0) {
    for (const auto& [face, users] : countFaceUsers(mesh)) EXPECT_LE(users, 2);
    const std::array<double, 6> areas = sideAreas(mesh, box, tolerance);
    const Vec3d size = box.size();
    for (std::size_t side = 0; side < 6; ++side) {
        const double expected = size[int(side + 1) % 3] * size[int(side + 2) % 3];
        EXPECT_NEAR(areas[side], expected, 1e-9 * expected) << "side " << side;
    }
    EXPECT_EQ(measureQuality(mesh, {}).nonConformingFaces, 0);
}

struct InsideCase {
    const char* name;
    TetMesh (*make)(double);
    ElementClass expected;
};
const InsideCase kInside[] = {{"needle", test::needlesInside, ElementClass::needle},
                              {"spindle", test::spindlesInside, ElementClass::spindle},
                              {"sliver", test::sliverLayer, ElementClass::sliver},
                              {"cap", test::capInside, ElementClass::cap}};

TEST(Repair, RemovesEveryClassInsideAGoodMesh) {
    for (const InsideCase& inside : kInside)
        for (const double aspect : kAspects) {
            SCOPED_TRACE(std::string(inside.name) + " " + std::to_string(std::log10(aspect)));
            TetMesh mesh = inside.make(aspect);
            addFields(mesh);
            ASSERT_EQ(test::countInverted(mesh), 0);
            const Outcome outcome = repaired(mesh);
            std::printf("%s %g: %s\n", inside.name, aspect, describe(outcome.report).c_str());
            EXPECT_GT(outcome.report.before[inside.expected], 0);
            EXPECT_EQ(outcome.report.keptElements(), 0);
            EXPECT_EQ(outcome.report.dropped, 0);
            expectSound(mesh, outcome);
            expectWholeBox(outcome.mesh, mesh.boundsWorld());
            EXPECT_NEAR(outcome.report.volumeAfterWorld, outcome.report.volumeBeforeWorld,
                        1e-13 * outcome.report.volumeBeforeWorld);
            expectRepeatable(mesh, outcome);
        }
}

struct GalleryMesh {
    std::string name;
    TetMesh mesh;
};

std::vector<GalleryMesh> gallery() {
    std::vector<GalleryMesh> all;
    const auto add = [&](const std::string& name, TetMesh mesh) { all.push_back({name, std::move(mesh)}); };
    const std::pair<ThinKind, const char*> kinds[] = {{ThinKind::sliver, "slivers"},
                                                      {ThinKind::needle, "needles"},
                                                      {ThinKind::spindle, "spindles"},
                                                      {ThinKind::cap, "caps"}};
    for (int power = 2; power <= 12; power += 2) {
        const double aspect = std::pow(10.0, -power);
        const std::string suffix = " 1e-" + std::to_string(power);
        for (const auto& [kind, name] : kinds) {
            TetMesh thin = thinTetsMesh(kind, aspect, 0.5, 12, 5);
            add(std::string("lone ") + name + suffix, thin);
            appendMesh(thin, test::goodBox(3));
            add(std::string("a box and ") + name + suffix, thin);
        }
        add("cluster of slivers" + suffix, thinClusterMesh(aspect, 1, 60, 7));
        add("cluster of needles" + suffix, thinClusterMesh(aspect, 2, 60, 8));
        add("plate" + suffix, boxMesh({.cells = {4, 4, 1}, .sizeWorld = {1, 1, aspect}}));
        add("needles inside" + suffix, test::needlesInside(aspect));
        add("spindles inside" + suffix, test::spindlesInside(aspect));
        add("slivers inside" + suffix, test::sliverLayer(aspect));
        add("cap inside" + suffix, test::capInside(aspect));
    }
    add("boundary layers 1e-5", boundaryLayerMesh(3, 1e-5));
    add("boundary layers 1e-7", boundaryLayerMesh(3, 1e-7));
    add("boundary layers 1e-9", boundaryLayerMesh(4, 1e-9));
    TetMesh flats = test::goodBox(3);
    addFlatElements(flats);
    add("flat", flats);
    invertEverySecond(flats);
    add("flat and inverted", flats);
    add("flat slivers inside", test::sliverLayer(0));
    add("flat cap inside", test::capInside(0));
    add("flat spindle inside", test::spindlesInside(0));
    add("coincident nodes", test::needlesInside(0));
    TetMesh hanging = hangingNodeMesh(2, 3);
    addFlatElements(hanging);
    add("hanging nodes", hanging);
    add("overlapping", overlappingMesh(60, 31));
    add("dust", dustMesh({0.5, 0.5, 0.5}, 0.02, 1e-2, 500, 41));
    TetMesh onlyFlat;
    onlyFlat.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    onlyFlat.tets = {{0, 1, 2, 3}, {0, 0, 0, 0}, {0, 1, 2, 0}};
    add("nothing but flat", onlyFlat);
    for (GalleryMesh& entry : all) addFields(entry.mesh);
    return all;
}

TEST(Repair, LeavesNothingOfTheGalleryBeyondItsBounds) {
    for (const GalleryMesh& entry : gallery()) {
        SCOPED_TRACE(entry.name);
        const Outcome outcome = repaired(entry.mesh);
        std::printf("%-28s %s\n", entry.name.c_str(), describe(outcome.report).c_str());
        expectSound(entry.mesh, outcome);
        // The bound on volume is what keeps the first; those behind them stay for want of a boundary.
        if (outcome.report.keptElements() > 0) {
            EXPECT_GT(outcome.report.kept[std::size_t(Refusal::volume)], 0);
        }
        expectRepeatable(entry.mesh, outcome);
    }
}

TEST(Repair, LeavesNothingOfTheGalleryWhenVolumeMayGo) {
    RepairOptions options;
    options.maxVolumeLoss = 1;
    for (const GalleryMesh& entry : gallery()) {
        SCOPED_TRACE(entry.name);
        const Outcome outcome = repaired(entry.mesh, options);
        std::printf("%-28s %s\n", entry.name.c_str(), describe(outcome.report).c_str());
        expectSound(entry.mesh, outcome, options);
        EXPECT_EQ(outcome.report.keptElements(), 0);
        expectRepeatable(entry.mesh, outcome, options);
    }
}

TEST(Repair, HoldsForCoarseThresholds) {
    for (const double aspect : {1e-4, 1e-2, 0.05}) {
        RepairOptions options;
        options.limits.minAspect = aspect;
        for (const GalleryMesh& entry : gallery()) {
            SCOPED_TRACE(entry.name + " below " + std::to_string(aspect));
            const Outcome outcome = repaired(entry.mesh, options);
            std::printf("%g %-28s %s\n", aspect, entry.name.c_str(), describe(outcome.report).c_str());
            expectSound(entry.mesh, outcome, options);
        }
    }
}

}  // namespace
}  // namespace tessera
