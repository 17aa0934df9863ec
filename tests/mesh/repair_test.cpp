#include "mesh/repair.h"
#include "mesh/field_range.h"

#include <gmpxx.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <sstream>

#include "mesh/flat_elements.h"
#include "mesh/mesh_quality.h"
#include "reference/fields.h"
#include "reference/random.h"
#include "repair_test_meshes.h"
#include "tessera/error.h"

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

std::int64_t countCrowdedFaces(const TetMesh& mesh) {
    const auto users = countFaceUsers(mesh);
    return std::count_if(users.begin(), users.end(), [](const auto& face) { return face.second > 2; });
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
    EXPECT_LE(countCrowdedFaces(mesh), countCrowdedFaces(before));
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
            SCOPED_TRACE(describe(outcome.report));
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

std::vector<GalleryMesh> makeGallery() {
    std::vector<GalleryMesh> all;
    const auto add = [&](const std::string& name, TetMesh mesh) { all.push_back({name, std::move(mesh)}); };
    const std::pair<ThinKind, const char*> kinds[] = {{ThinKind::sliver, "slivers"},
                                                      {ThinKind::needle, "needles"},
                                                      {ThinKind::spindle, "spindles"},
                                                      {ThinKind::cap, "caps"}};
    for (const int power : {3, 6, 8, 12}) {
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

const std::vector<GalleryMesh>& gallery() {
    static const std::vector<GalleryMesh> all = makeGallery();
    return all;
}

TEST(Repair, LeavesNothingOfTheGalleryBeyondItsBounds) {
    for (const GalleryMesh& entry : gallery()) {
        SCOPED_TRACE(entry.name);
        const Outcome outcome = repaired(entry.mesh);
        SCOPED_TRACE(describe(outcome.report));
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
        SCOPED_TRACE(describe(outcome.report));
        expectSound(entry.mesh, outcome, options);
        EXPECT_EQ(outcome.report.keptElements(), 0);
        expectRepeatable(entry.mesh, outcome, options);
    }
}

TEST(Repair, HoldsForCoarseThresholds) {
    RepairOptions options;
    options.limits.minAspect = 1e-2;
    for (const GalleryMesh& entry : gallery()) {
        SCOPED_TRACE(entry.name);
        const Outcome outcome = repaired(entry.mesh, options);
        SCOPED_TRACE(describe(outcome.report));
        expectSound(entry.mesh, outcome, options);
    }
}

/// A node inserted at `share` of the way from a box's corner or edge node to the next along the box's edge.
TetMesh needleOnBoxEdge(bool atCorner, double share) {
    TetMesh mesh = test::goodBox();
    // Nodes of the 4^3 box along its edge y = z = 0 are 0 to 4.
    const std::int32_t from = atCorner ? 0 : 1, to = from + 1;
    const Vec3d a = mesh.points[std::size_t(from)], b = mesh.points[std::size_t(to)];
    test::insertOnEdge(mesh, from, to, a + share * (b - a));
    return mesh;
}

/// The first element with a whole face on the side x = 0, its inner node last.
std::array<std::int32_t, 4> elementAtSide(const TetMesh& mesh) {
    for (auto tet : mesh.tets) {
        std::stable_partition(tet.begin(), tet.end(),
                              [&](std::int32_t n) { return mesh.points[std::size_t(n)].x == 0; });
        if (mesh.points[std::size_t(tet[2])].x == 0 && mesh.points[std::size_t(tet[3])].x > 0) return tet;
    }
    return {};
}

TEST(Repair, KeepsSharpEdgesAndCorners) {
    for (const bool atCorner : {false, true})
        for (const double share : {1e-7, 1e-10, 1 - 1e-9}) {
            SCOPED_TRACE(std::to_string(atCorner) + " " + std::to_string(share));
            TetMesh mesh = needleOnBoxEdge(atCorner, share);
            addFields(mesh);
            const Outcome outcome = repaired(mesh);
            EXPECT_GT(outcome.report.before[ElementClass::needle], 0);
            EXPECT_EQ(outcome.report.keptElements(), 0);
            EXPECT_EQ(outcome.report.dropped, 0);
            EXPECT_LE(outcome.report.boundaryDeviationWorld, 1e-15);
            expectSound(mesh, outcome);
            expectWholeBox(outcome.mesh, mesh.boundsWorld());
            EXPECT_EQ(std::count(outcome.mesh.points.begin(), outcome.mesh.points.end(), Vec3d(0)), 1);
        }
}

TEST(Repair, KeepsAFlatSideWithThinElementsOnIt) {
    for (const double aspect : kAspects)
        for (const int kind : {0, 1, 2}) {
            SCOPED_TRACE(std::to_string(kind) + " " + std::to_string(std::log10(aspect)));
            TetMesh mesh = test::goodBox();
            const auto tet = elementAtSide(mesh);
            const auto at = [&](std::size_t i) { return mesh.points[std::size_t(tet[i])]; };
            if (kind == 0) {  // a needle along an edge in the side
                test::insertOnEdge(mesh, tet[0], tet[1], at(0) + aspect * (at(1) - at(0)));
            } else {
                std::int32_t element = 0;
                while (!std::is_permutation(tet.begin(), tet.end(), mesh.tets[std::size_t(element)].begin()))
                    ++element;
                const Vec3d middle =
                    at(0) + 0.4 * (at(1) - at(0)) + (kind == 1 ? 0.3 : 0.0) * (at(2) - at(0));
                const Vec3d inwards =
                    0.5 * aspect * ((at(3) - middle) + (kind == 1 ? 0.0 : 1.0) * (at(2) - middle));
                test::insertInside(mesh, element, middle + inwards);
            }
            addFields(mesh);
            ASSERT_EQ(test::countInverted(mesh), 0);
            const Outcome outcome = repaired(mesh);
            EXPECT_GT(outcome.report.before.degenerate(), 0);
            EXPECT_EQ(outcome.report.keptElements(), 0);
            EXPECT_EQ(outcome.report.dropped, 0) << "the volume goes to the neighbours";
            expectSound(mesh, outcome);
            expectWholeBox(outcome.mesh, mesh.boundsWorld());
            EXPECT_NEAR(exactVolume(outcome.mesh), 1, 1e-14);
        }
}

TEST(Repair, MovesACurvedBoundaryNoFurtherThanItsBound) {
    TetMesh mesh = sphereMesh(4);
    // A node on the surface, next to another.
    const std::vector<BoundaryFace> faces = boundaryFaces(mesh);
    const auto& face = faces[faces.size() / 2].nodes;
    const Vec3d a = mesh.points[std::size_t(face[0])], b = mesh.points[std::size_t(face[1])];
    test::insertOnEdge(mesh, face[0], face[1], a + 1e-8 * (b - a));
    addFields(mesh);
    const Outcome outcome = repaired(mesh);
    EXPECT_EQ(outcome.report.keptElements(), 0);
    EXPECT_LE(outcome.report.boundaryDeviationWorld, 4e-6 * glm::distance(a, b));
    expectSound(mesh, outcome);
    for (const auto& [key, users] : countFaceUsers(outcome.mesh)) EXPECT_LE(users, 2);
}

TEST(Repair, InterpolatesFieldsLinearly) {
    for (const InsideCase& inside : kInside) {
        SCOPED_TRACE(inside.name);
        TetMesh mesh = inside.make(1e-9);
        const auto linear = [](const Vec3d& p) { return 3 * p.x - 2 * p.y + p.z; };
        addPointField(mesh, "linear", {linear});
        addPointField(mesh, "constant", {[](const Vec3d&) { return 0.1; }});
        addElementIdField(mesh, "element");
        const Outcome outcome = repaired(mesh);
        ASSERT_EQ(outcome.report.keptElements(), 0);
        for (std::int64_t n = 0; n < outcome.mesh.nodeCount(); ++n) {
            EXPECT_NEAR(outcome.mesh.fields[0].at(n, 0), linear(outcome.mesh.points[std::size_t(n)]), 1e-8);
            EXPECT_EQ(outcome.mesh.fields[1].at(n, 0), 0.1);
        }
        // Every new element lies where the one was whose cell value it has, but for the thickness removed.
        for (std::int64_t e = 0; e < outcome.mesh.elementCount(); ++e) {
            const auto source = std::int64_t(outcome.mesh.fields[2].at(e, 0));
            Vec3d centroid{0};
            for (const Vec3d& corner : cornersOf(outcome.mesh, e)) centroid += 0.25 * corner;
            Box3d box;
            for (const Vec3d& corner : cornersOf(mesh, source)) box.include(corner);
            for (int k = 0; k < 3; ++k) {
                EXPECT_GE(centroid[k], box.min[k] - 1e-6);
                EXPECT_LE(centroid[k], box.max[k] + 1e-6);
            }
        }
    }
}

TEST(Repair, KeepsValuesThatAreNotFinite) {
    TetMesh mesh = test::sliverLayer(1e-8);
    Field field{"f", FieldLocation::point, 1, std::vector<double>(mesh.points.size(), 2.0)};
    const auto& sliver = mesh.tets.back();
    field.values[std::size_t(sliver[0])] = std::numeric_limits<double>::quiet_NaN();
    field.values[std::size_t(mesh.tets.front()[0])] = std::numeric_limits<double>::infinity();
    mesh.fields = {field};
    const Outcome outcome = repaired(mesh);
    ASSERT_EQ(outcome.report.keptElements(), 0);
    const auto& values = outcome.mesh.fields[0].values;
    const auto count = [&](auto&& is) { return std::count_if(values.begin(), values.end(), is); };
    EXPECT_GE(count([](double v) { return std::isnan(v); }), 1);
    EXPECT_EQ(count([](double v) { return std::isinf(v); }), 1);
    EXPECT_EQ(count([](double v) { return std::isfinite(v) && v != 2.0; }), 0);
}

TEST(Repair, LeavesASoundMeshAsItIs) {
    TetMesh mesh = test::goodBox();
    addFields(mesh);
    const Outcome outcome = repaired(mesh);
    EXPECT_FALSE(outcome.report.changed());
    EXPECT_TRUE(same(outcome.mesh, mesh));
    EXPECT_EQ(outcome.report.after[ElementClass::good], mesh.elementCount());
}

TEST(Repair, TurnsInvertedElementsAndCountsThem) {
    TetMesh mesh = test::goodBox(2);
    addFields(mesh);
    invertEverySecond(mesh);
    const Outcome outcome = repaired(mesh);
    EXPECT_EQ(outcome.report.inverted, (mesh.elementCount() + 1) / 2);
    EXPECT_EQ(test::countInverted(outcome.mesh), 0);
    EXPECT_EQ(outcome.mesh.points, mesh.points);
    EXPECT_EQ(outcome.mesh.elementCount(), mesh.elementCount());
}

TEST(Repair, HoldsTheBoundOnVolume) {
    TetMesh mesh = test::goodBox(2);
    appendMesh(mesh, thinTetsMesh(ThinKind::cap, 1e-3, 1, 10, 3));
    RepairOptions options;
    options.limits.minAspect = 1e-2;
    const Outcome bounded = repaired(mesh, options);
    EXPECT_GT(bounded.report.kept[std::size_t(Refusal::volume)], 0);
    EXPECT_LE(bounded.report.volumeChangeWorld, 1e-6 * bounded.report.volumeBeforeWorld);
    EXPECT_GT(bounded.report.keptVolumeWorld, 0);
    options.maxVolumeLoss = 0.01;
    const Outcome free = repaired(mesh, options);
    EXPECT_EQ(free.report.keptElements(), 0);
    EXPECT_EQ(free.report.dropped, 10);
    EXPECT_NEAR(free.report.volumeAfterWorld, 1, 1e-13);
}

TEST(Repair, HoldsForSmallLargeAndFarMeshes) {
    const Placement placements[] = {{1e-9, {0, 0, 0}, true},
                                    {1e9, {1e9, -3e9, 2e9}, true},
                                    {1, {1e5, -2e5, 3e5}, false},
                                    {1e-90, {0, 0, 0}, false},
                                    {1e90, {0, 0, 0}, true}};
    for (const InsideCase& inside : kInside)
        for (const Placement& placement : placements) {
            SCOPED_TRACE(std::string(inside.name) + " " + std::to_string(std::log10(placement.scale)));
            TetMesh mesh = inside.make(1e-8);
            place(mesh, placement);
            for (std::int64_t e = 0; e < mesh.elementCount(); ++e)
                if (signOf(mesh, e) < 0)
                    std::swap(mesh.tets[std::size_t(e)][2], mesh.tets[std::size_t(e)][3]);
            addRandomField(mesh, "noise", FieldLocation::point, 1, 5, 1, 11);
            const Outcome outcome = repaired(mesh);
            EXPECT_GT(outcome.report.before.degenerate(), 0);
            EXPECT_EQ(outcome.report.keptElements(), 0);
            expectSound(mesh, outcome);
            for (const auto& [face, users] : countFaceUsers(outcome.mesh)) EXPECT_LE(users, 2);
        }
}

TEST(Repair, RefusesOptionsOutOfRange) {
    RepairReport report;
    for (const double aspect : {0.0, -1.0, 0.6, std::nan("")}) {
        RepairOptions options;
        options.limits.minAspect = aspect;
        EXPECT_THROW(repair(test::goodBox(1), options, report, {}), InputError);
    }
    RepairOptions options;
    options.maxVolumeLoss = 1.5;
    EXPECT_THROW(repair(test::goodBox(1), options, report, {}), InputError);
    options = {};
    options.limits.maxDihedralDegrees = 180;
    EXPECT_THROW(repair(test::goodBox(1), options, report, {}), InputError);
}

/// The mesh with a change done to it.
TetMesh changed(const TetMesh& mesh, const Change& change) {
    TetMesh result;
    result.points = mesh.points;
    if (change.hasNewNode) result.points.push_back(change.newNode.pointWorld);
    for (std::int32_t e = 0; e < mesh.elementCount(); ++e)
        if (!std::binary_search(change.removed.begin(), change.removed.end(), e))
            result.tets.push_back(mesh.tets[std::size_t(e)]);
    for (const Change::Added& added : change.added) result.tets.push_back(added.tet);
    return result;
}

struct Tally {
    int allowed = 0;
    std::array<int, kRefusals> refused{};
};

/// Judges every merge of every element on its own, and does those that are allowed to see what they do.
Tally judgeAll(const TetMesh& mesh, const ChangeLimits& limits) {
    const TetComplex complex(mesh);
    ChangeJudge judge(complex);
    const double volume = exactVolume(mesh);
    Tally tally;
    for (std::int32_t e = 0; e < mesh.elementCount(); ++e)
        for (const Merge& merge : allMerges(complex.tet(e), cornersOf(mesh, e))) {
            const Change change = changeOf(complex, merge);
            const Verdict verdict = judge.judge(change, limits);
            if (!verdict.allowed) {
                ++tally.refused[std::size_t(verdict.refusal)];
                continue;
            }
            ++tally.allowed;
            const TetMesh result = changed(mesh, change);
            std::int64_t notPositive = 0;
            for (std::int64_t r = 0; r < result.elementCount(); ++r) notPositive += signOf(result, r) <= 0;
            EXPECT_EQ(notPositive, 0);
            EXPECT_EQ(countCrowdedFaces(result), 0);
            EXPECT_NEAR(exactVolume(result), volume, 1e-12 * volume);
        }
    return tally;
}

TEST(ChangeJudge, AllowsOnlyWhatKeepsTheMeshSound) {
    TetMesh mesh = gradedDelaunayMesh(60, 1, 5);
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e)
        if (signOf(mesh, e) < 0) std::swap(mesh.tets[std::size_t(e)][2], mesh.tets[std::size_t(e)][3]);
    const Tally tally = judgeAll(mesh, {0.03, 1e-9, std::numeric_limits<double>::infinity()});
    EXPECT_GT(tally.allowed, 10);
    EXPECT_GT(tally.refused[std::size_t(Refusal::inversion)], 10);
    EXPECT_GT(tally.refused[std::size_t(Refusal::boundary)], 10);
    EXPECT_GT(tally.refused[std::size_t(Refusal::quality)], 10);
}

TEST(ChangeJudge, RefusesAFaceThatGetsAnotherNeighbour) {
    TetMesh mesh;
    // Nodes u, v, x, y, z, w. Once u is v, the face v x y would have an element on each side.
    mesh.points = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0.1}, {0, 1, 0.1}, {1, 1, 2}, {1, 1, -2}};
    mesh.tets = {{0, 2, 3, 4}, {1, 3, 2, 5}, {0, 1, 5, 4}};
    for (std::int64_t e = 0; e < 3; ++e)
        if (signOf(mesh, e) < 0) std::swap(mesh.tets[std::size_t(e)][2], mesh.tets[std::size_t(e)][3]);
    const TetComplex complex(mesh);
    const Merge merge{{{0}, 1}, {{1}, 1}, 1, {}, 2};
    const Change change = changeOf(complex, merge);
    ASSERT_EQ(change.removed.size(), 2u);
    ASSERT_EQ(signOf(changed(mesh, change), 1), 1);
    constexpr double kAny = std::numeric_limits<double>::infinity();
    const ChangeLimits limits{0.9, kAny, kAny};
    const Verdict verdict = ChangeJudge(complex).judge(change, limits);
    EXPECT_FALSE(verdict.allowed);
    EXPECT_EQ(verdict.refusal, Refusal::conformity);
}

/// Inner faces that both elements see from the same side.
int countFoldedFaces(const TetComplex& complex) {
    constexpr std::size_t kFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    std::map<std::array<std::int32_t, 3>, std::pair<int, int>> sides;
    for (std::int32_t e = 0; e < complex.elementCount(); ++e)
        for (const auto& f : kFaces) {
            const Tet& tet = complex.tet(e);
            std::array<std::int32_t, 3> face{tet[f[0]], tet[f[1]], tet[f[2]]};
            int swaps = 0;
            for (const std::size_t i : {0u, 1u, 0u})
                if (face[i] > face[i + 1]) std::swap(face[i], face[i + 1]), ++swaps;
            (swaps % 2 == 0 ? sides[face].first : sides[face].second) += 1;
        }
    int folded = 0;
    for (const auto& [face, count] : sides) folded += count.first + count.second == 2 && count.first != 1;
    return folded;
}

TEST(FlatElements, ContinueTheOrientationOfTheirNeighbours) {
    TetMesh mesh = test::sliverLayer(0);
    std::vector<std::int32_t> flat;
    for (std::int32_t e = 0; e < mesh.elementCount(); ++e)
        if (signOf(mesh, e) == 0) {
            flat.push_back(e);
            if (e % 3 == 0) std::swap(mesh.tets[std::size_t(e)][0], mesh.tets[std::size_t(e)][1]);
        }
    ASSERT_EQ(flat.size(), 16u);
    TetComplex complex(mesh);
    EXPECT_GT(countFoldedFaces(complex), 0);
    orientFlatElements(complex, flat);
    EXPECT_EQ(countFoldedFaces(complex), 0);
    // Between the two boxes they hold faces of both sides together.
    for (const std::int32_t e : flat) EXPECT_FALSE(isLooseFlatElement(complex, e));
}

TEST(FlatElements, AreLooseWhereOnlyOneSideIsShared) {
    TetMesh mesh = boxMesh({.cells = {1, 1, 1}, .isFiveSplit = true});
    const auto upper = std::int32_t(4);  // nodes 4 to 7 are the side z = 1
    mesh.tets.push_back({upper, upper + 1, upper + 2, upper + 3});
    const std::int32_t flat = std::int32_t(mesh.elementCount()) - 1;
    EXPECT_TRUE(isLooseFlatElement(TetComplex(mesh), flat));
}

TEST(ElementClass, IsThatOfTheShape) {
    const double h = 1e-7;
    const std::pair<Corners, ElementClass> cases[] = {
        {{Vec3d(1, 1, 1), Vec3d(-1, -1, 1), Vec3d(-1, 1, -1), Vec3d(1, -1, -1)}, ElementClass::good},
        {{Vec3d(0, 0, 0), Vec3d(h, 0, 0), Vec3d(0, 1, 0), Vec3d(0.3, 0.2, 1)}, ElementClass::needle},
        {{Vec3d(h, 0, -1), Vec3d(-h, 0, -1), Vec3d(0, h, 1), Vec3d(0, -h, 1)}, ElementClass::needle},
        {{Vec3d(-1, 0, 0), Vec3d(1, 0, 0), Vec3d(0, h, h), Vec3d(0, 1, 0)}, ElementClass::spindle},
        {{Vec3d(1, 0, h), Vec3d(0, 1, 0), Vec3d(-1, 0, h), Vec3d(0, -1, 0)}, ElementClass::sliver},
        {{Vec3d(1, 0, 0), Vec3d(-1, 1, 0), Vec3d(-1, -1, 0), Vec3d(0, 0, h)}, ElementClass::cap},
        {{Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(-1, 0, 0), Vec3d(0, -1, 0)}, ElementClass::flat},
        {{Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(2, 0, 0), Vec3d(3, 0, 0)}, ElementClass::flat},
        {{Vec3d(1, 2, 3), Vec3d(1, 2, 3), Vec3d(1, 2, 3), Vec3d(1, 2, 3)}, ElementClass::flat},
        {{Vec3d(0, 0, 0), Vec3d(0, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)}, ElementClass::flat}};
    for (const auto& [corners, expected] : cases)
        for (const double scale : {1.0, 0x1p-500, 0x1p+500, 0x1p+1020}) {
            std::array<std::size_t, 4> order{0, 1, 2, 3};
            do {
                Corners c;
                for (std::size_t i = 0; i < 4; ++i) c[i] = scale * corners[order[i]];
                EXPECT_STREQ(nameOf(classOf(c, {})), nameOf(expected)) << "scale " << scale;
            } while (std::next_permutation(order.begin(), order.end()));
        }
}

TEST(ElementClass, FindsTheAspectRatio) {
    const Corners regular{Vec3d(1, 1, 1), Vec3d(-1, -1, 1), Vec3d(-1, 1, -1), Vec3d(1, -1, -1)};
    EXPECT_NEAR(aspectOf(regular), std::sqrt(2.0 / 3), 1e-15);
    const Corners corner{Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1e-5)};
    EXPECT_NEAR(aspectOf(corner), 1e-5 / std::sqrt(2.0), 1e-15);
    EXPECT_EQ(aspectOf({}), 0);
}

TEST(ElementClass, NamesThePartsThatAreClose) {
    const Corners sliver{Vec3d(1, 0, 1e-7), Vec3d(0, 1, 0), Vec3d(-1, 0, 1e-7), Vec3d(0, -1, 0)};
    EXPECT_EQ(thinShapeOf(sliver, {}).order, (std::array<std::uint8_t, 4>{0, 2, 1, 3}));
    const Corners cap{Vec3d(1, 0, 0), Vec3d(-1, 1, 0), Vec3d(0, 0, 1e-7), Vec3d(-1, -1, 0)};
    EXPECT_EQ(thinShapeOf(cap, {}).order[0], 2);
    const Corners spindle{Vec3d(-1, 0, 0), Vec3d(0, 1, 0), Vec3d(1, 0, 0), Vec3d(0, 1e-7, 1e-7)};
    EXPECT_EQ(thinShapeOf(spindle, {}).order, (std::array<std::uint8_t, 4>{1, 3, 0, 2}));
    const Corners needle{Vec3d(0, 0, 0), Vec3d(0, 1, 0), Vec3d(0.3, 0.2, 1), Vec3d(1e-7, 0, 0)};
    EXPECT_EQ(thinShapeOf(needle, {}).order, (std::array<std::uint8_t, 4>{0, 3, 1, 2}));
}

}  // namespace
}  // namespace tessera
