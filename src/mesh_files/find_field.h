#pragma once

#include <string>
#include <vector>

#include "tessera/mesh.h"

namespace tessera {

/// Index into mesh.fields of the field that is called so (isFieldCalled) among some of them: the point field
/// where a cell field has the name too. Throws InputError, listing those fields, when there is none.
int findField(const TetMesh& mesh, const std::vector<int>& among, const std::string& called);

}  // namespace tessera
