#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "mesh/tet_mesh.h"

namespace tessera {

/// Bounding volume hierarchy over elements of a mesh: which elements can touch a box or contain a point.
/// Built once per mesh; thread-safe after construction.
class ElementIndex {
  public:
    explicit ElementIndex(const TetMesh& mesh, int threads = 0);
    ~ElementIndex();
    /// Appends every element whose bounding box meets the closed box, ascending.
    void query(const Box3d& boxWorld, std::vector<std::int32_t>& elements) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
