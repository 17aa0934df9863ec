#pragma once

#include <string>
#include <vector>

#include "job/run_report.h"

namespace tessera {

/// A median and the interval that the true median lies in, with a confidence of at least 95 % where there are
/// six values or more.
struct MedianInterval {
    double median = 0, low = 0, high = 0;
    std::size_t count = 0;

    bool overlaps(const MedianInterval& other) const { return low <= other.high && other.low <= high; }
    bool holds(double value) const { return low <= value && value <= high; }
};

/// By order statistics, which asks for no distribution: the interval between the k-th smallest and the k-th
/// largest value, with the largest k that the binomial distribution allows (J. Hettmansperger, S. Sheather,
/// Confidence intervals based on interpolated order statistics, 1986, without the interpolation). Fewer than
/// six values: from the least to the largest. @param values at least one.
MedianInterval medianInterval(std::vector<double> values);

/// {"median": .., "low": .., "high": .., "count": ..}
Json intervalJson(const MedianInterval& interval);
/// The same back. Throws InputError.
MedianInterval intervalFrom(const Json& json);

}  // namespace tessera
