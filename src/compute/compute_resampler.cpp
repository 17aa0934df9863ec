#include "compute/compute_resampler.h"

namespace tessera {

ComputeResampler::ComputeResampler()
    : RasterResampler("compute", "the points of every element tested by compute shaders", Method::scan,
                      nullptr) {}

}  // namespace tessera
