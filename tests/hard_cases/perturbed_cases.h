#pragma once

#include <cstdint>

#include "contract_suite.h"

namespace tessera::hard_cases {

struct PerturbedCase {
    TetMesh mesh;  ///< with fields
    contract::LatticeCase at;
};

/// A few elements whose nodes lie on lattice points, halves or thirds, some of them moved by 1e-17 to 1e-1 of
/// a voxel or by a few steps of double: each seed another mesh, lattice and perturbation, the same on every
/// machine.
PerturbedCase perturbedCase(std::uint64_t seed);

/// How many were checked, and which one was the first not to be clean.
struct PerturbedReport {
    ContractReport total;
    std::int64_t cases = 0;
    std::int64_t unclean = 0;
    std::uint64_t firstUnclean = 0;
};
/// Cases [first, first + count) against the oracle, on all threads.
PerturbedReport checkPerturbed(const contract::Subject& subject, std::uint64_t first, std::int64_t count);

}  // namespace tessera::hard_cases
