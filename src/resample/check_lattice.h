#pragma once

#include <span>

#include "tessera/lattice.h"

namespace tessera {

/// Lattices of spacings between these can be sampled: beyond, products of three lengths leave the range of
/// double.
constexpr double kLeastSpacing = 2e-108, kLargestSpacing = 5e102;

inline bool isPossibleSpacing(double spacingWorld) {
    return spacingWorld >= kLeastSpacing && spacingWorld <= kLargestSpacing;
}

/// Throws InputError for a spacing that isn't possible.
void checkSpacing(double spacingWorld);

/// Throws InputError when boxes of this lattice can't be sampled: see BoundResampler::resample.
void checkLattice(const Lattice& lattice, std::span<const IndexBox> boxes);

}  // namespace tessera
