#pragma once

#include "raster/slice_batch.h"

namespace tessera {

/// Substitute geometry: an element's silhouette along the slice axis, the same in every slice it reaches. Its
/// corners are the element's own nodes, found from the facing of its faces by a table; no corner is computed.
/// Small silhouettes become square sprites, too sharp ones rectangles.
/// Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive Visualization
/// of Unstructured Grids, IEEE Visualization 2001, section 3.
class SilhouetteGenerator : public SliceGenerator {
  public:
    void emit(const SlabInput& input, SliceBatch& batch) const override;
    const ShaderText& shader() const override;
    /// Strips of one or two triangles whose corners carry barycentric coordinates.
    void emitPublished(const SlabInput& input, SliceBatch& batch) const override;
};

}  // namespace tessera
