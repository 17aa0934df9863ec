#pragma once

#include <cstdint>

#include "surface/surface.h"

namespace tessera {

/// Whether two triangles have a point in common that isn't in the corner or the edge that they share by point
/// indices. Exact. False for two with the same three corners. Neither may have a corner twice or zero area.
bool trianglesCross(const Surface& surface, std::int64_t first, std::int64_t second);

}  // namespace tessera
