#pragma once

#include "tessera/resampler.h"

namespace tessera::contract {

/// A slow resampler made of the oracle itself: the deepest element that contains the point owns it, the
/// lowest index among equals. It shows that the suite accepts a right answer.
class OracleResampler : public Resampler {
  public:
    OracleResampler()
        : Resampler({.name = "oracle",
                     .description = "rational arithmetic",
                     .spillBoundVoxels = 0x1p-12,
                     .placeBoundVoxels = 0x1p-24}) {}
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options = {}) const override;
};

}  // namespace tessera::contract
