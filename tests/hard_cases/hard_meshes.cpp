#include "hard_meshes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/check.h"
#include "reference/random.h"

namespace tessera::hard_cases {

namespace {

using Tet = std::array<std::int32_t, 4>;

std::int32_t addNode(TetMesh& mesh, const Vec3d& p) {
    mesh.points.push_back(p);
    return std::int32_t(mesh.points.size()) - 1;
}

const Vec3d& nodeOf(const TetMesh& mesh, const Tet& tet, std::size_t corner) {
    return mesh.points[std::size_t(tet[corner])];
}

/// A multiple of 1/16 about the middle of the unit box.
Vec3d latticePlace(Random& random) {
    // In this order, whichever compiler: the list of hashes was made so.
    const int z = random.below(3), y = random.below(3), x = random.below(3);
    return Vec3d(7 + x, 7 + y, 7 + z) / 16.0;
}

/// A small good element in the corners (0, 0, 0) and (1, 1, 1).
void addCorners(TetMesh& mesh) {
    for (const double corner : {0.0, 1.0}) {
        const double h = corner == 0 ? 0.0625 : -0.0625;
        const std::int32_t first = addNode(mesh, Vec3d(corner));
        for (const Vec3d& p : {Vec3d(h, 0, 0), Vec3d(0, h, 0), Vec3d(0, 0, h)})
            addNode(mesh, Vec3d(corner) + p);
        mesh.tets.push_back({first, first + 1, first + 2, first + 3});
    }
}

/// Replaces an element by the four that a node inside it makes with its faces.
void insertNode(TetMesh& mesh, std::size_t element, const Vec3d& p) {
    const Tet tet = mesh.tets[element];
    const std::int32_t n = addNode(mesh, p);
    for (std::size_t i = 0; i < 4; ++i) {
        Tet part = tet;
        part[i] = n;
        if (i == 0)
            mesh.tets[element] = part;
        else
            mesh.tets.push_back(part);
    }
}

/// Weights of the place to insert: `aspect` away from a node, an edge's or a face's middle.
std::array<double, 4> closeTo(ThinKind kind, double aspect) {
    switch (kind) {
        case ThinKind::needle:
            return {1 - 3 * aspect, aspect, aspect, aspect};
        case ThinKind::spindle:
            return {0.5 - aspect, 0.5 - aspect, aspect, aspect};
        default:
            return {(1 - aspect) / 3, (1 - aspect) / 3, (1 - aspect) / 3, aspect};
    }
}

/// Two layers of cells, split in five with opposite diagonals on the plane between them. Every second node
/// there is lifted by `height`, so that a sliver lies between the two triangulations of each square.
TetMesh sliversBetweenLayers(int cells, double height) {
    TESSERA_CHECK(cells % 2 == 1, "mirrored diagonals differ for an odd number of cells only");
    const TetMesh lower =
        boxMesh({.cells = {cells, cells, 1}, .sizeWorld = {1, 1, 0.5}, .isFiveSplit = true});
    const int side = cells + 1, layer = side * side;
    TetMesh mesh = lower;
    // Nodes of the upper layer: those of the plane, then the mirrored bottom.
    for (int i = 0; i < layer; ++i) {
        const Vec3d& p = lower.points[std::size_t(i)];
        mesh.points.push_back({p.x, p.y, 1});
    }
    const auto mirrored = [&](std::int32_t node) {
        const int inLayer = node % layer, x = side - 1 - inLayer % side, y = inLayer / side;
        return std::int32_t((node < layer ? 2 * layer : layer) + y * side + x);
    };
    for (const Tet& tet : lower.tets) {
        Tet upper;
        for (std::size_t i = 0; i < 4; ++i) upper[i] = mirrored(tet[i]);
        mesh.tets.push_back(upper);
    }
    // Diagonals of the lower layer join nodes of one parity on the plane; those of the other are lifted.
    const auto isDiagonalBelow = [](int x, int y) { return (x + y + 1) % 2 == 0; };
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) {
            const int node = layer + y * side + x;
            if (!isDiagonalBelow(x, y)) mesh.points[std::size_t(node)].z += height;
            if (x < cells && y < cells) mesh.tets.push_back({node, node + 1, node + side, node + side + 1});
        }
    return mesh;
}

}  // namespace

double tenToMinus(int exponent) {
    double power = 1;
    for (int i = 0; i < exponent; ++i) power *= 10;  // exact to 10^22
    return 1 / power;
}

TetMesh thinAlone(ThinKind kind, double aspect, int count, std::uint64_t seed) {
    TetMesh mesh = thinTetsMesh(kind, aspect, 0.4, count, seed);
    Random random(seed + 2);
    for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
        const auto& tet = mesh.tets[e];
        Vec3d middle(0);
        for (std::size_t i = 0; i <= e % 4; ++i)
            middle += nodeOf(mesh, tet, (i + e / 4) % 4) / double(e % 4 + 1);
        const Vec3d shift = latticePlace(random) - middle;
        for (const std::int32_t n : tet) mesh.points[std::size_t(n)] += shift;
    }
    addCorners(mesh);
    return mesh;
}

TetMesh thinChain(ThinKind kind, double aspect, int count, std::uint64_t seed) {
    TetMesh mesh = thinTetsMesh(kind, aspect, 0.25, 1, seed);
    Random random(seed + 1);
    const Vec3d shift = latticePlace(random) - mesh.points[0];
    for (Vec3d& p : mesh.points) p += shift;
    while (mesh.elementCount() < count) {
        // Of the last few, so that it grows in all directions.
        const int reach = int(std::min<std::int64_t>(mesh.elementCount(), 6));
        Tet tet = mesh.tets[mesh.tets.size() - 1 - std::size_t(random.below(reach))];
        const auto away = std::size_t(random.below(4));
        const Vec3d a = nodeOf(mesh, tet, (away + 1) % 4), b = nodeOf(mesh, tet, (away + 2) % 4),
                    c = nodeOf(mesh, tet, (away + 3) % 4), d = nodeOf(mesh, tet, away);
        const Vec3d normal = cross(b - a, c - a);
        const double square = dot(normal, normal);
        if (!(square > 0)) continue;
        const Vec3d image = d - 2.0 * (dot(d - a, normal) / square) * normal;
        const Vec3d off = glm::abs(image - Vec3d(0.5));
        if (std::max({off.x, off.y, off.z}) > 0.5) continue;  // stay in the box
        tet[away] = addNode(mesh, image);
        mesh.tets.push_back(tet);
    }
    addCorners(mesh);
    return mesh;
}

TetMesh thinInsideGoodMesh(ThinKind kind, double aspect) {
    if (kind == ThinKind::sliver) return sliversBetweenLayers(5, 0.2 * aspect);
    TetMesh mesh = boxMesh({.cells = {4, 4, 4}});
    const std::size_t count = mesh.tets.size();
    for (std::size_t e = 0; e < count; e += 5) {
        const std::array<double, 4> weights = closeTo(kind, aspect);
        const Tet tet = mesh.tets[e];
        Vec3d p(0);
        for (std::size_t i = 0; i < 4; ++i) p += weights[i] * nodeOf(mesh, tet, (i + e) % 4);
        insertNode(mesh, e, p);
    }
    return mesh;
}

TetMesh flatElements(FlatKind kind, int count, std::uint64_t seed) {
    TetMesh mesh;
    Random random(seed);
    // Multiples of 1/16, so that sums are exact and the elements exactly flat.
    const auto place = [&] {
        const int z = random.below(17), y = random.below(17), x = random.below(17);
        return Vec3d(x, y, z) / 16.0;
    };
    while (mesh.elementCount() < count) {
        const Vec3d a = place(), b = place(), c = place();
        const std::int32_t first = addNode(mesh, a);
        Tet tet{first, first, first, first};
        switch (kind) {
            case FlatKind::coplanar:
                tet = {first, addNode(mesh, b), addNode(mesh, c), addNode(mesh, a + (b - a) + (c - a))};
                break;
            case FlatKind::collinear:
                tet = {first, addNode(mesh, b), addNode(mesh, a + 2.0 * (b - a)), addNode(mesh, a - (b - a))};
                break;
            case FlatKind::repeatedNode:
                tet = {first, addNode(mesh, b), addNode(mesh, c), first};
                break;
            case FlatKind::coincidentNodes:
                tet = {first, addNode(mesh, b), addNode(mesh, c), addNode(mesh, a)};
                break;
            case FlatKind::allNodesEqual:
                break;
        }
        mesh.tets.push_back(tet);
    }
    return mesh;
}

TetMesh crowdedVoxel(int count, std::uint64_t seed) {
    TetMesh mesh = boxMesh({.cells = {2, 2, 2}});
    appendMesh(mesh, dustMesh(Vec3d(9, 9, 9) / 16.0, 0.5 / 16, 1e-4, count, seed));
    return mesh;
}

TetMesh shrinkingBoxes() {
    TetMesh mesh;
    double x = 0;
    for (int i = 0; i <= 6; ++i) {
        const double size = tenToMinus(i);
        appendMesh(mesh, boxMesh({.cells = {1, 1, 1}, .originWorld = {x, 0, 0}, .sizeWorld = Vec3d(size)}));
        x += size;
    }
    return mesh;
}

TetMesh boxWithVoid() {
    TetMesh mesh = boxMesh({.cells = {6, 6, 6}, .jitter = 0.2, .seed = 3});
    std::erase_if(mesh.tets, [&](const Tet& tet) {
        Vec3d centroid(0);
        for (std::size_t i = 0; i < 4; ++i) centroid += 0.25 * nodeOf(mesh, tet, i);
        return glm::length(centroid - Vec3d(0.5)) < 0.3;
    });
    return mesh;
}

TetMesh disconnectedParts() {
    TetMesh mesh = boxMesh({.cells = {2, 2, 2}, .sizeWorld = Vec3d(0.25)});
    appendMesh(mesh, boxMesh({.cells = {1, 1, 1}, .originWorld = Vec3d(0.25), .sizeWorld = Vec3d(0.25)}));
    appendMesh(mesh, boxMesh({.cells = {3, 1, 1}, .originWorld = {0.6, 0.1, 0.7}, .sizeWorld = Vec3d(0.3)}));
    appendMesh(mesh, boxMesh({.cells = {1, 1, 2}, .originWorld = {0.1, 0.7, 0.1}, .sizeWorld = Vec3d(0.01)}));
    return mesh;
}

TetMesh oneElement() {
    return {{{0, 0, 0}, {3, 1, 0}, {1, 4, 1}, {1, 1, 4}}, {{0, 1, 2, 3}}, {}};
}

}  // namespace tessera::hard_cases
