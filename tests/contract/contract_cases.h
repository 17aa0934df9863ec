#pragma once

#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "tessera/lattice.h"
#include "tessera/mesh.h"

// The meshes, lattices and fields of the contract suite.

namespace tessera::contract {

struct MeshCase {
    std::string name;  ///< letters and digits: part of a test's name
    std::function<TetMesh()> make;
    /// A length that node coordinates are multiples of, for lattices with nodes on lattice points; 0: the
    /// longest side over 16.
    double alignedSpacing = 0;
};
/// For listings of tests.
inline void PrintTo(const MeshCase& meshCase, std::ostream* out) {
    *out << meshCase.name;
}
const std::vector<MeshCase>& meshCases();

/// Keeps the mesh: some take longer to make than to sample, and every subject takes each of them.
std::function<TetMesh()> madeOnce(std::function<TetMesh()> make);

struct LatticeCase {
    std::string name;
    Lattice lattice;
    IndexBox box;
};
/// Lattices about a mesh: aligned with its bounds, at half and third offsets, far coarser, far finer, with
/// indices about a power of two, far from 0 and negative, anisotropic, left-handed, and oriented cut planes.
std::vector<LatticeCase> latticesAbout(const TetMesh& mesh, double alignedSpacing, int pointsAlong);

/// A lattice with `points` points along the mesh's longest side, the first on its lower bound.
LatticeCase latticeOver(const TetMesh& mesh, int points);

/// Point and cell fields of every kind: smooth, constant, random, of huge and tiny size, of sizes that differ
/// from node to node, on a large offset, not finite (in double, or in float only) in places, and each
/// element's index.
void addTestFields(TetMesh& mesh);

}  // namespace tessera::contract
