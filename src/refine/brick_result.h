#pragma once

#include <optional>
#include <string>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "tessera/report.h"
#include "tessera/resampler.h"

namespace tessera {

/// Milliseconds of the stages in this layer.
struct BrickTimes {
    double planMs = 0;
    double resampleMs = 0;
    double verifyMs = 0;
};

/// A tree with its samples and its measured error.
struct BrickResult {
    /// What a flat grid was made of (flatten); `tree` and `store` are then the grid's own.
    std::optional<BrickTree> bricks;
    int flatLevel = 0;  ///< of these bricks: the grid's spacing
    /// What the samples' error was before half floats or a coarser grid made another of it.
    std::optional<ErrorReport> samplesReport;
    BrickTree tree;
    BrickStore store;
    ErrorReport report;
    std::vector<double> leafErrors;  ///< as MeasureOptions::leafErrors, where a file needs them; else empty
    ResampleStatistics statistics;
    std::string target;  ///< the code path that sampled it, one of Resampler::targets()
    BrickTimes times;
    bool bounded = false;            ///< error: the measured error on the final tree is within the bound
    std::string stoppedBecause;      ///< error: empty when bounded, else which budget ended the refinement
    int rounds = 0;                  ///< error: rounds of refinement
    std::vector<std::string> notes;  ///< sentences for the user
};

}  // namespace tessera
