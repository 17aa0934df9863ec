#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Share of a brick's elements that may be smaller than the size its spacing follows. The quantile counts
/// elements, not volume: by volume a graded region much smaller than the brick would never be seen.
inline constexpr double kSizeQuantile = 0.15;

/// How many of `count` elements may be too small for a spacing.
inline std::int64_t mostTooSmall(std::int64_t count) {
    return std::int64_t(kSizeQuantile * double(count));
}

/// An element's size: the geometric mean of its six edges, in units of `unit`. Slivers have ordinary edges
/// and so an ordinary size; flat boundary-layer elements come out between their thickness and their length.
/// Elements outside the bounds have none, 0.
std::vector<float> elementSizes(const TetMesh& mesh, double unit, const std::optional<Box3d>& boundsWorld,
                                const Execution& execution);

}  // namespace tessera
