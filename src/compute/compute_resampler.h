#pragma once

#include "raster/raster_resampler.h"

namespace tessera {

/// The scan on the device: compute shaders go through the points of every element's box, and an atomic
/// operation a point tells whose it is.
/// Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive Visualization
/// of Unstructured Grids, IEEE Visualization 2001, section 4, where there are many lanes.
class ComputeResampler : public RasterResampler {
  public:
    ComputeResampler();
};

}  // namespace tessera
