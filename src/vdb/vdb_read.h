#pragma once

#include <string>

#include "refine/refine_options.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// OpenVDB believes what it reads, so a damaged file can end this process: programs call readVdbIsolated.
/// Throws InputError when the file is missing, damaged, no VDB file, or not written by Tessera
/// (`readVdbLattice` takes any VDB file). Points that are covered but not valid come back as NaN in all
/// components of the field.
VdbFile readVdb(const std::string& path);

/// Origin and finest spacing of any VDB file's first grid, in world units, for --like.
FixedFrame readVdbLattice(const std::string& path);

}  // namespace tessera
