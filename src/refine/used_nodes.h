#pragma once

#include <cstdint>
#include <vector>

#include "tessera/execution.h"
#include "tessera/mesh.h"

namespace tessera {

/// One byte a node: 1 where some element, flat or not, uses it.
std::vector<std::uint8_t> usedNodes(const TetMesh& mesh, const Execution& execution);
/// The same for elements that aren't flat.
std::vector<std::uint8_t> nodesOfVolumes(const TetMesh& mesh, const Execution& execution);

}  // namespace tessera
