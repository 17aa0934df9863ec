#pragma once

#include "raster/raster_resampler.h"

namespace tessera {

/// The slicing resampler.
/// Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive Visualization
/// of Unstructured Grids, IEEE Visualization 2001, section 3.
class SlicingResampler : public RasterResampler {
  public:
    SlicingResampler();
};

/// The method as it was published: interpolated barycentric coordinates, two lookups in an alpha texture. It
/// loses points on shared faces.
class Slicing2001Resampler : public RasterResampler {
  public:
    Slicing2001Resampler();
};

}  // namespace tessera
