#pragma once

#include <optional>
#include <string>
#include <vector>

#include "job/field_selection.h"
#include "mesh/repair.h"
#include "mesh_files/mesh_series.h"
#include "refine/refine_options.h"
#include "vdb/output_formats.h"
#include "vdb/shape_output.h"
#include "vdb/vdb_file.h"

namespace tessera {

/// What `tessera resample` is asked for. What depends on a mesh (field indices, memory left for samples) is
/// found out when there is one.
struct ResampleRequest {
    std::vector<std::string> inputs;  ///< meshes, patterns, or a .pvd file, as listSeries takes them
    std::string output;  ///< of a series with a place for the step's number, see numberedName; "-": standard
                         ///< output; may be empty in a dry run
    const OutputFormat* format = nullptr;  ///< of the output
    std::optional<TimeRange> times;        ///< only these steps of a .pvd file
    int timeStep = -1;                     ///< ReadOptions::timeStep; of a .pvd file the step
    bool dryRun = false;                   ///< tells what would be written, and writes nothing
    std::optional<RepairOptions> repair;
    std::string algorithm = "software";    ///< or "auto"
    RefineOptions refine;                  ///< all but errorFields; maxMemoryBytes: of the whole run
    std::string log;                       ///< keeps the bricks of a run that may be killed; empty: none
    std::string like;                      ///< a .vdb file whose lattice is taken; empty: none
    std::vector<FieldChoice> fields;       ///< empty: all
    std::vector<std::string> errorFields;  ///< that the error bound holds for; empty: all chosen point fields
    std::string program;                   ///< whose names grids get, see nameFields; empty: none
    VdbWriteOptions write;                 ///< all but what depends on the mesh and the rest of this
    OutputShape shape;
};

}  // namespace tessera
