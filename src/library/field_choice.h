#pragma once

#include <string>
#include <vector>

#include "tessera/bricks.h"
#include "tessera/mesh.h"

namespace tessera {

/// Fields of a mesh that were chosen by name.
struct ChosenFields {
    /// Indices into mesh.fields.
    std::vector<int> fields;
    /// One for each, with a name that no other has.
    std::vector<BrickField> described;
    int channels = 0;
};

/// @param names none: all. Throws InputError, listing the fields there are, when one is missing or named
/// twice.
ChosenFields chooseFields(const TetMesh& mesh, const std::vector<std::string>& names);

}  // namespace tessera
