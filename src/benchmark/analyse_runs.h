#pragma once

#include <string>
#include <vector>

#include "benchmark/machine_rates.h"
#include "job/run_report.h"

namespace tessera {

/// y = factor x^exponent through points, by least squares of the logarithms; the exponent with the interval
/// of Student's t at 95 %, as far as there are three points or more.
struct PowerFit {
    double exponent = 0, low = 0, high = 0, factor = 0;
};
/// @param x, y above 0, two points at least.
PowerFit fitPower(const std::vector<double>& x, const std::vector<double>& y);

// What follows from a document's "runs": parts of the document.

/// For each bound of 10, 5, 2 and 1 % of the range on the largest error and on the RMS, and each way of
/// choosing bricks, uniform or by error, what each variant takes: the run that asked for that bound, or else
/// between the coarsest lattice within it and the next coarser one, as straight lines of the logarithms.
Json equalErrorJson(const Json& runs);
/// Indices into the runs that keep the contract or not, for which no other run is both faster and closer.
Json paretoJson(const Json& runs, const Json& variants);
/// Time against points along the longest axis, of uniform runs.
Json resolutionScalingJson(const Json& runs);
/// @param points of each variant: {"variant": .., "x": elements, "ms": {..}}.
Json scalingJson(const Json& points);
/// Uniform runs against what the least bytes take: mesh read once, samples written once.
Json rooflineJson(const Json& runs, const Json& variants, double meshBytes, int channels,
                  const std::vector<MachineRates>& rates);
/// What to take, in sentences.
std::vector<std::string> adviceOn(const Json& document);

}  // namespace tessera
