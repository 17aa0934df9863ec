#include "compute/compute_resampler.h"

namespace tessera {

namespace {
constexpr double kShareOfSlicing = 0.5;
}  // namespace

ComputeResampler::ComputeResampler()
    : RasterResampler("compute", "the points of every element tested by compute shaders", Method::scan,
                      nullptr, kShareOfSlicing) {}

}  // namespace tessera
