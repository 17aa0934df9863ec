#include "mesh_files/read_mesh.h"

#include "mesh_files/read_by_format.h"
#include "mesh_files/solver_formats.h"

namespace tessera {

MeshFile readMesh(const std::string& path, const ReadOptions& options, const Execution& execution) {
    return readByFormat(path, options, execution, openSolverFormat);
}

}  // namespace tessera
