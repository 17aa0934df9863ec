#pragma once

#include "slab/slab_resampler.h"
#include "slicing/silhouette_generator.h"

namespace tessera {

/// The slicing resampler.
/// Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive Visualization
/// of Unstructured Grids, IEEE Visualization 2001, section 3.
class SlicingResampler : public SlabResampler {
  public:
    std::string_view name() const override { return "slicing"; }
    std::string_view description() const override {
        return "substitute geometry on OpenGL, a distance test for every fragment";
    }

  protected:
    const SliceGenerator& generator() const override { return generator_; }

  private:
    SilhouetteGenerator generator_;
};

}  // namespace tessera
