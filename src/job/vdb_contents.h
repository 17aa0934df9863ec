#pragma once

#include <string>

#include "job/job.h"
#include "reader/vdb_packet.h"
#include "refine/refine_options.h"
#include "tessera/vec.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// Reads a .vdb file, in a process of its own where the job has one. Throws as readVdb does.
VdbFile openVdb(const std::string& path, VdbContents contents, const Job& job);
/// The same of readVdbLattice.
FixedFrame openVdbLattice(const std::string& path, const Job& job);

/// Box of the covered lattice points; empty when there is none.
Box3d coveredBounds(const VdbFile& file);

/// A field by its name, or the first for an empty one. Throws InputError that lists the names there are.
const OutputField& chooseField(const VdbFile& file, const std::string& name);

}  // namespace tessera
