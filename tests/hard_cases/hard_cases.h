#pragma once

#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "contract_suite.h"

// The gallery: meshes, lattices and fields that break other tools, each with a name and a sentence.

namespace tessera::hard_cases {

struct HardCase {
    std::string name;               ///< letters and digits: part of a test's name
    std::string row;                ///< cases of one row stand together in the table
    std::string sentence;           ///< what is hard about the row
    std::function<TetMesh()> make;  ///< with fields
    bool isConstant = false;        ///< every field has one value, which must come back exactly
    bool isLarge = false;           ///< too slow for a sanitizer
};
/// For listings of tests.
inline void PrintTo(const HardCase& hardCase, std::ostream* out) {
    *out << hardCase.name;
}
const std::vector<HardCase>& hardCases();

/// Lattices with `cells` spacings along the mesh's longest side: one that begins on its lower bounds, one
/// half a spacing off and one a third, a seventh and two thirds off. Points cost their time, so with 64 cells
/// it is the first alone, with 128 the last.
std::vector<contract::LatticeCase> latticesOf(const TetMesh& mesh, int cells);

/// Lattices of 7^3 points, each with its point (0, 0, 0) at the centroid of one of the thinnest elements:
/// other lattices hardly ever meet the inside of those. Flat elements, and those so thin that no double lies
/// near enough to their centroid, are left out.
std::vector<contract::LatticeCase> latticesThroughThinnest(const TetMesh& mesh, int count);

/// Every covered value of a case of constant fields is that constant, rounded to float: the number that
/// aren't.
std::int64_t wrongConstants(const TetMesh& mesh, const Block& block);

}  // namespace tessera::hard_cases
