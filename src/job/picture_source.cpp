#include "job/picture_source.h"

#include <algorithm>

namespace tessera {

void ValueHistogram::add(double value, double volume) {
    if (!(value >= range_[0] && value <= range_[1])) return;
    const double share = range_[0] < range_[1] ? (value - range_[0]) / (range_[1] - range_[0]) : 0;
    shares_[std::min(std::size_t(share * double(kHistogramBins)), kHistogramBins - 1)] += volume;
    all_ += volume;
}

std::vector<double> ValueHistogram::shares() const {
    std::vector<double> shares = shares_;
    for (double& share : shares) share = all_ > 0 ? share / all_ : 0;
    return shares;
}

}  // namespace tessera
