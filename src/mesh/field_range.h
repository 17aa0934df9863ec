#pragma once

#include <limits>

#include "tessera/mesh.h"

namespace tessera {

/// Smallest and largest finite value of one component; min > max when there is none.
struct ValueRange {
    double min = std::numeric_limits<double>::infinity();
    double max = -std::numeric_limits<double>::infinity();
    bool empty() const { return !(min <= max); }
    double width() const { return empty() ? 0.0 : max - min; }
};
ValueRange fieldRange(const Field& field, int component);
/// Of the values that are finite in float, as samples are.
ValueRange finiteFloatRange(const Field& field, int component);

}  // namespace tessera
