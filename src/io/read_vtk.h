#pragma once

#include "io/raw_mesh.h"

namespace tessera {

/// Formats that VTK's readers know.
enum class VtkFormat { xml, legacy, exodus, cgns, ensight, openfoam };

/// Reads a file through VTK. Errors that VTK reports become InputError; nothing is printed.
RawMesh readVtk(const std::string& path, VtkFormat format, const ReadOptions& options,
                const Execution& execution);

}  // namespace tessera
