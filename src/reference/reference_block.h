#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "reference/oracle.h"
#include "tessera/execution.h"
#include "tessera/lattice.h"

namespace tessera {

/// An element that may own a lattice point: the point lies in it or within the tolerance of it.
struct Candidate {
    std::int32_t element = -1;
    bool contains = false;      ///< in the closed element, exactly
    double depthVoxels = 0;     ///< signed distance to the nearest face plane; within 1e-8 voxel
    double distanceVoxels = 0;  ///< true distance to the element; 0 when contained, else within 10 %
};

/// What is true of every point of a box of lattice points, by exact arithmetic.
struct ReferenceBlock {
    IndexBox box;
    double toleranceVoxels = 0;
    std::vector<std::uint8_t> mustCover;        ///< in the mesh
    std::vector<std::uint32_t> firstCandidate;  ///< box.count() + 1 offsets into candidates
    std::vector<Candidate> candidates;          ///< of each point, ascending by element
    std::int64_t exactPairs = 0;  ///< pairs of point and element that rational arithmetic decided

    std::span<const Candidate> candidatesOf(std::size_t offset) const {
        return {candidates.data() + firstCandidate[offset],
                firstCandidate[offset + 1] - firstCandidate[offset]};
    }
    bool mayCover(std::size_t offset) const { return firstCandidate[offset] != firstCandidate[offset + 1]; }
};

struct ReferenceOptions {
    /// A point may be covered when its true distance to an element is at most this.
    double toleranceVoxels = 1.0 / 4096;
    /// Decide every pair by rational arithmetic: for tests of the filter itself.
    bool isUnfiltered = false;
};

/// Decides clear cases in double with rigorous error bounds and all others in rational arithmetic.
ReferenceBlock referenceBlock(const Oracle& oracle, const IndexBox& box, const ReferenceOptions& options = {},
                              const Execution& execution = {});

}  // namespace tessera
