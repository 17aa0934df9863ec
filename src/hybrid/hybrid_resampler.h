#pragma once

#include "hybrid/slice_polygon_generator.h"
#include "slab/slab_resampler.h"

namespace tessera {

/// The hybrid resampler.
/// Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive Visualization
/// of Unstructured Grids, IEEE Visualization 2001, section 5.
class HybridResampler : public SlabResampler {
  public:
    std::string_view name() const override { return "hybrid"; }
    std::string_view description() const override {
        return "marching-tetrahedra slice polygons filled by OpenGL";
    }
    /// It leaves less to the device than substitute geometry does.
    double relativeCost() const override { return 0.7 * SlabResampler::relativeCost(); }

  protected:
    const SliceGenerator& generator() const override { return generator_; }

  private:
    SlicePolygonGenerator generator_;
};

}  // namespace tessera
