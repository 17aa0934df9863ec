#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "raster/slice_batch.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

/// What the OpenGL resamplers have in common: regions of a lattice are rendered slice by slice, or scanned by
/// compute shaders, into a layered target and read back. They differ in what stands for an element. Runs on
/// one platform take turns, so a sink must not resample on the platform that feeds it: it would wait for
/// itself. Slots in textures of sharedGlThread(of its target's platform) are filled without reading back.
class RasterResampler : public Resampler {
  public:
    std::string unavailableReason() const override;
    std::vector<std::string> targets() const override;
    WorkMemory workMemory(int channels) const override;
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options = {}) const override;

  protected:
    /// How the points that an element covers are decided.
    enum class Method {
        arithmetic,  ///< by distances computed in the fragment: meets the contract
        scan,        ///< the same, by compute shaders that go through the points of each element's box
        published,   ///< as in the paper: 2D alpha textures, Gouraud fill
    };
    /// @param generator of primitives; a scan needs none.
    RasterResampler(std::string name, std::string description, Method method,
                    std::unique_ptr<const SliceGenerator> generator);

  private:
    Method method_;
    std::shared_ptr<const SliceGenerator> generator_;  // shared with what is bound
};

}  // namespace tessera
