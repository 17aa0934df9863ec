#pragma once

#include <string>
#include <vector>

#include "surface/surface.h"

namespace tessera {

/// How long edges are to be, in world units; 0 and empty: no wish. Of several the shortest counts, but never
/// one below `smallest`.
struct SizeWishes {
    double everywhere = 0;      ///< --size
    double atSurface = 0;       ///< --size-surface
    std::string field;          ///< --size-field: a field of the surface's points holds the length there
    double edgesPerCircle = 0;  ///< --edges-per-circle: at the surface, by its curvature
    /// --growth: by how much edges may get longer for every unit of distance from the surface.
    double growth = 0.5;
    double smallest = 0;  ///< --min-size

    bool any() const { return everywhere > 0 || hasSurface(); }
    bool hasSurface() const { return atSurface > 0 || !field.empty() || edgesPerCircle > 0; }
};

/// What tetrahedra are to be made of a surface or of scattered points.
struct TetrahedralizeOptions {
    SizeWishes size;
    double quality = 1.414;          ///< bound on circumradius over shortest edge
    double minDihedralDegrees = 10;  ///< wished for; with a surface of sharper edges not everywhere
    bool splitsBoundary = false;  ///< the surface's triangles may be split where that helps quality or size
    bool repairs = false;         ///< repairSurface first
    double hullLimitWorld = 0;    ///< of scattered points: no edge may be longer; 0: no bound
    std::vector<Vec3d> holesWorld;
    std::vector<RegionSeed> regions;
};

}  // namespace tessera
