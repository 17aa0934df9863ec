#pragma once

#include <cstdint>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// What is sound and what isn't in a mesh. Nothing here is fatal.
struct MeshQuality {
    std::int64_t flat = 0;             ///< elements of exactly zero volume
    std::int64_t inverted = 0;         ///< elements of negative volume
    std::int64_t duplicate = 0;        ///< elements with the same four nodes as an earlier one
    std::int64_t coincidentNodes = 0;  ///< nodes at exactly the place of an earlier node
    std::int64_t boundaryFaces = 0;    ///< faces of one element only
    std::int64_t innerFaces = 0;       ///< faces of exactly two elements
    /// faces of more than two elements, and boundary faces that lie inside the mesh: over another boundary
    /// face, or with a node of the mesh on them that isn't one of their own
    std::int64_t nonConformingFaces = 0;
    double smallestEdgeWorld = 0;
    double largestEdgeWorld = 0;
    double smallestVolumeWorld = 0;  ///< |volume| of elements that are not flat; 0 when all are
    double largestVolumeWorld = 0;
};

MeshQuality measureQuality(const TetMesh& mesh, const Execution& execution);

/// For every node the lowest index of a node at exactly the same place.
std::vector<std::int32_t> firstNodeAtPlace(const std::vector<Vec3d>& points, const Execution& execution);

}  // namespace tessera
