#include "io/read_mesh.h"

#include "io/read_by_format.h"
#include "io/solver_formats.h"

namespace tessera {

MeshFile readMesh(const std::string& path, const ReadOptions& options, const Execution& execution) {
    return readByFormat(path, options, execution, openSolverFormat);
}

}  // namespace tessera
