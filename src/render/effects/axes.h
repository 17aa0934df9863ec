#pragma once

#include <string>

#include "render/effect.h"

namespace tessera {

/// The box of the data, with ticks and numbers at round values and the names x, y and z. An axis has its
/// ticks on that of its four edges which stands at the outline of the box, below or on the left. From
/// inside the box there is the box alone.
struct Axes {
    double widthPixels = 1.5;
    MarkColor color{0.25, 0.25, 0.25};
    std::string unit;  ///< of lengths; empty: none is named
};
Effect axesEffect(const Axes& axes);

}  // namespace tessera
