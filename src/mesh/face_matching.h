#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/geometry.h"
#include "tessera/execution.h"

namespace tessera {

/// Which faces the elements share, compared by node indices.
struct FaceMatching {
    /// of elements that aren't flat: faces that no other such element has; ascending by element
    std::vector<BoundaryFace> boundary;
    /// of elements that aren't flat: faces that no other element at all has; ascending by element
    std::vector<BoundaryFace> lone;
    std::int64_t singleFaces = 0;        ///< faces of one element only, flat elements included
    std::int64_t pairedFaces = 0;        ///< faces of exactly two elements, flat elements included
    std::int64_t crowdedFaces = 0;       ///< faces of more than two elements, flat elements included
    std::int64_t duplicateElements = 0;  ///< elements with the same four nodes as an earlier one
};

/// FaceMatching::boundary alone, in less than half of the time.
std::vector<BoundaryFace> matchBoundary(const TetMesh& mesh, std::span<const std::uint8_t> flat,
                                        const Execution& execution);

/// @param flat one entry an element, not 0: of zero volume. Throws InternalError above 2^30 elements.
FaceMatching matchFaces(const TetMesh& mesh, std::span<const std::uint8_t> flat, const Execution& execution);

}  // namespace tessera
