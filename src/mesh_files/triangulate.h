#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mesh_files/raw_surface.h"

namespace tessera {

/// Triangles of all polygons, in their order. @param sources gets the polygon that each comes from.
std::vector<std::array<std::int32_t, 3>> trianglesOf(const std::string& path, const RawSurface& raw,
                                                     std::vector<std::int64_t>& sources);

/// Polygons of one plane, some of which may be holes in others, as triangles of the same points.
std::vector<std::array<std::int32_t, 3>> trianglesOfFacet(const std::vector<Vec3d>& points,
                                                          std::span<const std::vector<std::int32_t>> loops);

}  // namespace tessera
