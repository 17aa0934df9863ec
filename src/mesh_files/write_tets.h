#pragma once

#include <string>

#include "tessera/mesh.h"

namespace tessera {

/// Writes the elements and fields as appended, zlib-compressed .vtu with points in double, for checks by
/// other programs. Atomic: nothing stands at `path` until the file is whole. Throws IoError.
void writeTets(const TetMesh& mesh, const std::string& path);

}  // namespace tessera
