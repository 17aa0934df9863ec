#pragma once

#include <optional>
#include <string>

#include "job/import_mesh.h"
#include "job/run_report.h"

namespace tessera {

/// What `tessera tets` is asked for.
struct TetsRequest {
    std::string input, output;  ///< output: a .vtu file; "-": standard output
    int timeStep = -1;          ///< ReadOptions::timeStep
    std::optional<RepairOptions> repair;
};

struct TetsResult {
    ImportedMesh mesh;
    StageTimes times;
};

/// Writes the tetrahedra that a mesh is split into. Throws InputError and IoError.
TetsResult exportTets(const TetsRequest& request, Job& job);
Json tetsJson(const TetsRequest& request, const TetsResult& result);

}  // namespace tessera
