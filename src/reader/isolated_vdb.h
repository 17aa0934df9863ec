#pragma once

#include <string>
#include <vector>

#include "reader/isolated_reader.h"
#include "reader/serve_reader.h"
#include "reader/vdb_packet.h"
#include "refine/refine_options.h"
#include "vdb/sample_grids.h"

namespace tessera {

/// readVdb by askReader.
VdbFile readVdbIsolated(const IsolatedReader& reader, const std::string& path, VdbContents contents,
                        const IsolationLimits& limits, const Execution& execution);
/// readVdbLattice by askReader.
FixedFrame readVdbLatticeIsolated(const IsolatedReader& reader, const std::string& path,
                                  const IsolationLimits& limits, const Execution& execution);
/// sampleGrids by askReader. What it refers to must outlive it.
GridSampler isolatedGridSampler(const IsolatedReader& reader, const IsolationLimits& limits,
                                const Execution& execution);

/// The tasks of these functions, for the program that reads.
std::vector<ReaderTask> vdbTasks();

}  // namespace tessera
