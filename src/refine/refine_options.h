#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "tessera/options.h"
#include "tessera/resampler.h"
#include "tessera/vec.h"

namespace tessera {

struct RefineOptions {
    Criteria criterion = Criterion::elementSize;
    int brickCells = 16;  ///< 8, 16, 32 or 64
    int resolution = 0;   ///< lattice points along the longest axis of the bounds (the finest level); 0: not
                          ///< given. They run exactly from the bounds' minimum to their maximum
    double spacingWorld = 0;       ///< finest spacing; 0: not given
    double samplesPerElement = 2;  ///< element-size: lattice points along a typical element edge
    int maxLevels = 0;    ///< number of nested levels at most; 0: 8 for element-size, no bound for error
    double maxError = 0;  ///< error: bound, in field units or as a share of each field's range
    bool maxErrorIsRelative = true;
    ErrorMeasure measure = ErrorMeasure::max;
    std::vector<int>
        errorFields;  ///< indices into mesh.fields that the bound holds for; empty: all point fields chosen
    std::vector<Focus> focus;                          ///< focus: where bricks are to be fine
    std::optional<TransferFunction> transferFunction;  ///< visibility: what is seen
    std::int64_t maxVoxels =
        0;  ///< bound on stored points (leaves x B^3); 0: a default from the memory there is
    std::int64_t maxMemoryBytes = 0;  ///< bound on the samples' memory; 0: no bound of its own
    /// Holds where maxMemoryBytes is 0, and isn't one that the caller chose; 0: none.
    std::int64_t defaultMemoryBytes = 0;
    std::optional<Box3d> boundsWorld;  ///< keep only the points that reading inside this box needs
    std::optional<FixedFrame> frame;   ///< instead of resolution and spacing; level 0 is then its spacing,
                                       ///< even when no brick is so fine
    BindOptions bind;                  ///< what the resampler runs with
};

/// Whether the largest errors of all values must be within the bound, not only of those that are seen.
inline bool isBoundedEverywhere(const RefineOptions& options) {
    return options.criterion.has(Criterion::error) && !options.criterion.has(Criterion::visibility);
}

}  // namespace tessera
