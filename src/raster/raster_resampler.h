#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "raster/slice_batch.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

struct DeviceSamples;

/// A bound OpenGL resampler: besides, it can leave its samples on the device. Runs on one platform take
/// turns, so a sink must not resample on the platform that feeds it: it would wait for itself.
class BoundRasterResampler : public BoundResampler {
  public:
    /// Samples one box into 3D textures of sharedGlThread(of its target's platform), without reading back.
    /// Throws as resample() does, and GlError when the device has no room.
    virtual std::shared_ptr<const DeviceSamples> resampleOnDevice(const Lattice& lattice, const IndexBox& box,
                                                                  const Execution& execution) = 0;
};

/// What the OpenGL resamplers have in common: regions of a lattice are rendered slice by slice into a layered
/// target and read back. They differ in the primitives that stand for an element in a slice.
class RasterResampler : public Resampler {
  public:
    std::string unavailableReason() const override;
    std::vector<std::string> targets() const override;
    double relativeCost() const override;
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options = {}) const override;

    /// bind() as the type that can leave samples on the device.
    std::unique_ptr<BoundRasterResampler> bindToDevice(const TetMesh& mesh, std::span<const int> fields,
                                                       const BindOptions& options = {}) const;

  protected:
    /// How the points that an element covers are decided.
    enum class Method {
        arithmetic,  ///< by distances computed in the fragment: meets the contract
        published,   ///< as in the paper: 2D alpha textures, Gouraud fill
    };
    /// @param cost share of what a device usually takes.
    RasterResampler(std::string name, std::string description, Method method,
                    std::unique_ptr<const SliceGenerator> generator, double cost = 1);

  private:
    Method method_;
    std::unique_ptr<const SliceGenerator> generator_;
    double cost_;
};

}  // namespace tessera
