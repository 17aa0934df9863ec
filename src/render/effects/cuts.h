#pragma once

#include <array>
#include <optional>
#include <vector>

#include "render/effect.h"
#include "tessera/focus.h"

namespace tessera {

/// A plane through the volume that has the field's colours.
struct CutPlane {
    HalfSpace half;  ///< the plane is its border
    double opacity = 1;
};

/// Lines on the planes where the field has certain values.
struct Contours {
    std::vector<double> values;  ///< 64 at most; none: so many, evenly over what the transfer function spans
    int count = 10;
    double widthPixels = 1.5;
    std::array<double, 3> color{0, 0, 0};
};

struct Cuts {
    std::vector<CutPlane> planes;  ///< 1 to 16
    std::optional<Contours> contours{};
};

/// Throws InputError for too many planes or lines, and for none.
Effect cutsEffect(const Cuts& cuts);

}  // namespace tessera
