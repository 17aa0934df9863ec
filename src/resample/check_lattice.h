#pragma once

#include <span>

#include "tessera/lattice.h"

namespace tessera {

/// Throws InputError when boxes of this lattice can't be sampled: see BoundResampler::resample.
void checkLattice(const Lattice& lattice, std::span<const IndexBox> boxes);

}  // namespace tessera
