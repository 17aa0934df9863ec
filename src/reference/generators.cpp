#include "reference/generators.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "base/check.h"
#include "mesh/geometry.h"
#include "reference/delaunay.h"
#include "reference/random.h"

namespace tessera {

namespace {

using Tet = std::array<std::int32_t, 4>;

/// Nodes of a grid of cells, x fastest.
struct NodeGrid {
    Vec3i cells;
    int node(const Vec3i& p) const { return (p.z * (cells.y + 1) + p.y) * (cells.x + 1) + p.x; }
};

/// Kuhn's six tets: one for every order in which a path from corner 0 to corner 7 takes the axes.
void splitInSix(const NodeGrid& grid, const Vec3i& cell, std::vector<Tet>& tets) {
    static constexpr int kOrders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    for (int o = 0; o < 6; ++o) {
        Vec3i p = cell;
        Tet tet{grid.node(p)};
        for (int step = 0; step < 3; ++step) {
            ++p[kOrders[o][step]];
            tet[std::size_t(step) + 1] = grid.node(p);
        }
        if (o >= 3) std::swap(tet[2], tet[3]);
        tets.push_back(tet);
    }
}

void splitInFive(const NodeGrid& grid, const Vec3i& cell, std::vector<Tet>& tets) {
    const int flip = (cell.x + cell.y + cell.z) & 1;
    const auto corner = [&](int i) {
        const int x = (i & 1) ^ flip;
        return grid.node(cell + Vec3i(x, (i >> 1) & 1, i >> 2));
    };
    static constexpr int kCorners[5][4] = {
        {0, 3, 5, 6}, {1, 0, 3, 5}, {2, 0, 6, 3}, {4, 0, 5, 6}, {7, 3, 6, 5}};
    for (const auto& c : kCorners) tets.push_back({corner(c[0]), corner(c[1]), corner(c[2]), corner(c[3])});
}

/// Positive orientation, where the volume isn't zero.
void orient(TetMesh& mesh) {
    for (Tet& t : mesh.tets) {
        const auto at = [&](std::size_t i) -> const Vec3d& { return mesh.points[std::size_t(t[i])]; };
        if (volumeSign(at(0), at(1), at(2), at(3)) < 0) std::swap(t[2], t[3]);
    }
}

/// Turns about z, then x, by angles that are given as the tangents of their halves: sines and cosines are
/// then quotients, the same bit for bit with every mathematics library.
Vec3d turned(const Vec3d& p, double halfTangentZ, double halfTangentX) {
    const double z = halfTangentZ * halfTangentZ, x = halfTangentX * halfTangentX;
    const double cz = (1 - z) / (1 + z), sz = 2 * halfTangentZ / (1 + z);
    const double cx = (1 - x) / (1 + x), sx = 2 * halfTangentX / (1 + x);
    const Vec3d q{cz * p.x - sz * p.y, sz * p.x + cz * p.y, p.z};
    return {q.x, cx * q.y - sx * q.z, sx * q.y + cx * q.z};
}

/// The tangent of half an angle from -143 to 143 degrees.
double randomHalfTangent(Random& random) {
    return 3 * random.centred();
}

double graded(double u, double power) {
    const double t = 2 * u - 1;
    return 0.5 + (power == 1 ? t : std::copysign(std::pow(std::abs(t), power), t)) / 2;
}

}  // namespace

TetMesh boxMesh(const BoxMeshOptions& options) {
    TetMesh mesh;
    const NodeGrid grid{options.cells};
    const Vec3d cellSize = options.sizeWorld / Vec3d(options.cells);
    Random random(options.seed);
    Vec3i p;
    for (p.z = 0; p.z <= options.cells.z; ++p.z)
        for (p.y = 0; p.y <= options.cells.y; ++p.y)
            for (p.x = 0; p.x <= options.cells.x; ++p.x) {
                Vec3d at = options.originWorld + options.sizeWorld * (Vec3d(p) / Vec3d(options.cells));
                const Vec3d shift = options.jitter * cellSize * random.offset();
                for (int a = 0; a < 3; ++a)
                    if (p[a] > 0 && p[a] < options.cells[a] && options.jitter > 0) at[a] += shift[a];
                mesh.points.push_back(at);
            }
    for (p.z = 0; p.z < options.cells.z; ++p.z)
        for (p.y = 0; p.y < options.cells.y; ++p.y)
            for (p.x = 0; p.x < options.cells.x; ++p.x)
                options.isFiveSplit ? splitInFive(grid, p, mesh.tets) : splitInSix(grid, p, mesh.tets);
    if (options.isFiveSplit) orient(mesh);
    return mesh;
}

TetMesh sphereMesh(int n) {
    TetMesh mesh = boxMesh({.cells = Vec3i(n), .originWorld = Vec3d(-1), .sizeWorld = Vec3d(2)});
    for (Vec3d& p : mesh.points) {
        const Vec3d s = p * p;
        p = {p.x * std::sqrt(1 - s.y / 2 - s.z / 2 + s.y * s.z / 3),
             p.y * std::sqrt(1 - s.z / 2 - s.x / 2 + s.z * s.x / 3),
             p.z * std::sqrt(1 - s.x / 2 - s.y / 2 + s.x * s.y / 3)};
    }
    return mesh;
}

TetMesh gradedBoxMesh(int n, double power, double jitter, std::uint64_t seed) {
    TetMesh mesh = boxMesh({.cells = Vec3i(n), .jitter = jitter, .seed = seed});
    for (Vec3d& p : mesh.points)
        for (int a = 0; a < 3; ++a) p[a] = graded(p[a], power);
    return mesh;
}

TetMesh boundaryLayerMesh(int n, double thinnest) {
    std::vector<double> heights{0};
    for (double thickness = thinnest; heights.back() + thickness < 1; thickness *= 10)
        heights.push_back(heights.back() + thickness);
    heights.push_back(1);
    const int layers = int(heights.size()) - 1;
    TetMesh mesh = boxMesh({.cells = {n, n, layers}, .sizeWorld = {1, 1, double(layers)}});
    for (Vec3d& p : mesh.points) p.z = heights[std::size_t(std::lround(p.z))];
    return mesh;
}

TetMesh hangingNodeMesh(int coarseCells, int fineCells) {
    TetMesh mesh = boxMesh({.cells = Vec3i(coarseCells)});
    appendMesh(mesh, boxMesh({.cells = Vec3i(fineCells), .originWorld = {1, 0, 0}}));
    return mesh;
}

std::vector<Vec3d> gradedPoints(int points, double power, std::uint64_t seed) {
    Random random(seed);
    std::vector<Vec3d> places;
    for (int i = 0; i < points; ++i) {
        Vec3d p = random.place();
        for (int a = 0; a < 3; ++a) p[a] = graded(p[a], power);
        places.push_back(p);
    }
    return places;
}

TetMesh gradedDelaunayMesh(int points, double power, std::uint64_t seed) {
    return delaunayMesh(gradedPoints(points, power, seed));
}

TetMesh thinTetsMesh(ThinKind kind, double aspect, double size, int count, std::uint64_t seed) {
    TetMesh mesh;
    Random random(seed);
    while (mesh.elementCount() < count) {
        const auto wobble = [&](double s) { return s * (0.5 + random.unit()); };
        std::array<Vec3d, 4> at;
        switch (kind) {
            case ThinKind::sliver:  // a square, bent by a hair along its diagonal
                at = {{{1, 0, wobble(aspect)}, {0, 1, 0}, {-1, 0, wobble(aspect)}, {0, -1, 0}}};
                break;
            case ThinKind::needle:  // a small triangle and a node far away
                at = {{{wobble(aspect), 0, 0},
                       {0, wobble(aspect), 0},
                       {-wobble(aspect), -wobble(aspect), 0},
                       {0, 0, 1}}};
                break;
            case ThinKind::spindle:  // two short edges far from each other
                at = {{{wobble(aspect), 0, -1},
                       {-wobble(aspect), 0, -1},
                       {0, wobble(aspect), 1},
                       {0, -wobble(aspect), 1}}};
                break;
            case ThinKind::cap:  // a node close above the middle of a triangle
                at = {{{1, 0, 0}, {-0.5, 0.8, 0}, {-0.5, -0.8, 0}, {0.1, 0.05, wobble(aspect)}}};
                break;
        }
        const double aboutZ = randomHalfTangent(random), aboutX = randomHalfTangent(random);
        const Vec3d centre = random.place();
        const auto first = std::int32_t(mesh.points.size());
        for (const Vec3d& p : at) mesh.points.push_back(centre + 0.5 * size * turned(p, aboutZ, aboutX));
        mesh.tets.push_back({first, first + 1, first + 2, first + 3});
    }
    return mesh;
}

TetMesh thinClusterMesh(double aspect, int squeezedAxes, int points, std::uint64_t seed) {
    TetMesh mesh = gradedDelaunayMesh(points, 1, seed);
    Random random(seed + 1);
    const double aboutZ = randomHalfTangent(random), aboutX = randomHalfTangent(random);
    for (Vec3d& p : mesh.points) {
        p -= 0.5;
        p.z *= aspect;
        if (squeezedAxes > 1) p.y *= aspect;
        p = 0.5 + turned(p, aboutZ, aboutX);
    }
    return mesh;
}

TetMesh integerTetsMesh(int extent, int count, std::uint64_t seed) {
    TetMesh mesh;
    Random random(seed);
    while (mesh.elementCount() < count) {
        std::array<Vec3d, 4> at;
        for (Vec3d& p : at)
            p = {double(random.below(extent + 1)), double(random.below(extent + 1)),
                 double(random.below(extent + 1))};
        if (volumeSign(at[0], at[1], at[2], at[3]) == 0) continue;
        const auto first = std::int32_t(mesh.points.size());
        const Vec3d shift{double(mesh.elementCount() * (extent + 2)), 0, 0};
        for (const Vec3d& p : at) mesh.points.push_back(p + shift);
        mesh.tets.push_back({first, first + 1, first + 2, first + 3});
    }
    return mesh;
}

TetMesh overlappingMesh(int count, std::uint64_t seed) {
    TetMesh mesh;
    Random random(seed);
    for (std::int32_t e = 0; e < count; ++e) {
        for (int i = 0; i < 4; ++i) mesh.points.push_back(random.place());
        mesh.tets.push_back({4 * e, 4 * e + 1, 4 * e + 2, 4 * e + 3});
    }
    return mesh;
}

TetMesh dustMesh(const Vec3d& centreWorld, double spread, double size, int count, std::uint64_t seed) {
    TetMesh mesh;
    Random random(seed);
    for (std::int32_t e = 0; e < count; ++e) {
        const Vec3d at = centreWorld + spread * random.offset();
        for (int i = 0; i < 4; ++i) mesh.points.push_back(at + 0.5 * size * random.offset());
        mesh.tets.push_back({4 * e, 4 * e + 1, 4 * e + 2, 4 * e + 3});
    }
    return mesh;
}

void addFlatElements(TetMesh& mesh) {
    TESSERA_CHECK(!mesh.tets.empty(), "flat elements are made from nodes there are");
    const std::vector<Tet> tets = mesh.tets;
    for (std::size_t e = 0; e < tets.size(); e += 3) {
        const auto [a, b, c, d] = tets[e];
        const Vec3d pa = mesh.points[std::size_t(a)], pb = mesh.points[std::size_t(b)];
        const auto extra = std::int32_t(mesh.points.size());
        mesh.points.push_back(pa);              // coincident with a
        mesh.points.push_back(pb + (pb - pa));  // on the line through a and b, but for rounding
        mesh.tets.push_back({a, b, c, a});
        mesh.tets.push_back({a, b, c, extra});
        mesh.tets.push_back({d, d, d, d});
        mesh.tets.push_back({a, b, extra + 1, c});
        mesh.tets.push_back({a, b, extra, extra + 1});
    }
}

void invertEverySecond(TetMesh& mesh) {
    for (std::size_t e = 0; e < mesh.tets.size(); e += 2) std::swap(mesh.tets[e][0], mesh.tets[e][1]);
}

void appendMesh(TetMesh& mesh, const TetMesh& other) {
    TESSERA_CHECK(&mesh != &other, "a mesh can't be appended to itself");
    TESSERA_CHECK(mesh.fields.empty() && other.fields.empty(), "meshes are joined before they get fields");
    const auto first = std::int32_t(mesh.points.size());
    mesh.points.insert(mesh.points.end(), other.points.begin(), other.points.end());
    for (Tet tet : other.tets) {
        for (std::int32_t& n : tet) n += first;
        mesh.tets.push_back(tet);
    }
}

void place(TetMesh& mesh, const Placement& placement) {
    for (Vec3d& p : mesh.points) {
        if (placement.isTurned) p = turned(p, 0.365, 1.398);
        p = p * placement.scale + placement.offsetWorld;
    }
}

}  // namespace tessera
