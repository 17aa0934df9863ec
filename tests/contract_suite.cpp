#include "contract_suite.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <numbers>
#include <numeric>

#include "reference/fields.h"
#include "reference/generators.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TESSERA_IS_SANITIZED 1
#else
#define TESSERA_IS_SANITIZED 0
#endif

namespace tessera::contract {

double scale() {
    static const double value = [] {
        const char* text = std::getenv("TESSERA_CONTRACT_SCALE");
        const double given = text ? std::atof(text) : 0;
        return given > 0 ? given : TESSERA_IS_SANITIZED ? 0.2 : 1.0;
    }();
    return value;
}

int scaledPoints(int points) {
    return std::max(5, int(std::lround(points * std::cbrt(scale()))));
}

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

std::vector<MeshCase> makeMeshCases() {
    return {
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
        {"HangingNodes", [] { return hangingNodeMesh(2, 3); }, 0.125},
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
    cases.push_back({"left handed", {focus, {0, h / 4, 0}, {h / 4, 0, 0}, {0, 0, h / 4}}, about});
    cases.push_back(cutPlane("cut plane", bounds, 2 * points, 0.5, 1.1));
    cases.push_back(cutPlane("cut plane across an axis", bounds, 2 * points, std::numbers::pi / 2, 0));
    return cases;
}

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
    addHoledCopy(mesh, wavy, "holed", 5);
    addElementIdField(mesh, "element");
    const int random = addRandomField(mesh, "cells", FieldLocation::cell, 2, 0.3, 1, 55);
    addHoledCopy(mesh, random, "holed cells", 7);
}

std::vector<int> allFields(const TetMesh& mesh) {
    std::vector<int> fields(mesh.fields.size());
    std::iota(fields.begin(), fields.end(), 0);
    return fields;
}

std::vector<Block> sample(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                          const Lattice& lattice, std::span<const IndexBox> boxes, const Sampling& sampling) {
    std::vector<Block> blocks(boxes.size());
    std::vector<int> calls(boxes.size(), 0);
    std::mutex mutex;
    const auto bound = resampler.bind(mesh, fields, {.target = sampling.target});
    EXPECT_EQ(bound->target(), sampling.target.empty() ? resampler.targets().front() : sampling.target);
    bound->resample(lattice, boxes,
                    [&](std::size_t b, const Block& block) {
                        const std::lock_guard lock(mutex);
                        blocks.at(b) = block;
                        ++calls.at(b);
                    },
                    {.threads = sampling.threads});
    for (const int count : calls) EXPECT_EQ(count, 1) << "every block is given out once";
    return blocks;
}

std::vector<IndexBox> cut(const IndexBox& box, int edge) {
    std::vector<IndexBox> boxes;
    Vec3i p;
    for (p.z = box.min.z; p.z < box.max.z; p.z += edge)
        for (p.y = box.min.y; p.y < box.max.y; p.y += edge)
            for (p.x = box.min.x; p.x < box.max.x; p.x += edge)
                boxes.push_back({p, glm::min(p + edge, box.max)});
    return boxes;
}

std::int64_t differences(const Block& part, const Block& whole) {
    std::int64_t count = 0;
    Vec3i p;
    for (p.z = part.box.min.z; p.z < part.box.max.z; ++p.z)
        for (p.y = part.box.min.y; p.y < part.box.max.y; ++p.y)
            for (p.x = part.box.min.x; p.x < part.box.max.x; ++p.x) {
                bool isSame = part.covered(p) == whole.covered(p);
                for (int c = 0; isSame && part.covered(p) && c < part.channels; ++c) {
                    const float a = part.value(c, p), b = whole.value(c, p);
                    isSame = std::memcmp(&a, &b, sizeof a) == 0;
                }
                count += !isSame;
            }
    return count;
}

namespace {

std::string describe(const LatticeCase& at) {
    const auto text = [](const Vec3d& v) {
        char buffer[100];
        std::snprintf(buffer, sizeof buffer, " (%.17g %.17g %.17g)", v.x, v.y, v.z);
        return std::string(buffer);
    };
    return "lattice: " + at.name + ", origin" + text(at.lattice.originWorld) + ", axes" +
           text(at.lattice.uWorld) + text(at.lattice.vWorld) + text(at.lattice.wWorld) + ", box" +
           text(Vec3d(at.box.min)) + text(Vec3d(at.box.max));
}

}  // namespace

ContractReport expectContract(const Resampler& resampler, const TetMesh& mesh, const LatticeCase& at) {
    const std::vector<int> fields = allFields(mesh);
    const ContractBounds bounds{resampler.spillBoundVoxels(), resampler.placeBoundVoxels()};
    const auto blocks = sample(resampler, mesh, fields, at.lattice, std::span(&at.box, 1), {});
    const Oracle oracle(mesh, at.lattice);
    const ReferenceBlock reference = referenceBlock(oracle, at.box, {.toleranceVoxels = bounds.spillVoxels});
    const ContractReport report = checkContract(blocks[0], reference, oracle, fields, bounds);
    EXPECT_TRUE(report.isClean()) << describe(at) << "\n  " << report.summary();
    return report;
}

namespace {

void expectSame(const std::vector<Block>& parts, const Block& whole, const std::string& what) {
    std::int64_t count = 0;
    for (const Block& part : parts) count += differences(part, whole);
    EXPECT_EQ(count, 0) << "points that differ: " << what;
}

/// The mesh with elements added far from the box that `at` looks at; the fields are 1 there.
TetMesh withCompany(const TetMesh& mesh, const LatticeCase& at) {
    TetMesh larger{mesh.points, mesh.tets, {}};
    const Vec3d corner = at.lattice.worldFromIndex(Vec3d(at.box.max));
    const double size = glm::length(corner - at.lattice.worldFromIndex(Vec3d(at.box.min)));
    const double away = 3 * (size + glm::length(mesh.boundsWorld().size()));
    TetMesh company = boxMesh({.cells = {3, 3, 3}, .jitter = 0.2});
    place(company, {size, corner + away, false});
    appendMesh(larger, company);
    larger.fields = mesh.fields;
    for (Field& field : larger.fields) {
        const std::int64_t items =
            field.location == FieldLocation::point ? larger.nodeCount() : larger.elementCount();
        field.values.resize(std::size_t(items * field.components), 1.0);
    }
    return larger;
}

}  // namespace

void expectDeterministic(const Resampler& resampler, const TetMesh& mesh, const LatticeCase& at) {
    SCOPED_TRACE(describe(at));
    const std::vector<int> fields = allFields(mesh);
    const auto run = [&](std::span<const IndexBox> boxes, const Sampling& sampling) {
        return sample(resampler, mesh, fields, at.lattice, boxes, sampling);
    };
    const std::span one(&at.box, 1);
    const Block whole = run(one, {})[0];
    for (const int threads : {2, 5, 16})
        expectSame(run(one, {{}, threads}), whole, std::to_string(threads) + " threads");
    for (const int edge : {8, 16, 32, 64})
        expectSame(run(cut(at.box, edge), {{}, 3}), whole, "boxes of " + std::to_string(edge));
    for (const std::string& target : resampler.targets())
        expectSame(run(cut(at.box, 19), {target, 2}), whole, "target " + target);

    std::vector<IndexBox> overlapping = cut(at.box, 9);
    for (IndexBox& box : overlapping) box = intersect({box.min - 3, box.max + 2}, at.box);
    expectSame(run(overlapping, {{}, 2}), whole, "overlapping boxes");

    const TetMesh larger = withCompany(mesh, at);
    expectSame(sample(resampler, larger, fields, at.lattice, one, {}), whole, "more elements elsewhere");
}

}  // namespace tessera::contract
