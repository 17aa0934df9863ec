#pragma once

#include "render/effect.h"

namespace tessera {

/// The edges of the bricks that are drawn, a colour for each depth.
struct BrickEdges {
    double widthPixels = 1.5;
    double opacity = 0.8;
};
Effect brickEdgesEffect(const BrickEdges& edges);

}  // namespace tessera
