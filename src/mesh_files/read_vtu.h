#pragma once

#include <optional>
#include <string>

#include "mesh_files/raw_mesh.h"

namespace tessera {

/// Reads the plainest form of .vtu file, which large ones often have: one piece of tetrahedra, the arrays
/// appended as raw bytes, packed by zlib or not at all. Its blocks are unpacked in parallel, and checked and
/// converted while they are in the processor's cache. Gives what VTK's reader gives, with the same values.
/// Nothing for a file of another form, or where anything is amiss: VTK's reader, which knows all forms, then
/// reads it or says what is wrong. Throws InputError where the file can't be read at all.
std::optional<RawMesh> readPlainVtu(const std::string& path, const ReadOptions& options,
                                    const Execution& execution);

}  // namespace tessera
