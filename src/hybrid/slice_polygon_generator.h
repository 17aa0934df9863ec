#pragma once

#include "raster/slice_batch.h"

namespace tessera {

/// Slice polygons by marching tetrahedra, computed on the processor for every element and slice: a triangle
/// or a quadrilateral, its corners where the element's edges cross the slice plane. Polygons without a pixel
/// centre near them are dropped, small ones become square sprites, too sharp ones rectangles; the others are
/// grown. Based on: M. Weiler and T. Ertl, Hardware-Software-Balanced Resampling for the Interactive
/// Visualization of Unstructured Grids, IEEE Visualization 2001, section 5.
class SlicePolygonGenerator : public SliceGenerator {
  public:
    void emit(const SlabInput& input, SliceBatch& batch) const override;
    const ShaderText& shader() const override;
    /// Polygons whose corners carry the values of the cut edges, to be filled with Gouraud shading.
    void emitPublished(const SlabInput& input, SliceBatch& batch) const override;
};

}  // namespace tessera
