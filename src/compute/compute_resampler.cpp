#include "compute/compute_resampler.h"

namespace tessera {

// It takes about half of slicing's time on an emulated device.
ComputeResampler::ComputeResampler()
    : RasterResampler("compute", "the points of every element tested by compute shaders", Method::scan,
                      nullptr, 0.5) {}

}  // namespace tessera
