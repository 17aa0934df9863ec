#include "hybrid/hybrid_resampler.h"

#include "hybrid/slice_polygon_generator.h"

namespace tessera {

HybridResampler::HybridResampler()
    : RasterResampler("hybrid", "marching-tetrahedra slice polygons filled by OpenGL", Method::arithmetic,
                      std::make_unique<SlicePolygonGenerator>()) {}

Hybrid2001Resampler::Hybrid2001Resampler()
    : RasterResampler("hybrid-2001", "slice polygons filled by the fill rule, as published: misses points",
                      Method::published, std::make_unique<SlicePolygonGenerator>()) {}

}  // namespace tessera
