#pragma once

#include <string>
#include <vector>

#include "refine/brick_result.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// Which of some grids are stored in half floats: those whose largest magnitude they can hold. The same
/// before and after rounding. One entry a grid of planGrids(fields).
std::vector<bool> gridsInHalf(const std::vector<OutputField>& fields, const BrickStore& store);

/// Rounds the values of some of those grids as their file will.
void roundToHalf(const std::vector<OutputField>& fields, const std::vector<bool>& toHalf, BrickStore& store,
                 const Execution& execution);

/// Writes the samples and their extension (layout: docs/vdb_layout.md) and frees the store's tiles. In the
/// flat layout the result comes from `flatten`. Nothing stands at `path` until the file is whole;
/// "-" is standard output. Throws IoError (not writable, disk full), InputError (a unit that OpenVDB can't
/// take, clashing names), Cancelled. The file depends on the arguments only: the same bytes for any number of
/// threads.
VdbWriteResult writeVdb(const std::string& path, const std::vector<OutputField>& fields, BrickResult& result,
                        const VdbWriteOptions& options, const Execution& execution);

}  // namespace tessera
