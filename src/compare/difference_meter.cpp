#include "compare/difference_meter.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/check.h"
#include "mesh/field_range.h"

namespace tessera {

namespace {

// A positive float's bits grow with its value; without the last 12 of 23 bits of the fraction a bin is 2^-11
// wide relative to its values.
constexpr int kDroppedBits = 12;
constexpr std::size_t kBins = std::size_t(1) << (31 - kDroppedBits);

std::size_t binOf(double difference) {
    const auto value = float(std::min(difference, double(std::numeric_limits<float>::max())));
    return std::bit_cast<std::uint32_t>(value) >> kDroppedBits;
}
double upperEnd(std::size_t bin) {
    if (bin == 0) return 0;
    return double(std::bit_cast<float>(std::uint32_t((bin + 1) << kDroppedBits) - 1));
}

}  // namespace

DifferenceMeter::DifferenceMeter(const TetMesh& mesh, std::span<const int> fields, double thinVoxels)
    : thinVoxels_(thinVoxels) {
    int channel = 0;
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        Gathered gathered;
        gathered.difference.name = field.name;
        gathered.difference.location = field.location;
        for (int c = 0; c < field.components; ++c)
            gathered.difference.range = std::max(gathered.difference.range, fieldRange(field, c).width());
        gathered.firstChannel = channel;
        gathered.channels = field.components;
        gathered.counts.assign(kBins, 0);
        channel += field.components;
        fields_.push_back(std::move(gathered));
    }
}

void DifferenceMeter::add(const Block& first, const Block& second, std::span<const float> thinnestVoxels) {
    TESSERA_CHECK(first.box == second.box && first.channels == second.channels,
                  "blocks of one box are compared");
    TESSERA_CHECK(thinnestVoxels.empty() || thinnestVoxels.size() == first.count(),
                  "there is a thickness for every point");
    for (Gathered& field : fields_) addField(field, first, second, thinnestVoxels);
}

void DifferenceMeter::addField(Gathered& field, const Block& first, const Block& second,
                               std::span<const float> thinnestVoxels) const {
    FieldDifference& d = field.difference;
    double sumOfSquares = 0;
    std::size_t at = 0;
    Vec3i p;
    for (p.z = first.box.min.z; p.z < first.box.max.z; ++p.z)
        for (p.y = first.box.min.y; p.y < first.box.max.y; ++p.y)
            for (p.x = first.box.min.x; p.x < first.box.max.x; ++p.x, ++at) {
                if (!first.coverage[at] || !second.coverage[at]) continue;
                double square = 0;
                bool firstFinite = true, secondFinite = true;
                for (int c = field.firstChannel; c < field.firstChannel + field.channels; ++c) {
                    const auto a = double(first.channel(c)[at]), b = double(second.channel(c)[at]);
                    firstFinite = firstFinite && std::isfinite(a);
                    secondFinite = secondFinite && std::isfinite(b);
                    square += (a - b) * (a - b);
                }
                if (!firstFinite || !secondFinite) {
                    d.validityDiffers += firstFinite != secondFinite;
                    continue;
                }
                const double difference = std::sqrt(square);
                ++d.points;
                ++field.counts[binOf(difference)];
                sumOfSquares += square;
                if (difference > d.max || d.points == 1) {
                    d.max = difference;
                    d.worst = p;
                }
                if (!thinnestVoxels.empty() && double(thinnestVoxels[at]) < thinVoxels_)
                    ++d.thinPoints;
                else
                    d.maxInThickElements = std::max(d.maxInThickElements, difference);
            }
    field.sumOfSquares += sumOfSquares;
}

std::vector<FieldDifference> DifferenceMeter::differences() const {
    std::vector<FieldDifference> result;
    for (const Gathered& field : fields_) {
        FieldDifference d = field.difference;
        if (d.points > 0) d.rms = std::sqrt(field.sumOfSquares / double(d.points));
        // The smallest bin with at least 99.9 % of the points in it or below.
        const std::int64_t wanted = d.points - d.points / 1000;
        std::int64_t sum = 0;
        for (std::size_t bin = 0; bin < kBins && d.points > 0; ++bin) {
            sum += field.counts[bin];
            if (sum < wanted) continue;
            d.p999 = std::min(upperEnd(bin), d.max);
            break;
        }
        result.push_back(std::move(d));
    }
    return result;
}

}  // namespace tessera
