#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "surface/surface.h"
#include "tessera/execution.h"

namespace tessera {

// One entry a triangle each, 1: it is one.

/// Triangles with the same point at two corners.
std::vector<std::uint8_t> trianglesWithCornerTwice(const Surface& surface);

/// Triangles of exactly zero area.
std::vector<std::uint8_t> flatTriangles(const Surface& surface, const Execution& execution);

/// Triangles with the same three points as an earlier one, either way round. @param leftOut not 0: neither.
std::vector<std::uint8_t> laterDuplicates(const Surface& surface, std::span<const std::uint8_t> leftOut);

}  // namespace tessera
