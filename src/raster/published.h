#pragma once

#include <cstdint>
#include <vector>

#include "raster/channel_coding.h"

namespace tessera {

// What the published methods need: barycentric coordinates that the rasteriser interpolates, and values at
// nodes. They show what accuracy costs, and meet the contract in no clause.

/// As the shaders read it.
struct PublishedGeometry {
    float node[4][4];  ///< pixel s, t and layer, relative to the region: the pixel's centre is at + 1/2
    float rise[4];     ///< change of the barycentric coordinates from layer to layer
};
/// Codes of one channel at the four nodes.
struct NodeCodes {
    float codes[4];
};
static_assert(sizeof(PublishedGeometry) == 80 && sizeof(NodeCodes) == 16);

/// A corner of substitute geometry: a node of an element.
struct SilhouetteCorner {
    std::uint32_t record;
    std::uint16_t layer, node;
};

/// A corner of a slice polygon.
struct GouraudCorner {
    float s, t;
    std::uint32_t layer;
    float codes[4];
};

/// Codes of an element for one channel; all of them the mark where one isn't finite.
NodeCodes codesAtNodes(const ChannelCoding& coding, const TetMesh& mesh, std::int32_t element, float invalid);

}  // namespace tessera
