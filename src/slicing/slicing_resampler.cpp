#include "slicing/slicing_resampler.h"

#include "slicing/silhouette_generator.h"

namespace tessera {

SlicingResampler::SlicingResampler()
    : RasterResampler("slicing", "substitute geometry on OpenGL, a distance test for every fragment",
                      Method::arithmetic, std::make_unique<SilhouetteGenerator>()) {}

Slicing2001Resampler::Slicing2001Resampler()
    : RasterResampler("slicing-2001", "substitute geometry with an alpha test, as published: misses points",
                      Method::published, std::make_unique<SilhouetteGenerator>()) {}

}  // namespace tessera
