#include "job/picture_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "tessera/error.h"

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

std::string titleOf(const OutputField& field, std::optional<int> component) {
    if (component && *component >= field.components)
        throw InputError(fmt::format("{} has {} components, counted from 0; there is no component {}",
                                     field.name, field.components, *component));
    if (field.components == 1) return field.name;
    return component ? fmt::format("{} {}", field.name, *component) : fmt::format("|{}|", field.name);
}

}  // namespace tessera
