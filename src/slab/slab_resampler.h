#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "resample/resampler.h"
#include "slab/slice_batch.h"

namespace tessera {

struct DeviceSamples;

/// A bound OpenGL resampler: besides, it can leave its samples on the device. Runs on one platform take
/// turns, so a sink must not resample on the platform that feeds it: it would wait for itself.
class BoundSlabResampler : public BoundResampler {
  public:
    /// Samples one box into 3D textures of sharedGlThread(of its target's platform), without reading back.
    /// Throws as resample() does, and GlError when the device has no room.
    virtual std::shared_ptr<const DeviceSamples> resampleOnDevice(const Lattice& lattice, const IndexBox& box,
                                                                  const Execution& execution) = 0;
};

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

    /// bind() as the type that can leave samples on the device.
    std::unique_ptr<BoundSlabResampler> bindToDevice(const TetMesh& mesh, std::span<const int> fields,
                                                     const BindOptions& options = {}) const;

  protected:
    virtual const SliceGenerator& generator() const = 0;
};

}  // namespace tessera
