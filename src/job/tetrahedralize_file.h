#pragma once

#include <string>

#include "job/field_selection.h"
#include "job/job.h"
#include "job/run_report.h"
#include "mesh/shape_statistics.h"
#include "surface/tetrahedralize_options.h"

namespace tessera {

/// What `tessera-tetrahedralize` is asked for.
struct TetrahedralizeRequest {
    std::string input, output;        ///< output: a .vtu file; "-": standard output
    std::vector<FieldChoice> fields;  ///< to carry over, with their new names; empty: all
    TetrahedralizeOptions options;
};

struct TetrahedralizeResult {
    MeshFile mesh;
    ShapeStatistics shapes;
    double volumeWorld = 0;
    double makeMs = 0, writeMs = 0;
};

/// Has the job's tetrahedralizer make tetrahedra of a surface or points. Throws InputError where there is
/// none, and as tetrahedralizeIsolated does.
MeshFile makeTetrahedra(const std::string& path, const ReadOptions& read,
                        const TetrahedralizeOptions& options, Job& job);

/// The same, and writes them. Throws IoError too.
TetrahedralizeResult tetrahedralizeFile(const TetrahedralizeRequest& request, Job& job);
Json tetrahedralizeJson(const TetrahedralizeRequest& request, const TetrahedralizeResult& result,
                        const Job& job);

}  // namespace tessera
