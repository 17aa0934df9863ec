#pragma once

#include "mesh/field_range.h"
#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

/// Distance from |x| to the next float.
double floatUlp(double x);
/// Distance from |x| to the next half, 2^-24 for x below 2^-14.
double halfUlp(double x);

/// Clause 4 of the contract: by how much the format may move a value of an element. With t = (f - min) / (max
/// - min),
///     r32f:    4 ulp(max |f|)
///     r16, r8: (max - min) / 65535 or 255, + 4 ulp(max(|f|, f - min))
///     r16f:    halfUlp(max t) (max - min) + 4 ulp(max(|f|, f - min))
/// in ulps of float: both f and f - min go through float on the way. A field of one value has no step.
/// @param range of the field, over its values that are finite in float.
/// @param largest the element's max |f|. @param highest its max (f - min).
double formatError(SampleFormat format, const ValueRange& range, double largest, double highest);

}  // namespace tessera
