#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <span>

#include "mesh/field_range.h"
#include "tessera/transfer_function.h"

namespace tessera {

/// A field's range is divided into so many bins.
inline constexpr int kValueBins = 256;
using ValueMask = std::bitset<kValueBins>;

/// The bin of a value; values outside the range are in the first or the last.
inline int binOf(const ValueRange& range, double value) {
    const double share = (value - range.min) / (range.max > range.min ? range.max - range.min : 1);
    return share > 0 ? share < 1 ? int(share * kValueBins) : kValueBins - 1 : 0;
}

/// What the samples of a brick are in one bin of values.
struct BinFinding {
    std::uint8_t bin = 0;
    /// Of all samples.
    float share = 0;
    /// The largest error met at a value of this bin, in bins.
    float errorBins = 0;
};

/// What a transfer function shows of a field, bin by bin.
class VisibleValues {
  public:
    /// @param range of the field.
    VisibleValues(const TransferFunction& function, const ValueRange& range);

    /// Some value of these bins is seen.
    bool showsAny(const ValueMask& bins) const { return (bins & seen_).any(); }
    /// The largest error, in bins, met at a value that is shown otherwise than some value within the error:
    /// elsewhere an error can't be seen. After Sondershaus and Strasser 2006, with the change of colour and
    /// the maximum in place of the mean, so that small bright features count.
    double visibleError(std::span<const BinFinding> findings) const;
    /// sum_i H_i E_i alpha_i: the mean error weighted by opacity, in bins (Sondershaus and Strasser 2006).
    double meanVisibleError(std::span<const BinFinding> findings) const;

  private:
    struct Shown {
        float least[4], most[4];  ///< of colour times opacity, and opacity, over the bin
    };
    static int leastReach(const std::array<Shown, kValueBins>& bins, int bin);

    std::array<std::uint16_t, kValueBins> leastReach_;  ///< in bins, of an error that can be seen
    std::array<float, kValueBins> opacity_;             ///< the largest
    ValueMask seen_;
};

}  // namespace tessera
