#pragma once

#include <cstdint>

#include "index_space/node_frame.h"
#include "tessera/mesh.h"

namespace tessera {

/// How deep a lattice point lies in one element: the distance in voxels to its nearest face plane, negative
/// outside. It decides which element owns a point that several cover: the one with the greatest rank, depth
/// in steps of 2^-13 voxel, and the lowest index of equals.
///
/// A function of element and point alone, the same bits wherever it is called; depth is accurate to 2^-15
/// voxel.
class ElementDepth {
  public:
    ElementDepth(const TetMesh& mesh, const NodeFrame& frame, std::int32_t element);
    double at(const Vec3i& point) const;
    double rank(const Vec3i& point) const;  ///< a whole number

  private:
    bool thin_ = false;    // below the reach of the arithmetic: such an element is nowhere deep
    double base_[3] = {};  // the element's first voxel
    double normal_[4][3];  // inward unit normals
    double offset_[4];
};

}  // namespace tessera
