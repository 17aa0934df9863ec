#pragma once

#include <array>
#include <cstdint>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Where bins of aspect ratios begin; the last has no end.
inline constexpr std::array<double, 9> kAspectBins{1, 1.5, 2, 3, 4, 6, 10, 15, 100};

/// How well shaped a mesh's elements are.
struct ShapeStatistics {
    std::int64_t elements = 0;
    /// Longest edge over smallest height, as many times that of a regular tetrahedron: 1 is best.
    std::array<std::int64_t, kAspectBins.size()> aspects{};
    std::array<std::int64_t, 18> dihedrals{};  ///< all six of every element, by 10 degrees
    double largestAspect = 0;
    double smallestDihedral = 0, largestDihedral = 0;  ///< degrees
};
ShapeStatistics measureShapes(const TetMesh& mesh, const Execution& execution);

}  // namespace tessera
