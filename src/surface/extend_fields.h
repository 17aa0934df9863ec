#pragma once

#include <vector>

#include "tessera/mesh.h"

namespace tessera {

/// Fills the values of point fields at nodes that have none by those at the others: the harmonic function, by
/// linear elements, which is smooth, stays within the range of what is known, and of a linear function makes
/// the same linear function. Values that aren't finite stay where they are and have no part in it.
/// @param isKnown of every node.
void extendFields(TetMesh& mesh, const std::vector<char>& isKnown);

}  // namespace tessera
