#pragma once

#include <functional>
#include <string>
#include <vector>

#include "reference/check_contract.h"
#include "resample/resampler.h"

// What the contract tests share: meshes, lattices, and the checks of one resampler on one of each.

namespace tessera::contract {

/// How much of the suite to run: 1 in a plain build, less under sanitizers; TESSERA_CONTRACT_SCALE overrides.
double scale();

/// `points` lattice points along an axis, fewer at a smaller scale.
int scaledPoints(int points);

struct MeshCase {
    std::string name;  ///< letters and digits: part of a test's name
    std::function<TetMesh()> make;
    /// A length that node coordinates are multiples of, for lattices with nodes on lattice points; 0: the
    /// longest side over 16.
    double alignedSpacing = 0;
};
const std::vector<MeshCase>& meshCases();

struct LatticeCase {
    std::string name;
    Lattice lattice;
    IndexBox box;
};
/// Lattices about a mesh: aligned with its bounds, at half and third offsets, far coarser, far finer,
/// anisotropic, left-handed, and oriented cut planes.
std::vector<LatticeCase> latticesAbout(const TetMesh& mesh, double alignedSpacing, int pointsAlong);

/// Point and cell fields of every kind: smooth, constant, random, of huge and tiny size, on a large offset,
/// not finite in places, and each element's index.
void addTestFields(TetMesh& mesh);

std::vector<int> allFields(const TetMesh& mesh);

struct Sampling {
    std::string target;  ///< empty: the default
    int threads = 1;
};
/// The blocks of several boxes.
std::vector<Block> sample(const Resampler& resampler, const TetMesh& mesh, std::span<const int> fields,
                          const Lattice& lattice, std::span<const IndexBox> boxes, const Sampling& sampling);

/// Boxes of `edge`^3 points that fill a box; on the upper sides they may be smaller.
std::vector<IndexBox> cut(const IndexBox& box, int edge);

/// Points of `part` whose coverage, or a covered value's bits, differ from those of `whole`, which contains
/// its box.
std::int64_t differences(const Block& part, const Block& whole);

/// Clauses 1 to 5 at every point; fails the test with the first offence. Returns the figures.
ContractReport expectContract(const Resampler& resampler, const TetMesh& mesh, const LatticeCase& at);
/// Clause 5: the same bits for threads, bricks, targets, overlapping boxes and other elements elsewhere.
void expectDeterministic(const Resampler& resampler, const TetMesh& mesh, const LatticeCase& at);

}  // namespace tessera::contract
