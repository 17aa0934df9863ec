#pragma once

#include <optional>

#include "render/effect.h"

namespace tessera {

/// Colours the volume by a number of each brick, its error (RenderOptions::brickNumbers): blue without one,
/// gray, red at the bound, violet beyond it, and green where it isn't known. A bar tells which is which.
struct ErrorTint {
    std::optional<double> bound;  ///< above 0; none: the largest error
    double strength = 0.8;        ///< from 0, the volume's own colour, to 1, that of the error
    /// Errors are shares of the field's range, told in percent; else they are multiples of the bound that
    /// bricks were to keep.
    bool isShareOfRange = true;
    MarkColor wordsColor{0.25, 0.25, 0.25};
};
Effect errorsEffect(const ErrorTint& tint);

}  // namespace tessera
