#pragma once

#include <optional>
#include <string>
#include <vector>

#include "job/job.h"
#include "job/run_report.h"
#include "mesh/repair.h"

namespace tessera {

/// What `tessera info` is asked for.
struct DescribeRequest {
    std::vector<std::string>
        paths;          ///< a .vdb file, a mesh, or a series as listSeries takes it; may be empty
    int timeStep = -1;  ///< ReadOptions::timeStep
    std::optional<RepairOptions> repair;  ///< of a mesh: shows what a repair would do
    bool gl = false;                      ///< what OpenGL there is, too
    bool limits = false;                  ///< what a process that reads files is kept from, too
};

/// Whether the name is that of a .vdb file.
bool isVdbName(const std::string& path);

/// Says what the files hold, and gives the same as a document when the job's is to be written. Throws
/// InputError.
Json describeFiles(const DescribeRequest& request, Job& job);

}  // namespace tessera
