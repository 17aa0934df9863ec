#pragma once

#include "mesh_files/raw_mesh.h"
#include "mesh_files/raw_surface.h"

class vtkDataObject;

namespace tessera {

/// Appends what VTK read, a data set or any composite of them, to `raw`, checking every index before it is
/// used. Throws InputError.
/// @param nodeIds the array for RawBlock::nodeIds, which is no field then; empty: none.
void appendVtkData(const std::string& path, vtkDataObject* data, const std::string& nodeIds,
                   const ReadOptions& options, const Execution& execution, RawMesh& raw);

/// The 2D cells of a data set that VTK read, with its points and fields. Throws InputError where it is none,
/// or has 3D cells.
RawSurface surfaceOf(const std::string& path, vtkDataObject* data, const ReadOptions& options,
                     const Execution& execution);

}  // namespace tessera
