#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "mesh_test_tools.h"
#include "reference/generators.h"
#include "tessera/mesh.h"

// Good meshes of a box with degenerate elements of one class inside. All conform, all are positively
// oriented.

namespace tessera::test {

inline TetMesh goodBox(int cells = 4) {
    return boxMesh({.cells = Vec3i(cells), .jitter = 0.15, .seed = 3});
}

/// An element whose nodes all lie strictly inside the unit box; counted from `skip` on.
inline std::int32_t innerElement(const TetMesh& mesh, int skip) {
    for (std::int32_t e = 0; e < mesh.elementCount(); ++e) {
        bool inside = true;
        for (const std::int32_t node : mesh.tets[std::size_t(e)])
            for (int k = 0; k < 3; ++k) {
                const double x = mesh.points[std::size_t(node)][k];
                inside = inside && x > 0 && x < 1;
            }
        if (inside && skip-- == 0) return e;
    }
    return -1;
}

/// Splits an element in four at a place inside it.
inline void insertInside(TetMesh& mesh, std::int32_t element, const Vec3d& place) {
    const auto node = std::int32_t(mesh.points.size());
    mesh.points.push_back(place);
    const auto tet = mesh.tets[std::size_t(element)];
    for (std::size_t i = 0; i < 4; ++i) {
        auto child = tet;
        child[i] = node;
        if (i == 0)
            mesh.tets[std::size_t(element)] = child;
        else
            mesh.tets.push_back(child);
    }
}

/// Splits all elements around the edge from a to b at a place on it.
inline void insertOnEdge(TetMesh& mesh, std::int32_t a, std::int32_t b, const Vec3d& place) {
    const auto node = std::int32_t(mesh.points.size());
    mesh.points.push_back(place);
    const std::size_t count = mesh.tets.size();
    for (std::size_t e = 0; e < count; ++e) {
        auto& tet = mesh.tets[e];
        const auto atA = std::find(tet.begin(), tet.end(), a), atB = std::find(tet.begin(), tet.end(), b);
        if (atA == tet.end() || atB == tet.end()) continue;
        auto child = tet;
        child[std::size_t(atA - tet.begin())] = node;
        *atB = node;
        mesh.tets.push_back(child);
    }
}

/// A node close to another, along an edge between them.
inline TetMesh needlesInside(double aspect) {
    TetMesh mesh = goodBox();
    const auto tet = mesh.tets[std::size_t(innerElement(mesh, 0))];
    const Vec3d a = mesh.points[std::size_t(tet[0])], b = mesh.points[std::size_t(tet[1])];
    insertOnEdge(mesh, tet[0], tet[1], a + aspect * (b - a));
    return mesh;
}

/// A node close to the middle of an edge.
inline TetMesh spindlesInside(double aspect) {
    TetMesh mesh = goodBox();
    const std::int32_t e = innerElement(mesh, 0);
    const auto tet = mesh.tets[std::size_t(e)];
    const auto at = [&](std::size_t i) { return mesh.points[std::size_t(tet[i])]; };
    const Vec3d middle = at(0) + 0.45 * (at(1) - at(0));
    insertInside(mesh, e, middle + aspect * (0.1 * (at(2) - middle) + 0.9 * (at(3) - middle)));
    return mesh;
}

/// A node close to the middle of a face.
inline TetMesh capInside(double aspect) {
    TetMesh mesh = goodBox();
    const std::int32_t e = innerElement(mesh, 0);
    const auto tet = mesh.tets[std::size_t(e)];
    const auto at = [&](std::size_t i) { return mesh.points[std::size_t(tet[i])]; };
    const Vec3d middle = at(0) + 0.35 * (at(1) - at(0)) + 0.3 * (at(2) - at(0));
    insertInside(mesh, e, middle + aspect * (at(3) - middle));
    return mesh;
}

/// Two boxes of 4 x 4 x 3 cells on each other whose diagonals cross where they meet, and a sliver between
/// each pair of diagonals, `thickness` thick; 0: exactly flat.
inline TetMesh sliverLayer(double thickness) {
    TetMesh mesh = boxMesh({.cells = {4, 4, 3}, .sizeWorld = {4, 4, 3}, .isFiveSplit = true});
    appendMesh(
        mesh,
        boxMesh({.cells = {4, 4, 3}, .originWorld = {0, 0, 3}, .sizeWorld = {4, 4, 3}, .isFiveSplit = true}));
    const auto node = [](int x, int y, int z) { return std::int32_t((z * 5 + y) * 5 + x); };
    const std::int32_t upper = node(0, 0, 4), joint = node(0, 0, 3);
    for (auto& tet : mesh.tets)
        for (std::int32_t& n : tet)
            if (n >= upper && n < upper + 25) n += joint - upper;
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 4; ++x)
            mesh.tets.push_back({node(x, y, 3), node(x + 1, y, 3), node(x + 1, y + 1, 3), node(x, y + 1, 3)});
    // Of the two diagonals of a square the upper box's is lifted.
    std::set<std::int32_t> lifted;
    for (std::size_t e = (mesh.tets.size() - 16) / 2; e < mesh.tets.size() - 16; ++e)
        for (const std::int32_t i : mesh.tets[e])
            for (const std::int32_t j : mesh.tets[e]) {
                if (i < joint || i >= joint + 25 || j < joint || j >= joint + 25) continue;
                const Vec3d edge = mesh.points[std::size_t(j)] - mesh.points[std::size_t(i)];
                if (edge.x != 0 && edge.y != 0) lifted.insert({i, j});
            }
    for (const std::int32_t n : lifted) mesh.points[std::size_t(n)].z += thickness;
    for (std::size_t e = mesh.tets.size() - 16; e < mesh.tets.size(); ++e)
        if (signOf(mesh, std::int64_t(e)) < 0) std::swap(mesh.tets[e][2], mesh.tets[e][3]);
    return mesh;
}

}  // namespace tessera::test
