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
    std::array<Shown, kValueBins> bins;
    for (int b = 0; b < kValueBins; ++b) {
        // Between stops all changes one way, but for colour times opacity: its middle is looked at too.
        const double from = low + width * b / kValueBins, to = low + width * (b + 1) / kValueBins;
        std::vector<double> values{from, to};
        for (const TransferFunction::Stop& stop : function.stops)
            if (stop.value > from && stop.value < to) values.insert(values.end() - 1, stop.value);
        for (std::size_t i = values.size(); i-- > 1;)
            values.insert(values.begin() + std::ptrdiff_t(i), (values[i - 1] + values[i]) / 2);
        Shown& shown = bins[std::size_t(b)];
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
    for (int b = 0; b < kValueBins; ++b) leastReach_[std::size_t(b)] = std::uint16_t(leastReach(bins, b));
}

// How many bins away a bin is shown otherwise; more than there are when none is.
int VisibleValues::leastReach(const std::array<Shown, kValueBins>& bins, int bin) {
    Shown all = bins[std::size_t(bin)];
    for (int reach = 0; reach <= kValueBins; ++reach)
        for (const int b : {std::max(0, bin - reach), std::min(kValueBins - 1, bin + reach)})
            for (std::size_t c = 0; c < 4; ++c) {
                all.least[c] = std::min(all.least[c], bins[std::size_t(b)].least[c]);
                all.most[c] = std::max(all.most[c], bins[std::size_t(b)].most[c]);
                if (all.most[c] - all.least[c] > kSeen) return reach;
            }
    return kValueBins + 1;
}

double VisibleValues::visibleError(std::span<const BinFinding> findings) const {
    float worst = 0;
    for (const BinFinding& finding : findings) {
        const float reach = std::min(std::ceil(finding.errorBins), float(kValueBins));
        if (finding.errorBins > worst && reach >= float(leastReach_[finding.bin])) worst = finding.errorBins;
    }
    return double(worst);
}

double VisibleValues::meanVisibleError(std::span<const BinFinding> findings) const {
    double sum = 0;
    for (const BinFinding& finding : findings)
        sum += double(finding.share) * double(finding.errorBins) * double(opacity_[finding.bin]);
    return sum;
}

}  // namespace tessera
