#pragma once

#include "mesh_files/read_mesh.h"
#include "mesh_files/read_vtk.h"

namespace tessera {

/// readMesh, with what opens formats other than VTK XML, legacy VTK and TetGen.
MeshFile readByFormat(const std::string& path, const ReadOptions& options, const Execution& execution,
                      OpenVtkFormat openOther);

}  // namespace tessera
