#pragma once

#include <string>

#include "mesh_files/read_vtk.h"

namespace tessera {

/// Opens the formats of simulation programs: Exodus, CGNS, EnSight, OpenFOAM. It stands alone because a
/// program that doesn't refer to it needn't load their libraries, which takes a tenth of a second. Throws
/// InputError.
VtkSource openSolverFormat(const std::string& path, VtkFormat format, const ReadOptions& options);

}  // namespace tessera
