#pragma once

#include <cstdint>

#include "reference/generators.h"
#include "tessera/mesh.h"

// Meshes that break other tools, without fields. All are made of additions, multiplications, divisions and
// square roots only, so they are the same bit for bit on every machine.

namespace tessera::hard_cases {

/// 10^-exponent, correctly rounded.
double tenToMinus(int exponent);

/// Thin elements of one kind, each on its own about the middle of the unit box: of every four one has a node,
/// one the middle of an edge, one that of a face and one its centroid on a multiple of 1/16 (all but in
/// rounding), so that lattice points meet them however thin they are. A small good element in each of two
/// opposite corners makes the mesh as long as the box.
TetMesh thinAlone(ThinKind kind, double aspect, int count, std::uint64_t seed);
/// A chain of thin elements: each is the mirror image of one before across a shared face. A node on a
/// multiple of 1/16, corners as above.
TetMesh thinChain(ThinKind kind, double aspect, int count, std::uint64_t seed);
/// A unit box of 4^3 cells in which every fifth element has a node inserted so close to a node (needle), an
/// edge's middle (spindle) or a face's (cap) that thin elements arise, conformingly. Slivers fill the gaps
/// between two triangulations of a bent plane.
TetMesh thinInsideGoodMesh(ThinKind kind, double aspect);

/// Elements of zero volume only.
enum class FlatKind { coplanar, collinear, repeatedNode, allNodesEqual, coincidentNodes };
TetMesh flatElements(FlatKind kind, int count, std::uint64_t seed);

/// `count` elements within one voxel of a unit box's lattice of 16 cells, and the box's own elements around
/// them.
TetMesh crowdedVoxel(int count, std::uint64_t seed);
/// A chain of boxes in which each is a tenth of the last one's length: volumes from 1 to 1e-18.
TetMesh shrinkingBoxes();
/// A jittered unit box without the elements about its middle.
TetMesh boxWithVoid();
/// Four parts, two of which touch in a single node and two nowhere.
TetMesh disconnectedParts();
/// One element of integer nodes.
TetMesh oneElement();

}  // namespace tessera::hard_cases
