#pragma once

#include <string>

#include "render/effect.h"

namespace tessera {

/// A bar of a round length at the bottom left of the picture. With rays from an eye it holds at the distance
/// of the middle of the data, across the view; where that is behind the eye there is none.
struct ScaleBar {
    MarkColor color{0.25, 0.25, 0.25};
    std::string unit;  ///< of lengths; empty: none is named
};
Effect scaleBarEffect(const ScaleBar& bar);

}  // namespace tessera
