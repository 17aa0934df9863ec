#pragma once

#include <string>

#include "mesh_files/raw_mesh.h"

namespace tessera {

/// Merges the blocks, their points that have one number, and the parts; drops nodes that no cell uses, splits
/// the cells, carries the fields over and fills the statistics. Throws InputError.
MeshFile assembleMesh(const std::string& path, RawMesh raw, const ReadOptions& options,
                      const Execution& execution);

}  // namespace tessera
