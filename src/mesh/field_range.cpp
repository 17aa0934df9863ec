#include "mesh/field_range.h"

#include <cmath>

namespace tessera {

namespace {

template <class Takes>
ValueRange rangeOf(const Field& field, int component, const Takes& takes) {
    ValueRange range;
    for (std::size_t i = std::size_t(component); i < field.values.size();
         i += std::size_t(field.components)) {
        const double v = field.values[i];
        if (!takes(v)) continue;
        if (v < range.min) range.min = v;
        if (v > range.max) range.max = v;
    }
    return range;
}

}  // namespace

ValueRange fieldRange(const Field& field, int component) {
    return rangeOf(field, component, [](double v) { return std::isfinite(v); });
}

ValueRange finiteFloatRange(const Field& field, int component) {
    return rangeOf(field, component, [](double v) { return std::isfinite(float(v)); });
}

}  // namespace tessera
