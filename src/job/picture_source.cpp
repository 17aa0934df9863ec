#include "job/picture_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tessera/error.h"

namespace tessera {

void ValueHistogram::add(double value, double volume) {
    if (!(value >= range_[0] && value <= range_[1])) return;
    const double share = range_[0] < range_[1] ? (value - range_[0]) / (range_[1] - range_[0]) : 0;
    shares_[std::min(std::size_t(share * double(kHistogramBins)), kHistogramBins - 1)] += volume;
    all_ += volume;
}

void ValueHistogram::add(const ValueHistogram& other) {
    for (std::size_t bin = 0; bin < shares_.size(); ++bin) shares_[bin] += other.shares_[bin];
    all_ += other.all_;
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

const std::vector<double>& PictureSource::histogram(const std::array<double, 2>& range) const {
    if (!histogram_ || histogram_->range != range) {
        ValueHistogram values(range);
        fill(values);
        histogram_ = {range, values.shares()};
    }
    return histogram_->shares;
}

std::optional<double> PictureSource::valueAt(const Vec3d& placeWorld) const {
    const std::optional<Samples> samples = samplesAt(placeWorld);
    if (!samples) return std::nullopt;
    const Block& block = *samples->block;
    const Vec3d index = (placeWorld - frame().originWorld) / frame().spacingWorld(samples->key.depth);
    // Points on + faces may belong to the neighbour: the last cell there is stands for them.
    const Vec3d last = Vec3d(block.box.max) - 2.0;
    const Vec3d cell = glm::clamp(glm::floor(index), Vec3d(block.box.min), last);
    const Vec3d within = glm::clamp(index - cell, Vec3d(0), Vec3d(1));
    double sum = 0, covered = 0, weights = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3i offset(corner & 1, corner >> 1 & 1, corner >> 2);
        double weight = 1;
        for (int a = 0; a < 3; ++a) weight *= offset[a] ? within[a] : 1 - within[a];
        const Vec3i point = Vec3i(cell) + offset;
        const auto value = double(block.value(0, point));
        if (!block.covered(point) || !std::isfinite(value)) continue;
        covered += weight;
        weights += weight;
        sum += weight * value;
    }
    if (!(covered >= 0.5)) return std::nullopt;
    return sum / weights;
}

}  // namespace tessera
