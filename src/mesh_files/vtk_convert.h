#pragma once

#include "mesh_files/raw_mesh.h"

class vtkDataObject;

namespace tessera {

/// Appends what VTK read, a data set or any composite of them, to `raw`, checking every index before it is
/// used. Throws InputError.
/// @param nodeIds the array for RawBlock::nodeIds, which is no field then; empty: none.
void appendVtkData(const std::string& path, vtkDataObject* data, const std::string& nodeIds,
                   const ReadOptions& options, const Execution& execution, RawMesh& raw);

}  // namespace tessera
