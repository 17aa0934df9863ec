#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "reference/reference_block.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"

namespace tessera {

/// The bounds of one resampler in one format. What the format itself grants is in format_allowance.h.
struct ContractBounds {
    double spillVoxels = 1.0 / 4096;  ///< clause 2, and how far from the deepest an owner may be (clause 5)
    double placeVoxels = 1.0 / (1 << 24);      ///< clause 4
    SampleFormat format = SampleFormat::r32f;  ///< clauses 3 and 4
};

struct CheckOptions {
    /// Coverage is checked at every point; values at about one covered point in so many.
    std::int64_t valuesEvery = 1;
};

/// How a block measures against the contract. Counts are of points for coverage, and of pairs of point and
/// channel for the rest.
struct ContractReport {
    std::int64_t points = 0, inMesh = 0, covered = 0;
    std::int64_t valued = 0;      ///< points whose values were checked
    std::int64_t holes = 0;       ///< clause 1: in the mesh, not covered
    std::int64_t spill = 0;       ///< clause 2: covered, further from every element than the bound
    std::int64_t overshoot = 0;   ///< clause 3: outside what every right owner's node values allow
    std::int64_t inaccurate = 0;  ///< clause 4: too far from the interpolation of every right owner
    /// clause 5: the value of an element that isn't a right owner, or channels of different owners
    std::int64_t wrongOwner = 0;
    /// finite where the owner's node values aren't all, or the other way round
    std::int64_t wrongValidity = 0;
    /// Largest difference from the exact value over what clause 4 allows, at points that pass.
    double worstRatio = 0;
    std::string worstRatioPlace;
    std::string firstOffence;  ///< empty when clean; the point, its candidates and the exact figures

    bool isClean() const { return holes + spill + overshoot + inaccurate + wrongOwner + wrongValidity == 0; }
    ContractReport& operator+=(const ContractReport& other);
    /// One line of counts, then the first offence.
    std::string summary() const;
};

/// Checks a block of any resampler against clauses 1 to 5, point by point.
/// @param reference of the block's box with a tolerance of bounds.spillVoxels.
/// @param fields the indices that the resampler was bound with.
ContractReport checkContract(const Block& block, const ReferenceBlock& reference, const Oracle& oracle,
                             std::span<const int> fields, const ContractBounds& bounds,
                             const CheckOptions& options = {});

}  // namespace tessera
