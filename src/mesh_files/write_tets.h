#pragma once

#include <string>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// Writes the elements and fields as appended, zlib-compressed .vtu with points in double, for other programs
/// and for readers here, which take such files fastest. Atomic: nothing stands at `path` until the file is
/// whole. The bytes don't depend on the number of threads. Throws IoError.
void writeTets(const TetMesh& mesh, const std::string& path, const Execution& execution);

}  // namespace tessera
