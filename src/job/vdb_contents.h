#pragma once

#include <string>

#include "tessera/vec.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// Box of the covered lattice points; empty when there is none.
Box3d coveredBounds(const VdbFile& file);

/// A field by its name, or the first for an empty one. Throws InputError that lists the names there are.
const OutputField& chooseField(const VdbFile& file, const std::string& name);

}  // namespace tessera
