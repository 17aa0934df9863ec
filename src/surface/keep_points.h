#pragma once

#include <span>

#include "surface/surface.h"

namespace tessera {

/// Leaves out every point but those kept, with their values, and numbers corners anew.
/// @param isKept of every point; all corners of triangles are kept ones.
void keepPoints(std::span<const char> isKept, Surface& surface);

}  // namespace tessera
