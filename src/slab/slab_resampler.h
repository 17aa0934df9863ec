#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "resample/resampler.h"
#include "slab/slice_batch.h"

namespace tessera {

/// What the OpenGL resamplers have in common: regions of a lattice are rendered slice by slice into a layered
/// target and read back. They differ in the primitives that stand for an element in a slice.
class SlabResampler : public Resampler {
  public:
    std::string unavailableReason() const override;
    std::vector<std::string> targets() const override;
    bool targetsAgree() const override { return false; }
    std::vector<SampleFormat> formats() const override;
    double relativeCost() const override;
    double spillBoundVoxels() const override { return 0x1p-8; }
    double placeBoundVoxels() const override { return 0x1p-8; }
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options = {}) const override;

  protected:
    virtual const SliceGenerator& generator() const = 0;
};

}  // namespace tessera
