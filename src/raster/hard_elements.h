#pragma once

#include <cstdint>
#include <vector>

#include "raster/prepared_region.h"

namespace tessera {

/// A lattice point that the processor decided.
struct DecidedPoint {
    std::uint16_t s, t;  ///< pixel
    std::uint32_t layer;
    float depth;  ///< voxels
    float codes[4];
};

/// Samples elements that no shader can decide, by the software resampler's scan: the channels of one pass.
std::vector<DecidedPoint> decideHardElements(const RasterInputs& inputs, const PreparedRegion& region,
                                             std::size_t pass, const Execution& execution);

}  // namespace tessera
