#include "contract_cases.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <utility>

#include "contract_suite.h"
#include "reference/fields.h"
#include "reference/generators.h"
#include "reference/random.h"

namespace tessera::contract {

namespace {

TetMesh turnedMesh(TetMesh mesh, double size, const Vec3d& offset) {
    place(mesh, {size, offset, true});
    return mesh;
}

TetMesh flatAndInverted() {
    TetMesh mesh = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
    addFlatElements(mesh);
    invertEverySecond(mesh);
    return mesh;
}

TetMesh loneThinTets(double aspect) {
    TetMesh mesh;
    std::uint64_t seed = 100;
    for (const ThinKind kind : {ThinKind::sliver, ThinKind::needle, ThinKind::spindle, ThinKind::cap})
        appendMesh(mesh, thinTetsMesh(kind, aspect, 1.2, 60, ++seed));
    return mesh;
}

/// Flat by construction along lattice planes: thin tets whose long sides lie exactly on lattice lines.
TetMesh alignedThinTets() {
    TetMesh mesh;
    for (int i = 0; i < 24; ++i) {
        const double thin = std::pow(10.0, -1 - i / 2), y = 0.25 * (i % 12), z = 0.25 * (i / 12);
        const auto n = std::int32_t(mesh.points.size());
        if (i % 2 == 0)
            mesh.points.insert(mesh.points.end(), {{0, y, z}, {3, y, z}, {0, y + thin, z}, {0, y, z + thin}});
        else
            mesh.points.insert(mesh.points.end(),
                               {{0, y, z}, {3, y + thin, z}, {1, y, z + 0.25}, {2, y - thin, z - 0.25}});
        mesh.tets.push_back({n, n + 1, n + 2, n + 3});
    }
    return mesh;
}

/// Two layers of cells on one of larger cells, so that nodes hang on faces and edges, and stick out sideways.
TetMesh stackedBoxes() {
    TetMesh mesh = boxMesh({.cells = {1, 1, 1}, .sizeWorld = {1, 1, 0.5}});
    appendMesh(mesh, boxMesh({.cells = {2, 4, 1},
                              .originWorld = {0, 0.25, 0.5},
                              .sizeWorld = {0.5, 1, 0.125},
                              .isFiveSplit = true}));
    appendMesh(mesh,
               boxMesh({.cells = {3, 3, 3}, .originWorld = {0.5, 0.25, 0.5}, .sizeWorld = Vec3d(0.375)}));
    return mesh;
}

/// One box of six elements; 216 elements of a two-thousandth of its size on one side; a lone tet three times
/// as long and very thin above.
TetMesh sizesFarApart() {
    TetMesh mesh = boxMesh({.cells = {1, 1, 1}});
    appendMesh(
        mesh,
        boxMesh(
            {.cells = {6, 6, 6}, .originWorld = {1, 0.3, 0.4}, .sizeWorld = Vec3d(0.003), .jitter = 0.2}));
    const auto n = std::int32_t(mesh.points.size());
    mesh.points.insert(mesh.points.end(),
                       {{-1, 0.5, 1.5}, {2, 0.5, 1.5}, {0.5, 0.5005, 1.5}, {0.5, 0.5, 1.5005}});
    mesh.tets.push_back({n, n + 1, n + 2, n + 3});
    return mesh;
}

TetMesh plate(double thickness) {
    return boxMesh({.cells = {6, 5, 1}, .sizeWorld = {1, 1, thickness}});
}

std::vector<MeshCase> meshesThatDoNotConform() {
    return {
        {"HangingNodes", [] { return hangingNodeMesh(2, 3); }, 0.125},
        {"HangingNodesOnLatticePoints", [] { return hangingNodeMesh(1, 4); }, 0.125},
        {"HangingNodesBetweenLatticePoints", [] { return hangingNodeMesh(2, 4); }, 1.0 / 12},
        {"TurnedHangingNodes",
         [] {
             return turnedMesh(hangingNodeMesh(2, 5), 1, {3, -4, 5});
         },
         0},
        {"StackedBoxes", stackedBoxes, 0.0625},
        {"TurnedStackedBoxes",
         [] {
             return turnedMesh(stackedBoxes(), 1e-3, {0, 0, 0});
         },
         0},
        {"ElementsOfSizesFarApart", sizesFarApart, 0.0625},
    };
}

std::vector<MeshCase> plates() {
    return {
        {"PlateOfOneCell", [] { return plate(0x1p-5); }, 0x1p-5},
        {"TurnedPlateOfOneCell",
         [] {
             return turnedMesh(plate(0x1p-5), 1, {0, 0, 0});
         },
         0},
        {"PlateFarThinnerThanAVoxel", [] { return plate(1e-4); }, 0.0625},
        {"TurnedPlateFarThinnerThanAVoxel",
         [] {
             return turnedMesh(plate(1e-5), 1, {0, 0, 0});
         },
         0},
    };
}

std::vector<MeshCase> makeMeshCases() {
    std::vector<MeshCase> cases{
        {"BoxOfKuhnTets",
         [] {
             return boxMesh({.cells = {4, 3, 2}, .sizeWorld = {4, 3, 2}});
         },
         0.25},
        {"BoxOfFiveTetsACell",
         [] {
             return boxMesh({.cells = {3, 3, 3}, .sizeWorld = {3, 3, 3}, .isFiveSplit = true});
         },
         0.25},
        {"JitteredBox",
         [] {
             return boxMesh({.cells = {6, 6, 6}, .jitter = 0.25, .seed = 7});
         },
         0},
        {"TurnedJitteredBox",
         [] {
             return turnedMesh(boxMesh({.cells = {5, 5, 5}, .jitter = 0.25}), 3e-7, {1e-6, 0, -2e-6});
         },
         0},
        {"BoxOfThirds",
         [] {
             return boxMesh({.cells = {3, 3, 3}, .originWorld = {0.1, 0.2, 0.3}});
         },
         1.0 / 12},
        {"BoxFarFromTheOrigin",
         [] {
             return boxMesh({.cells = {3, 3, 3}, .originWorld = {1e6, -2e6, 3e6}, .jitter = 0.2});
         },
         0},
        {"Sphere", [] { return sphereMesh(6); }, 0},
        {"GradedBox", [] { return gradedBoxMesh(12, 3, 0.2, 3); }, 0},
        {"GradedDelaunay", [] { return gradedDelaunayMesh(500, 2.2, 5); }, 0},
        {"BoundaryLayers", [] { return boundaryLayerMesh(3, 1e-5); }, 0.125},
        {"TurnedBoundaryLayers",
         [] {
             return turnedMesh(boundaryLayerMesh(3, 1e-6), 1, {0, 0, 0});
         },
         0},
        {"ThinTetsOfAspect1e2", [] { return loneThinTets(1e-2); }, 0},
        {"ThinTetsOfAspect1e4", [] { return loneThinTets(1e-4); }, 0},
        {"ThinTetsOfAspect1e6", [] { return loneThinTets(1e-6); }, 0},
        {"ThinTetsOfAspect1e8", [] { return loneThinTets(1e-8); }, 0},
        {"ThinTetsOfAspect1e12", [] { return loneThinTets(1e-12); }, 0},
        {"ThinTetsOnLatticeLines", alignedThinTets, 0.25},
        {"SliverClusterOfAspect1e3", [] { return thinClusterMesh(1e-3, 1, 100, 11); }, 0},
        {"SliverClusterOfAspect1e8", [] { return thinClusterMesh(1e-8, 1, 100, 12); }, 0},
        {"NeedleClusterOfAspect1e4", [] { return thinClusterMesh(1e-4, 2, 100, 13); }, 0},
        {"NeedleClusterOfAspect1e10", [] { return thinClusterMesh(1e-10, 2, 100, 14); }, 0},
        {"TetsWithIntegerNodes", [] { return integerTetsMesh(5, 12, 21); }, 1},
        {"OverlappingTets", [] { return overlappingMesh(60, 31); }, 0},
        {"FlatAndInvertedElements", flatAndInverted, 1.0 / 12},
        {"ManyElementsInOneVoxel",
         [] {
             return dustMesh({0.5, 0.5, 0.5}, 0.02, 1e-2, 4000, 41);
         },
         0},
    };
    for (const auto& more : {meshesThatDoNotConform(), plates()})
        cases.insert(cases.end(), more.begin(), more.end());
    for (MeshCase& meshCase : cases) meshCase.make = madeOnce(std::move(meshCase.make));
    return cases;
}

Lattice cubic(const Vec3d& origin, double spacing) {
    return Lattice::axisParallel(origin, spacing);
}

/// Lattice points over the bounds and `margin` points more on each side.
IndexBox over(const Box3d& bounds, const Lattice& lattice, int margin) {
    IndexBox box;
    const double steps[3] = {lattice.uWorld.x, lattice.vWorld.y, lattice.wWorld.z};
    for (int a = 0; a < 3; ++a) {
        box.min[a] = int(std::floor((bounds.min[a] - lattice.originWorld[a]) / steps[a])) - margin;
        box.max[a] = int(std::ceil((bounds.max[a] - lattice.originWorld[a]) / steps[a])) + margin + 1;
    }
    return box;
}

/// Where the fine lattices look: the node of the smallest element that has a volume to speak of.
Vec3d focusOf(const TetMesh& mesh) {
    const auto& tet = mesh.tets[mesh.tets.size() / 2];
    return mesh.points[std::size_t(tet[1])];
}

/// Long enough that one element may span more than a tile of any kind.
constexpr int kRowPoints = 680;

LatticeCase cutPlane(const std::string& name, const Box3d& bounds, int points, double aboutX, double aboutZ) {
    const Vec3d centre = 0.5 * (bounds.min + bounds.max);
    const double spacing = glm::length(bounds.size()) / points;
    const double cx = std::cos(aboutX), sx = std::sin(aboutX), cz = std::cos(aboutZ), sz = std::sin(aboutZ);
    const Vec3d u{cz, sz, 0}, v{-sz * cx, cz * cx, sx}, w{sz * sx, -cz * sx, cx};
    const int half = points / 2 + 1;
    return {
        name, {centre, spacing * u, spacing * v, spacing * w}, {{-half, -half, 0}, {half + 1, half + 1, 1}}};
}

}  // namespace

std::function<TetMesh()> madeOnce(std::function<TetMesh()> make) {
    return [make = std::move(make), made = std::make_shared<std::optional<TetMesh>>()] {
        if (!*made) *made = make();
        return **made;
    };
}

const std::vector<MeshCase>& meshCases() {
    static const std::vector<MeshCase> cases = makeMeshCases();
    return cases;
}

std::vector<LatticeCase> latticesAbout(const TetMesh& mesh, double alignedSpacing, int pointsAlong) {
    const Box3d bounds = mesh.boundsWorld();
    const Vec3d size = bounds.size();
    const double longest = std::max({size.x, size.y, size.z});
    const int points = scaledPoints(pointsAlong);
    const double h = longest / (points - 1);
    if (alignedSpacing == 0) alignedSpacing = longest / 16;

    std::vector<LatticeCase> cases;
    const auto add = [&](const std::string& name, const Lattice& lattice, int margin) {
        cases.push_back({name, lattice, over(bounds, lattice, margin)});
    };
    add("aligned", cubic(bounds.min, alignedSpacing), 2);
    add("aligned with the upper bounds", cubic(bounds.max, alignedSpacing), 2);
    add("half offset", cubic(bounds.min - 0.5 * alignedSpacing, alignedSpacing), 2);
    add("third offset", cubic(bounds.min - Vec3d(h / 3, h / 7, 2 * h / 3), h), 1);
    add("coarse", cubic(bounds.min + 0.3 * longest * Vec3d(0.1, 0.2, 0.3), longest * 0.45), 1);
    const Lattice unequal{bounds.min, {h * 1.5, 0, 0}, {0, h * 3, 0}, {0, 0, h * 0.75}};
    add("anisotropic", unequal, 1);

    const int window = scaledPoints(12);
    const IndexBox about{Vec3i(-window / 2), Vec3i(window / 2)};
    const Vec3d focus = focusOf(mesh);
    cases.push_back({"fine", cubic(focus, longest * 0x1p-9), about});
    cases.push_back({"finest", cubic(focus, longest * 0x1p-18), about});
    // The same places as the fine lattice has, from an origin far away.
    const double fine = longest * 0x1p-9;
    const Vec3i far = Vec3i(glm::round((focus - bounds.min) / fine)) + 100000;
    cases.push_back(
        {"far origin", cubic(bounds.min - fine * 100000.0, fine), {far + about.min, far + about.max}});
    // Blocks and tiles end at powers of two.
    const Vec3i powers{512, -512, 2048};
    cases.push_back({"indices about powers of two",
                     cubic(focus - h * Vec3d(powers), h),
                     {powers + about.min, powers + about.max}});
    for (int a = 0; a < 3; ++a) {
        IndexBox row{Vec3i(-1), Vec3i(2)};
        row.min[a] = -kRowPoints / 2, row.max[a] = kRowPoints / 2;
        const std::string names[] = {"row along x", "row along y", "row along z"};
        cases.push_back({names[a], cubic(focus, longest / kRowPoints), row});
    }
    cases.push_back({"left handed", {focus, {0, h / 4, 0}, {h / 4, 0, 0}, {0, 0, h / 4}}, about});
    cases.push_back(cutPlane("cut plane", bounds, 2 * points, 0.5, 1.1));
    cases.push_back(cutPlane("cut plane across an axis", bounds, 2 * points, std::numbers::pi / 2, 0));
    return cases;
}

LatticeCase latticeOver(const TetMesh& mesh, int points) {
    const Box3d bounds = mesh.boundsWorld();
    const Vec3d size = bounds.size();
    const Lattice lattice = cubic(bounds.min, std::max({size.x, size.y, size.z}) / (points - 1));
    return {std::to_string(points) + " points", lattice, over(bounds, lattice, 1)};
}

namespace {

/// A node's values may be 30 powers of ten from the next one's.
void addFieldOfManySizes(TetMesh& mesh) {
    Random random(56);
    Field field{"many sizes", FieldLocation::point, 1, {}};
    for (std::int64_t i = 0; i < mesh.nodeCount(); ++i) {
        const double size = std::pow(10.0, 15 * random.centred());
        field.values.push_back(std::copysign(size, random.centred()));
    }
    mesh.fields.push_back(std::move(field));
}

/// Numbers that a double holds and a float doesn't are not finite.
void addFieldBeyondFloat(TetMesh& mesh, const Field& like) {
    Field field = like;
    field.name = "beyond float";
    for (std::size_t i = 2; i < field.values.size(); i += 7) field.values[i] = i % 2 == 0 ? 1e300 : -1e39;
    mesh.fields.push_back(std::move(field));
}

}  // namespace

void addTestFields(TetMesh& mesh) {
    const Vec3d origin = mesh.points.empty() ? Vec3d(0) : mesh.points[0];
    const int wavy = addPointField(mesh, "wavy", {[&](const Vec3d& p) { return wavyField(p - origin); }});
    addPointField(mesh, "linear",
                  {[&](const Vec3d& p) { return p.x - origin.x; },
                   [&](const Vec3d& p) { return 3 * p.y - 2 * p.z + 1; }});
    addPointField(mesh, "constant", {[](const Vec3d&) { return 0.1; }});
    addRandomField(mesh, "pressure", FieldLocation::point, 1, 101325, 1, 51);
    addRandomField(mesh, "huge", FieldLocation::point, 1, 0, 1e30, 52);
    addRandomField(mesh, "tiny", FieldLocation::point, 1, 0, 1e-30, 53);
    addRandomField(mesh, "denormal", FieldLocation::point, 1, 0, 1e-41, 54);
    addRandomField(mesh, "far below float", FieldLocation::point, 1, 0, 1e-310, 57);
    addHoledCopy(mesh, wavy, "holed", 5);
    addFieldOfManySizes(mesh);
    addFieldBeyondFloat(mesh, mesh.fields[std::size_t(wavy)]);
    addElementIdField(mesh, "element");
    const int random = addRandomField(mesh, "cells", FieldLocation::cell, 2, 0.3, 1, 55);
    addHoledCopy(mesh, random, "holed cells", 7);
}

}  // namespace tessera::contract
