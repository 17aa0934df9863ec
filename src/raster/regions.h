#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "tessera/lattice.h"
#include "tessera/vec.h"

namespace tessera {

/// A box of lattice points that is rendered in one go, and the boxes that want points of it.
struct RasterRegion {
    struct Part {
        std::size_t box;  ///< index of the wanted box
        IndexBox points;  ///< what the region holds of it
    };
    IndexBox points;
    std::vector<Part> parts;
};

/// Regions never cross a multiple of this index, on any axis.
inline constexpr int kCellEdge = 256;

/// The aligned cell that holds a region, as its lowest lattice point.
Vec3i cellOrigin(const IndexBox& region);

/// Cuts the wanted boxes along aligned cells of at most kCellEdge points and at most `maxPoints`; a cell that
/// the boxes fill only sparsely is cut further. Every wanted point is in exactly one region's part of its
/// box; the plan depends on the boxes only.
std::vector<RasterRegion> planRasterRegions(std::span<const IndexBox> boxes, std::int64_t maxPoints);

/// Edges of regions that cutRegion() makes are no shorter.
inline constexpr int kShortestEdge = 16;

/// Halves a region, and the halves, across their longest edges: into so many, or fewer where edges would be
/// too short. Appends them.
void cutRegion(RasterRegion region, std::int64_t pieces, std::vector<RasterRegion>& regions);

}  // namespace tessera
