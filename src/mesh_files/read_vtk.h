#pragma once

#include <string>

#include "mesh_files/raw_mesh.h"

namespace tessera {

/// Formats that VTK's readers know.
enum class VtkFormat { xml, legacy, exodus, cgns, ensight, openfoam };

struct RawSurface;

struct VtkSource;
using OpenVtkFormat = VtkSource (*)(const std::string& path, VtkFormat format, const ReadOptions& options);

/// Reads a file through VTK. Errors that VTK reports become InputError; nothing is printed.
/// @param openOther opens what is neither XML nor legacy; null: those throw OtherFormatError.
RawMesh readVtk(const std::string& path, VtkFormat format, const ReadOptions& options,
                const Execution& execution, OpenVtkFormat openOther);

/// Reads the 2D cells, or else the points, of an XML or a legacy file.
RawSurface readVtkSurface(const std::string& path, VtkFormat format, const ReadOptions& options,
                          const Execution& execution);

}  // namespace tessera
