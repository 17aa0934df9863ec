#pragma once

#include <cstdint>

#include "mesh/tet_mesh.h"
#include "software/node_frame.h"

namespace tessera {

/// How deep a lattice point lies in one element: the distance in voxels to its nearest face plane, negative outside. It decides which element owns a
/// point that several cover: the deepest, and the lower index of equals.
///
/// A function of element and point alone, the same bits wherever it is called; accurate to 2^-14 voxel.
class ElementDepth {
  public:
    ElementDepth(const TetMesh& mesh, const NodeFrame& frame, std::int32_t element);
    double at(const Vec3i& point) const;

  private:
    bool thin_ = false;      // below the reach of the arithmetic: such an element is nowhere deep
    double base_[3] = {};    // the element's first voxel
    double normal_[4][3];    // inward unit normals
    double offset_[4];
};

}  // namespace tessera
