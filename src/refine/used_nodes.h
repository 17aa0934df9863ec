#pragma once

#include <cstdint>
#include <vector>

#include "base/execution.h"
#include "mesh/tet_mesh.h"

namespace tessera {

/// One byte a node: 1 where some element, flat or not, uses it.
std::vector<std::uint8_t> usedNodes(const TetMesh& mesh, const Execution& execution);

}  // namespace tessera
