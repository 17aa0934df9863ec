#pragma once

#include "raster/raster_resampler.h"

namespace tessera {

/// The hybrid resampler.
/// Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive Visualization
/// of Unstructured Grids, IEEE Visualization 2001, section 5.
class HybridResampler : public RasterResampler {
  public:
    HybridResampler();
};

/// The method as it was published: values interpolated over the polygon, points by the fill rule. It loses
/// points on the boundary.
class Hybrid2001Resampler : public RasterResampler {
  public:
    Hybrid2001Resampler();
};

}  // namespace tessera
