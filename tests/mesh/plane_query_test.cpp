#include "mesh/plane_query.h"

#include <gmpxx.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/sanitizers.h"
#include "mesh/sub_mesh.h"
#include "reference/generators.h"
#include "reference/random.h"

namespace tessera {
namespace {

/// Rationals are slow where memory is watched.
constexpr int kTrials = kIsSanitized ? 12 : 40;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

mpq_class exactDot(const Vec3d& axis, const Vec3d& place, const Vec3d& centre) {
    mpq_class sum = 0;
    for (int k = 0; k < 3; ++k) sum += mpq_class(axis[k]) * (mpq_class(place[k]) - mpq_class(centre[k]));
    return sum;
}

struct Expected {
    std::vector<std::int32_t> meeting;  // by exact arithmetic
    std::vector<std::int32_t> near;     // by exact arithmetic on a plate that is thicker by a hair
};

/// Every element, in rationals: its extent along each of the plate's axes against the plate's.
Expected searchAll(const TetMesh& mesh, const PlanePatch& patch, double hair) {
    Expected expected;
    for (std::int32_t e = 0; e < mesh.elementCount(); ++e) {
        bool meets = true, isNear = true;
        for (int a = 0; a < 3; ++a) {
            if (std::isinf(patch.halfWorld[a])) continue;
            mpq_class low, high;
            for (std::size_t i = 0; i < 4; ++i) {
                const mpq_class d =
                    exactDot(patch.axes[std::size_t(a)],
                             mesh.points[std::size_t(mesh.tets[std::size_t(e)][i])], patch.centreWorld);
                if (i == 0 || d < low) low = d;
                if (i == 0 || d > high) high = d;
            }
            const mpq_class half(patch.halfWorld[a]), wide = half + mpq_class(hair);
            meets = meets && low <= half && high >= -half;
            isNear = isNear && low <= wide && high >= -wide;
        }
        if (meets) expected.meeting.push_back(e);
        if (isNear) expected.near.push_back(e);
    }
    return expected;
}

void expectFound(const TetMesh& mesh, const PlanePatch& patch, double hair, const std::string& what) {
    const PlaneHits hits = PlaneQuery(mesh).find(patch);
    const Expected expected = searchAll(mesh, patch, hair);
    EXPECT_TRUE(std::is_sorted(hits.elements.begin(), hits.elements.end())) << what;
    EXPECT_TRUE(std::includes(hits.elements.begin(), hits.elements.end(), expected.meeting.begin(),
                              expected.meeting.end()))
        << what << ": lost an element; " << hits.elements.size() << " of " << expected.meeting.size();
    EXPECT_TRUE(
        std::includes(expected.near.begin(), expected.near.end(), hits.elements.begin(), hits.elements.end()))
        << what << ": found an element that is nowhere near; " << hits.elements.size() << " of "
        << expected.near.size();
    EXPECT_GE(hits.touched, std::int64_t(hits.elements.size())) << what;
    EXPECT_GE(hits.boxes, hits.touched) << what;
    EXPECT_LE(hits.boxes, mesh.elementCount()) << what;
}

/// Axes of random directions, perpendicular up to rounding.
std::array<Vec3d, 3> randomAxes(Random& random) {
    const Vec3d n = glm::normalize(random.offset());
    const Vec3d u = glm::normalize(glm::cross(n, random.offset()));
    return {u, glm::cross(n, u), n};
}

std::vector<std::pair<std::string, TetMesh>> meshes() {
    std::vector<std::pair<std::string, TetMesh>> all;
    all.emplace_back("box", boxMesh({.cells = Vec3i(5), .jitter = 0.3}));
    all.emplace_back("graded", gradedDelaunayMesh(300, 3, 7));
    all.emplace_back("layers", boundaryLayerMesh(4, 1e-6));
    all.emplace_back("needles", thinTetsMesh(ThinKind::needle, 1e-9, 0.3, 400, 3));
    all.emplace_back("slivers", thinTetsMesh(ThinKind::sliver, 1e-12, 0.3, 400, 4));
    all.emplace_back("one", boxMesh({.cells = Vec3i(1), .isFiveSplit = true}));
    return all;
}

TEST(PlaneQuery, FindsWhatASearchOfAllElementsInRationalsFinds) {
    Random random(11);
    for (const auto& [name, mesh] : meshes())
        for (int trial = 0; trial < kTrials; ++trial) {
            PlanePatch patch;
            patch.axes = randomAxes(random);
            patch.centreWorld = random.place();
            patch.halfWorld = trial % 2 ? Vec3d(kInfinity, kInfinity, 0)
                                        : Vec3d(0.4 * random.unit(), 0.4 * random.unit(), 0);
            if (trial % 3 == 0) patch.halfWorld.z = 0.01 * random.unit();
            expectFound(mesh, patch, 1e-14, name + " " + std::to_string(trial));
        }
}

TEST(PlaneQuery, LosesNoElementWhereThePlaneRunsThroughNodesEdgesAndFaces) {
    Random random(12);
    for (const auto& [name, mesh] : meshes())
        for (int trial = 0; trial < kTrials; ++trial) {
            PlanePatch patch;
            const auto& tet = mesh.tets[std::size_t(random.below(int(mesh.elementCount())))];
            const Vec3d p = mesh.points[std::size_t(tet[0])], q = mesh.points[std::size_t(tet[1])],
                        r = mesh.points[std::size_t(tet[2])];
            const Vec3d face = glm::cross(q - p, r - p);
            if (trial % 3 == 0) patch.axes = randomAxes(random);
            if (trial % 3 == 1 && glm::length(face) > 0) {
                const Vec3d n = glm::normalize(face);
                const Vec3d u = glm::normalize(glm::cross(n, random.offset()));
                patch.axes = {u, glm::cross(n, u), n};
            }
            patch.centreWorld = p;
            patch.halfWorld = {kInfinity, kInfinity, 0};
            expectFound(mesh, patch, 1e-14, name + " " + std::to_string(trial));
        }
}

TEST(PlaneQuery, LosesNoElementFarFromTheOrigin) {
    Random random(13);
    for (const double offset : {1e3, 1e6, 1e9}) {
        TetMesh mesh = boxMesh({.cells = Vec3i(4), .jitter = 0.2});
        place(mesh, {.scale = 1, .offsetWorld = Vec3d(offset, -offset, 0.5 * offset), .isTurned = true});
        const Box3d bounds = PlaneQuery(mesh).boundsWorld();
        for (int trial = 0; trial < kTrials; ++trial) {
            PlanePatch patch;
            patch.axes = randomAxes(random);
            patch.centreWorld = trial % 2 ? bounds.min + random.place() * bounds.size()
                                          : mesh.points[std::size_t(random.below(int(mesh.nodeCount())))];
            patch.halfWorld = trial % 4 ? Vec3d(kInfinity, kInfinity, 0) : Vec3d(0.3, 0.2, 0);
            expectFound(mesh, patch, 1e-14 * offset, std::to_string(trial));
        }
    }
}

TEST(PlaneQuery, FindsBothSidesOfAPlaneThroughNodes) {
    // Four layers of cells; the plane z = 1/2 is the border of the second and the third.
    const TetMesh mesh = boxMesh({.cells = Vec3i(4)});
    PlanePatch patch{{0.5, 0.5, 0.5}, {Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)}, {9, 9, 0}};
    EXPECT_EQ(PlaneQuery(mesh).find(patch).elements.size(), std::size_t(2 * 4 * 4 * 6));
    patch.centreWorld.z = 0.6;  // inside the third layer
    EXPECT_LE(PlaneQuery(mesh).find(patch).elements.size(), std::size_t(4 * 4 * 6));
    patch.centreWorld.z = 1.01;
    EXPECT_TRUE(PlaneQuery(mesh).find(patch).elements.empty());
}

TEST(PlaneQuery, LooksAtASmallShareOfALargeMesh) {
    const TetMesh mesh = boxMesh({.cells = Vec3i(32), .jitter = 0.2});
    PlanePatch patch{{0.5, 0.5, 0.52}, {Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)}, {9, 9, 0}};
    const PlaneQuery query(mesh);
    // One layer of 32 cells, and its neighbours for the jitter.
    EXPECT_LT(query.find(patch).boxes, mesh.elementCount() / 10);
    patch.halfWorld = {0.05, 0.05, 0};
    EXPECT_LT(query.find(patch).boxes, mesh.elementCount() / 200);
}

TEST(PlaneQuery, AnEmptyMeshHasNothingToFind) {
    const PlaneQuery query{TetMesh{}};
    EXPECT_TRUE(query.boundsWorld().empty());
    EXPECT_TRUE(query.find({}).elements.empty());
}

TEST(CutExtent, IsThatOfTheCutAndNotOfTheElements) {
    TetMesh mesh;
    mesh.points = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}};
    mesh.tets = {{0, 1, 2, 3}};
    const PlanePatch patch{{0, 0, 1}, {Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)}, {9, 9, 0}};
    const Box3d extent = cutExtent(mesh, {0}, patch);
    EXPECT_EQ(extent.min, Vec3d(0));
    EXPECT_EQ(extent.max, Vec3d(3, 3, 0));
    PlanePatch beside = patch;
    beside.centreWorld.z = -1;
    EXPECT_TRUE(cutExtent(mesh, {0}, beside).empty());
    // A plane that holds a face sees the whole face.
    PlanePatch onFace = patch;
    onFace.centreWorld.z = 0;
    EXPECT_EQ(cutExtent(mesh, {0}, onFace).max, Vec3d(4, 4, 0));
}

TEST(ExtractElements, KeepsPlacesValuesAndOrder) {
    TetMesh mesh = boxMesh({.cells = Vec3i(3)});
    Field atNodes{"n", FieldLocation::point, 2, {}}, atElements{"e", FieldLocation::cell, 1, {}},
        unused{"u", FieldLocation::point, 1, std::vector<double>(mesh.points.size(), 1.0)};
    for (std::int64_t i = 0; i < mesh.nodeCount(); ++i) {
        atNodes.values.push_back(double(i));
        atNodes.values.push_back(-double(i));
    }
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) atElements.values.push_back(double(e));
    mesh.fields = {unused, atElements, atNodes};
    const std::vector<std::int32_t> elements{2, 3, 50, 161};
    const std::vector<int> fields{2, 1};
    const TetMesh part = extractElements(mesh, elements, fields);
    checkMesh(part);
    ASSERT_EQ(part.elementCount(), 4);
    ASSERT_EQ(part.fields.size(), 2u);
    EXPECT_EQ(part.fields[0].name, "n");
    EXPECT_EQ(part.fields[1].name, "e");
    std::set<std::int32_t> used;
    for (std::size_t e = 0; e < 4; ++e) {
        EXPECT_EQ(part.fields[1].at(std::int64_t(e), 0), double(elements[e]));
        for (std::size_t i = 0; i < 4; ++i) {
            const std::int32_t before = mesh.tets[std::size_t(elements[e])][i], now = part.tets[e][i];
            used.insert(before);
            EXPECT_EQ(part.points[std::size_t(now)], mesh.points[std::size_t(before)]);
            EXPECT_EQ(part.fields[0].at(now, 0), double(before));
            EXPECT_EQ(part.fields[0].at(now, 1), -double(before));
        }
    }
    EXPECT_EQ(part.points.size(), used.size());
    for (std::int64_t i = 1; i < part.nodeCount(); ++i)
        EXPECT_LT(part.fields[0].at(i - 1, 0), part.fields[0].at(i, 0)) << "nodes keep their order";
}

}  // namespace
}  // namespace tessera
