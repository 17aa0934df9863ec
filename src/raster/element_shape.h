#pragma once

#include <array>
#include <cstdint>

#include "index_space/node_frame.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"
#include "tessera/vec.h"

namespace tessera {

/// What arithmetic a fragment needs to decide which points an element covers.
enum class ShapeGrade : std::uint8_t {
    easy,  ///< float
    thin,  ///< double
    hard,  ///< more than double, or an element of more than kLargestHeight voxels: decided on the processor
};

/// Heights beyond this leave the range of the depth buffer.
inline constexpr double kLargestHeight = 2048;

/// An element in the index space of a lattice, relative to its first voxel. Distances are in voxels.
///
/// Face j lies opposite node j; its distance at place p is normal[j] . p + offset[j], positive inside. A
/// point is covered where every distance is at least -slack: no point of the exact element is lost, and no
/// covered point is further than 2^-9 voxel from the element. Derivation in docs/algorithms.md.
struct ElementShape {
    Vec3i first;             ///< lattice index of the first voxel
    double node[4][3];       ///< relative to `first`, absolute error a few 2^-53 of the size
    double low[3], high[3];  ///< of the nodes
    double normal[4][3];     ///< inward, of unit length
    double offset[4];
    double height[4];  ///< of node j over face j
    double slack = 0;  ///< for the grade's arithmetic
    /// An accepted point is within this of the element: what looks for points must look as far, or the bits
    /// would depend on where regions end.
    double margin = 0;
    ShapeGrade grade = ShapeGrade::hard;
};

/// The bounds' constants, which the device's shaders share. Of a plane within an element's box, for each
/// 2^-53; the most of it that is bearable; of a distance in a fragment, for each voxel of the reach of its
/// arithmetic: coefficients, products and sums of three terms in float; of a distance as it stands in float;
/// and of a corner's reach.
inline constexpr double kPlaneRounding = 64 * 0x1p-53, kMostPlaneError = 0x1p-12;
inline constexpr double kFloatRounding = 0x1p-20, kFloatUnit = 0x1p-23, kCornerFactor = 1.01;
/// Records hold the slack in float, rounded up.
inline constexpr float kSlackFactor = 1 + 0x1p-20f;

/// Largest ElementShape::margin, in voxels; the contract allows twice as much.
inline constexpr double kLargestMargin = 0x1p-9;

/// The points of `box` in the element's bounding box, which is widened by its rounding and `margin`; empty
/// when none.
IndexBox pointsAbout(const ElementShape& shape, const IndexBox& box);

/// Sets up an element; only `first`, `node`, `low` and `high` are set for hard ones.
ElementShape shapeElement(const TetMesh& mesh, const NodeFrame& frame, std::int32_t element);

}  // namespace tessera
