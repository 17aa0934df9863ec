#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tessera/mesh.h"

// Meshes for tests and benchmarks: no fields, the same on every run and platform but for the last bits of
// std::pow in meshes graded by a power other than 1.

namespace tessera {

struct BoxMeshOptions {
    Vec3i cells{4};
    Vec3d originWorld{0};
    Vec3d sizeWorld{1};
    bool isFiveSplit = false;  ///< five tets a cell, alternating, instead of Kuhn's six
    double jitter = 0;         ///< inner nodes move by up to this share of a cell
    std::uint64_t seed = 1;
};
TetMesh boxMesh(const BoxMeshOptions& options);

/// Ball of radius 1 about the origin: a box of n^3 cells, six tets each, bent.
TetMesh sphereMesh(int n);
/// Unit box of n^3 cells, finest in the middle: x = 1/2 + sign(2u - 1) |2u - 1|^power / 2, jittered.
TetMesh gradedBoxMesh(int n, double power, double jitter, std::uint64_t seed);
/// Unit square of n^2 cells under layers whose thickness grows by 10 from `thinnest` on until they fill the
/// unit box.
TetMesh boundaryLayerMesh(int n, double thinnest);
/// A coarse box beside a fine one: fine nodes hang on the coarse faces.
TetMesh hangingNodeMesh(int coarseCells, int fineCells);

/// Random points in the unit box with x = 1/2 + sign(2u - 1) |2u - 1|^power / 2.
std::vector<Vec3d> gradedPoints(int points, double power, std::uint64_t seed);

/// Delaunay mesh of such points; by exact arithmetic, see delaunayMesh.
TetMesh gradedDelaunayMesh(int points, double power, std::uint64_t seed);

enum class ThinKind { sliver, needle, spindle, cap };
/// Lone thin tets, each of about `size` and of thickness size x aspect, turned at random, at random places of
/// the unit box.
TetMesh thinTetsMesh(ThinKind kind, double aspect, double size, int count, std::uint64_t seed);
/// A conforming cluster: a Delaunay mesh squeezed by `aspect` along one axis (slivers) or two (needles),
/// turned at random, about (1/2, 1/2, 1/2).
TetMesh thinClusterMesh(double aspect, int squeezedAxes, int points, std::uint64_t seed);

/// Tets with integer nodes in [0, extent]^3, each in its own compartment, extent + 2 apart in a row along x;
/// none flat.
TetMesh integerTetsMesh(int extent, int count, std::uint64_t seed);
/// Tets with random nodes in the unit box: most overlap.
TetMesh overlappingMesh(int count, std::uint64_t seed);
/// Tets of about `size` with a node at random within `spread` of `centre`.
TetMesh dustMesh(const Vec3d& centreWorld, double spread, double size, int count, std::uint64_t seed);

/// Adds elements of zero volume between nodes there are: coplanar, collinear, of repeated and of coincident
/// nodes.
void addFlatElements(TetMesh& mesh);
/// Swaps two nodes of every second element.
void invertEverySecond(TetMesh& mesh);
/// Appends the nodes and elements of another mesh, which isn't the same object; fields must not be there yet.
void appendMesh(TetMesh& mesh, const TetMesh& other);
/// Moves every node: p -> turn(p) x scale + offset, turned by fixed irrational angles when isTurned.
struct Placement {
    double scale = 1;
    Vec3d offsetWorld{0};
    bool isTurned = false;
};
void place(TetMesh& mesh, const Placement& placement);

}  // namespace tessera
