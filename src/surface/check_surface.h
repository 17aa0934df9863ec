#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "surface/repair_surface.h"
#include "surface/surface.h"
#include "tessera/execution.h"

namespace tessera {

/// What can be wrong with a surface that is to bound a volume.
enum class SurfaceFault : std::uint8_t {
    degenerate,     ///< triangles of exactly zero area, or with a corner twice
    duplicate,      ///< triangles with the same three corners as an earlier one
    nonManifold,    ///< edges of more than two triangles
    open,           ///< edges of one triangle
    turned,         ///< triangles that run the other way round than their neighbours
    nonOrientable,  ///< no way round fits all, as on a Moebius strip
    crossing,       ///< triangles that meet elsewhere than in common corners and edges
    inverted,       ///< outermost shells whose triangles look inwards
};
/// Such as "non-manifold".
const char* nameOf(SurfaceFault fault);

/// One kind of fault, and where.
struct SurfaceFinding {
    SurfaceFault fault = SurfaceFault::open;
    std::int64_t count = 0;               ///< edges, triangles, pairs of triangles or shells
    Vec3d placeWorld{0};                  ///< of the first
    std::vector<std::int64_t> triangles;  ///< the first ten that are involved, ascending
};

/// Connected parts of a surface without faults.
struct SurfaceShells {
    struct Shell {
        std::int64_t firstTriangle = 0, triangles = 0;
        double volumeWorld = 0;    ///< below 0: it looks inwards, and bounds a cavity
        int around = 0;            ///< how many shells it lies in
        std::int32_t parent = -1;  ///< the innermost of them
        /// A place in it, off all triangles and outside of the shells in it; on it where it is so thin that
        /// no double lies in it.
        Vec3d insideWorld{0};
    };
    std::vector<Shell> shells;
    std::vector<std::int32_t> shellOf;  ///< of every triangle
};

/// All that is wrong with a surface, by exact arithmetic, in the order degenerate, duplicate, nonManifold,
/// open, nonOrientable, turned, crossing, inverted; empty when it bounds a volume, or without triangles.
/// Degenerate and duplicate triangles count as absent in what comes after them, and shells are looked at only
/// where none of the others was found. Points that no triangle uses are no fault, and neither is a point
/// where parts meet. Throws InputError where triangles or parts overlap so much that looking at all pairs
/// would take too long and none that cross is found; a count of those found is too low then.
/// @param shells gets its parts where nothing is wrong, else none; may be null.
std::vector<SurfaceFinding> findSurfaceFaults(const Surface& surface, const Execution& execution,
                                              SurfaceShells* shells);

/// One sentence: "12 edges belong to one triangle only, so the surface is open, the first near (1, 2, 3):
/// triangles 4, 5 (counted from 0); also 1 turned triangle". Says at its end when repairSurface may mend
/// something. Empty without findings.
std::string faultSentence(const std::vector<SurfaceFinding>& findings, const Surface& surface);

}  // namespace tessera
