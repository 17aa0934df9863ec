#pragma once

#include <string>
#include <vector>

#include "refine/brick_result.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// Throws InputError for options that a NanoVDB file can't follow: half floats (its 16-bit grids divide the
/// range of every leaf node into steps instead).
void checkNvdbOptions(const VdbWriteOptions& options);

/// Writes a flat grid as NanoVDB: the grids of writeVdb with their names, transforms and active voxels, the
/// coverage as a mask grid, compressed with Blosc. The file holds no metadata. Frees the store's tiles on the
/// way. Nothing stands at `path` until the file is whole. Throws as writeVdb does. The same bytes for any
/// number of threads.
VdbWriteResult writeNvdb(const std::string& path, const std::vector<OutputField>& fields, BrickResult& result,
                         const VdbWriteOptions& options, const Execution& execution);

}  // namespace tessera
