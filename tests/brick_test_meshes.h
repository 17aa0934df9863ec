#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <random>

#include "tessera/mesh.h"

namespace tessera {

/// A box of nx x ny x nz cubes, each split into the six tetrahedra around its main diagonal (conforming).
inline TetMesh gridMesh(const Vec3i& n, const Vec3d& low, const Vec3d& high) {
    TetMesh mesh;
    const auto at = [&](int i, int j, int k) { return std::int32_t((k * (n.y + 1) + j) * (n.x + 1) + i); };
    for (int k = 0; k <= n.z; ++k)
        for (int j = 0; j <= n.y; ++j)
            for (int i = 0; i <= n.x; ++i)
                mesh.points.push_back(glm::mix(low, high, Vec3d(i, j, k) / Vec3d(n)));
    constexpr int kPaths[6][2] = {{1, 3}, {5, 1}, {3, 2}, {2, 6}, {4, 5}, {6, 4}};  // all of positive volume
    for (int k = 0; k < n.z; ++k)
        for (int j = 0; j < n.y; ++j)
            for (int i = 0; i < n.x; ++i) {
                const auto corner = [&](int c) { return at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)); };
                for (const auto& path : kPaths)
                    mesh.tets.push_back({corner(0), corner(path[0]), corner(path[1]), corner(7)});
            }
    return mesh;
}

/// The cube [0, 1]^3 with elements that shrink towards the corner (0, 0, 0) by the given power.
inline TetMesh gradedMesh(int n, double power) {
    TetMesh mesh = gridMesh({n, n, n}, Vec3d(0), Vec3d(1));
    for (Vec3d& p : mesh.points) p = Vec3d(std::pow(p.x, power), std::pow(p.y, power), std::pow(p.z, power));
    return mesh;
}

/// A ball: a grid over [-1, 1]^3 bent onto it, with a mesh boundary that no lattice is aligned with.
inline TetMesh ballMesh(int n, double radius) {
    TetMesh mesh = gridMesh({n, n, n}, Vec3d(-1), Vec3d(1));
    for (Vec3d& p : mesh.points) {
        const double cube = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)});
        const double length = glm::length(p);
        if (length > 0) p *= radius * cube / length;
    }
    return mesh;
}

inline int addPointField(TetMesh& mesh, const std::string& name,
                         const std::function<double(const Vec3d&)>& f) {
    Field field{name, FieldLocation::point, 1, {}};
    for (const Vec3d& p : mesh.points) field.values.push_back(f(p));
    mesh.fields.push_back(std::move(field));
    return int(mesh.fields.size()) - 1;
}

inline int addCellField(TetMesh& mesh, const std::string& name,
                        const std::function<double(std::int64_t)>& f) {
    Field field{name, FieldLocation::cell, 1, {}};
    for (std::int64_t e = 0; e < mesh.elementCount(); ++e) field.values.push_back(f(e));
    mesh.fields.push_back(std::move(field));
    return int(mesh.fields.size()) - 1;
}

}  // namespace tessera
