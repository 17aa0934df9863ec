#include "refine/visible_values.h"

#include <algorithm>
#include <cmath>

namespace tessera {

namespace {

/// Smaller differences of a colour can't be seen: half a step of eight bits.
constexpr float kSeen = 1.0f / 512;

}  // namespace

VisibleValues::VisibleValues(const TransferFunction& function, const ValueRange& range) {
    checkTransferFunction(function);
    const double width = range.width() > 0 ? range.width() : 1;
    const double low = range.empty() ? 0 : range.min;
    for (int b = 0; b < kValueBins; ++b) {
        // Between stops all changes one way, but for colour times opacity: its middle is looked at too.
        const double from = low + width * b / kValueBins, to = low + width * (b + 1) / kValueBins;
        std::vector<double> values{from, to};
        for (const TransferFunction::Stop& stop : function.stops)
            if (stop.value > from && stop.value < to) values.insert(values.end() - 1, stop.value);
        for (std::size_t i = values.size(); i-- > 1;)
            values.insert(values.begin() + std::ptrdiff_t(i), (values[i - 1] + values[i]) / 2);
        Shown& shown = bins_[std::size_t(b)];
        std::fill_n(shown.least, 4, std::numeric_limits<float>::infinity());
        std::fill_n(shown.most, 4, -std::numeric_limits<float>::infinity());
        const auto include = [&](const std::array<double, 4>& rgba) {
            for (std::size_t c = 0; c < 4; ++c) {
                shown.least[c] = std::min(shown.least[c], float(rgba[c]));
                shown.most[c] = std::max(shown.most[c], float(rgba[c]));
            }
        };
        for (const double value : values) include(shownAt(function, value));
        // A step has two colours.
        for (const TransferFunction::Stop& stop : function.stops)
            if (stop.value >= from && stop.value <= to) include(shownAs(stop));
        opacity_[std::size_t(b)] = shown.most[3];
        seen_[std::size_t(b)] = shown.most[3] > 0;
    }
}

bool VisibleValues::differs(int bin, int reach) const {
    Shown all = bins_[std::size_t(bin)];
    for (int b = std::max(0, bin - reach); b <= std::min(kValueBins - 1, bin + reach); ++b)
        for (std::size_t c = 0; c < 4; ++c) {
            all.least[c] = std::min(all.least[c], bins_[std::size_t(b)].least[c]);
            all.most[c] = std::max(all.most[c], bins_[std::size_t(b)].most[c]);
            if (all.most[c] - all.least[c] > kSeen) return true;
        }
    return false;
}

double VisibleValues::visibleError(std::span<const BinFinding> findings) const {
    double worst = 0;
    for (const BinFinding& finding : findings) {
        if (!(double(finding.errorBins) > worst)) continue;
        const int reach = int(std::min(std::ceil(finding.errorBins), float(kValueBins)));
        if (differs(finding.bin, reach)) worst = double(finding.errorBins);
    }
    return worst;
}

double VisibleValues::meanVisibleError(std::span<const BinFinding> findings) const {
    double sum = 0;
    for (const BinFinding& finding : findings)
        sum += double(finding.share) * double(finding.errorBins) * double(opacity_[finding.bin]);
    return sum;
}

}  // namespace tessera
