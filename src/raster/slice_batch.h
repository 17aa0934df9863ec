#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "gl/shader_text.h"
#include "raster/element_shape.h"
#include "raster/published.h"
#include "tessera/vec.h"

namespace tessera {

/// How the axes of a lattice lie in a layered target: pixels (s, t) of layer l.
struct SliceAxes {
    int s = 0, t = 1, l = 2;
    static SliceAxes along(int layerAxis) {
        if (layerAxis == 0) return {1, 2, 0};
        if (layerAxis == 1) return {0, 2, 1};
        return {0, 1, 2};
    }
};

/// A square of pixels in one layer, drawn as one point; 12 bytes, as the shaders read it.
struct Sprite {
    std::uint32_t record;
    std::uint16_t s, t;  ///< lowest pixel
    std::uint16_t layer, edge;
};

/// A corner of a polygon, in pixels: the centre of pixel (s, t) is (s + 1/2, t + 1/2). 16 bytes.
struct PolygonVertex {
    float s, t;
    std::uint32_t record;
    std::uint32_t layer;
};

/// Sprites and polygons, in the order they are drawn.
struct PrimitiveList {
    std::vector<Sprite> sprites;
    std::vector<PolygonVertex> corners;  ///< four a polygon; of a triangle the last one stands twice
};

/// Triangles of the published methods; one of the two kinds of corners.
struct PublishedList {
    std::vector<SilhouetteCorner> silhouettes;
    std::vector<GouraudCorner> polygons;
    std::vector<std::uint32_t> indices;
};

/// What a generator makes for one slab.
struct SliceBatch {
    PrimitiveList easy, thin;
    PublishedList published;
    std::int64_t pairs = 0;     ///< of element and slice
    std::int64_t polygons = 0;  ///< before growing
};

/// An element as the generators see it: small, because there is one for every element of a region.
struct SliceElement {
    float node[4][3];              ///< relative to `first`, lattice axes
    std::int32_t first[3];         ///< relative to the region's first point
    std::int16_t low[3], high[3];  ///< its points in the region, relative, both inclusive; low > high: none
    ShapeGrade grade;
    bool isSmall;  ///< at most kSmallExtent long on every axis: drawn as sprites, the others as polygons
    std::uint32_t record;  ///< of the grade's records
    float margin;          ///< ElementShape::margin
};

/// In voxels. Where elements are equally deep the first one drawn owns a point; that small ones come first,
/// on every axis and in every algorithm and region, makes the choice always the same.
inline constexpr int kSmallExtent = 12;

/// The part of a region that a generator works at: elements in ascending order that reach these layers.
struct SlabInput {
    SliceAxes axes;
    Vec3i size;  ///< of the region, lattice axes
    int layerBegin = 0, layerEnd = 0;
    std::span<const SliceElement> elements;
    std::span<const std::int32_t> active;
    // For emitPublished.
    std::span<const PublishedGeometry> published;
    std::span<const NodeCodes> nodeCodes;  ///< record by record, channel by channel
    int channels = 1;
};

/// Turns elements into primitives that hold, at least, every pixel centre in a slice within the element's
/// margin: the fragment decides. One implementation an algorithm.
class SliceGenerator {
  public:
    virtual ~SliceGenerator() = default;
    virtual void emit(const SlabInput& input, SliceBatch& batch) const = 0;
    /// The same as slice_primitives.glsl asks for it.
    virtual const ShaderText& shader() const = 0;
    /// The same as published, without growing.
    virtual void emitPublished(const SlabInput& input, SliceBatch& batch) const = 0;
};

/// Pixels both inclusive.
struct PixelRect {
    int s0, t0, s1, t1;
};

/// One sprite, which may hang over the rectangle, for a small element, else two triangles.
void emitRect(const PixelRect& rect, int layer, const SliceElement& element, PrimitiveList& list);

/// A convex polygon of 3 or 4 corners, grown by `growth` pixels on all sides. False, and nothing emitted,
/// when a corner is too sharp or the polygon too thin for that.
bool emitGrown(std::span<const std::array<double, 2>> corners, double growth, int layer, std::uint32_t record,
               PrimitiveList& list);

/// In voxels: corners of elements with longer edges lose too much in the rasteriser's fixed point.
inline constexpr double kLargestPolygon = 1000;

/// In pixels: more than what the rasteriser's snapping of corners, to steps of 2^-kSubpixelBits, can take
/// away and an element's margin.
inline constexpr int kSubpixelBits = 8;
inline constexpr double kGrowth = 0x1p-7;

}  // namespace tessera
