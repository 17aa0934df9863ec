#pragma once

#include <span>

#include "mesh/tet_mesh.h"
#include "resample/resampler.h"

namespace tessera {

/// Distance from |x| to the next float.
double floatUlp(double x);
/// Distance from |x| to the next half, 2^-24 for x below 2^-14.
double halfUlp(double x);

/// Smallest and largest of one component's values that are finite in float, over the whole mesh.
ValueRange finiteFloatRange(const Field& field, int component);

/// What clauses 3 and 4 of the contract grant the values of one channel for the format they were kept in.
/// With t = (f - min) / (max - min) over the field's finite range and the values f of one element (its node
/// values, or the one value of a cell field),
///     r32f:    e = 4 ulp(max |f|)
///     r16, r8: e = (max - min) / 65535 or 255, + 4 ulp(max(|f|, f - min))
///     r16f:    e = halfUlp(max t) (max - min) + 4 ulp(max(|f|, f - min))
/// in ulps of float: both f and f - min go through float on the way. A field of one value has no step.
class FormatAllowance {
  public:
    FormatAllowance(SampleFormat format, const ValueRange& range);

    /// Clause 4: e above.
    /// @param values one element's, all finite.
    double error(std::span<const double> values) const;
    /// Clause 3: true when no more is wrong with a finite value than the format explains. A float stays in
    /// the range of the element's values, rounded to float; a value kept in steps may leave it by e, but
    /// never the field's range.
    bool isInRange(float value, std::span<const double> values) const;
    /// Values of cell fields are the element's own: exactly in r32f, within e otherwise.
    bool isOwn(float value, double own) const;

    bool isStepped() const { return format_ != SampleFormat::r32f; }

  private:
    SampleFormat format_;
    ValueRange range_;
};

}  // namespace tessera
