#pragma once

#include <span>

#include "tessera/execution.h"
#include "tessera/lattice.h"
#include "tessera/resampler.h"
#include "tessera/vec.h"

namespace tessera {

/// Times of several runs of one resampler over the same boxes.
struct RunTimes {
    int runs = 0;
    double totalMs = 0;             ///< wall clock of one call to resample, median
    ResampleStatistics statistics;  ///< every stage's median; the counts of the last run
};

/// Runs it `runs` times (at least once) and throws the samples away. Each stage's median is taken by itself.
RunTimes timeRuns(BoundResampler& resampler, const Lattice& lattice, std::span<const IndexBox> boxes,
                  int runs, const Execution& execution);

}  // namespace tessera
