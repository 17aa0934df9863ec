#pragma once

#include <cstdint>

#include "surface/surface.h"
#include "tessera/execution.h"

namespace tessera {

/// What a repair did.
struct SurfaceRepair {
    std::int64_t mergedPoints = 0;      ///< at exactly the place of another
    std::int64_t removedTriangles = 0;  ///< with a corner twice, or there twice
    std::int64_t turnedTriangles = 0;
};

/// Leaves of points at exactly one place the first, with the means of their finite values. Returns how many
/// it took out.
std::int64_t mergePoints(Surface& surface, const Execution& execution);

/// Which closed shells are to look outwards; the others keep the way round that most of their triangles run.
enum class Outwards : std::uint8_t { outermost, all };
/// Turns triangles so that neighbours agree, by the majority of each shell, and shells outwards. Returns how
/// many.
std::int64_t turnTriangles(Surface& surface, Outwards outwards, const Execution& execution);

/// Merges points at exactly one place (mergePoints), removes triangles of zero area whose removal
/// leaves no hole (two corners the same) and those that are there twice, turns triangles so that neighbours
/// agree, by the majority of each shell, and then the outermost shells outwards. Holes and crossings stay.
SurfaceRepair repairSurface(Surface& surface, const Execution& execution);

}  // namespace tessera
