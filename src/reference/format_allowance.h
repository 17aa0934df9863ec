#pragma once

#include <span>

#include "mesh/field_range.h"
#include "resample/format_error.h"
#include "tessera/mesh.h"

namespace tessera {

/// What clauses 3 and 4 of the contract grant the values of one channel for the format they were kept in,
/// given the field's finite range and the values f of one element (its node values, or the one value of a
/// cell field).
class FormatAllowance {
  public:
    FormatAllowance(SampleFormat format, const ValueRange& range);

    /// Clause 4: formatError().
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
