#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Classes of elements by aspect ratio (smallest height over longest edge) and number of large dihedral
/// angles. After: K. Museth and S. Lombeyda, TetSplat: Real-time Rendering and Volume Clipping of Large
/// Unstructured Tetrahedral Meshes, IEEE Visualization 2004, section 2.2 and figure 2.
enum class ElementClass : std::uint8_t {
    good,     ///< aspect not below the limit
    needle,   ///< no large angle: two nodes close together
    spindle,  ///< one: a node close to an edge
    sliver,   ///< two, at opposite edges: edges that nearly cross
    cap,      ///< three, or two at edges that meet: a node close to a face
    flat,     ///< exactly zero volume, whatever its shape
};
inline constexpr std::size_t kElementClasses = 6;
const char* nameOf(ElementClass elementClass);

struct ClassLimits {
    /// Elements thinner than this are degenerate. The default is about the rounding of coordinates stored as
    /// float, and below what boundary layers of simulations have (1e-5).
    double minAspect = 1e-6;
    double maxDihedralDegrees = 150;  ///< larger angles count as large
};

using Corners = std::array<Vec3d, 4>;
Corners cornersOf(const TetMesh& mesh, std::int64_t element);

/// Smallest height over longest edge: 0.816 for a regular tetrahedron, 0 for a flat one up to rounding (about
/// 1e-16). Any size of coordinates that doubles can hold.
double aspectOf(const Corners& corners);

/// The shape of a thin element, and which of its nodes make it thin.
struct ThinShape {
    ElementClass shape = ElementClass::needle;  ///< needle, spindle, sliver or cap
    /// Corners in the order of the shape. Needle: 0 and 1 are the shortest edge. Spindle: 0 and 1 are the
    /// edge of the large angle, 2 and 3 the edge opposite. Sliver: 0 and 1, 2 and 3 are the crossing edges.
    /// Cap: 0 is the node close to the face of the others.
    std::array<std::uint8_t, 4> order{0, 1, 2, 3};
};
/// @param corners of any element: flat, collinear and coincident ones have a shape too.
ThinShape thinShapeOf(const Corners& corners, const ClassLimits& limits);

ElementClass classOf(const Corners& corners, const ClassLimits& limits);

struct ClassCounts {
    std::array<std::int64_t, kElementClasses> of{};
    std::int64_t operator[](ElementClass c) const { return of[std::size_t(c)]; }
    std::int64_t degenerate() const;  ///< all but the good ones
};
/// @param degenerate gets the elements that aren't good, ascending; may be null.
ClassCounts countClasses(const TetMesh& mesh, const ClassLimits& limits, const Execution& execution,
                         std::vector<std::int32_t>* degenerate = nullptr);

}  // namespace tessera
