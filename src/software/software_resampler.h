#pragma once

#include "tessera/resampler.h"

namespace tessera {

/// The scanline resampler on the processor.
/// Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive Visualization
/// of Unstructured Grids, IEEE Visualization 2001, section 4.
class SoftwareResampler : public Resampler {
  public:
    SoftwareResampler();
    std::vector<std::string> targets() const override;
    WorkMemory workMemory(int channels) const override;
    std::unique_ptr<BoundResampler> bind(const TetMesh& mesh, std::span<const int> fields,
                                         const BindOptions& options = {}) const override;
};

}  // namespace tessera
