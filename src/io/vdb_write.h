#pragma once

#include <string>
#include <vector>

#include "io/openvdb_grids.h"
#include "io/vdb_file.h"

namespace tessera {

/// The grids that writeVdb writes, as OpenVDB's own grids in memory, for writers of formats that are made
/// from those. Throws as writeVdb does, and frees the store's tiles on the way.
/// @param written gets the unit and the notes.
openvdb::GridPtrVec buildVdbGrids(const std::vector<OutputField>& fields, BrickResult& result,
                                  const VdbWriteOptions& options, VdbWriteResult& written,
                                  const Execution& execution);

}  // namespace tessera
