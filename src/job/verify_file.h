#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "job/import_mesh.h"
#include "job/run_report.h"
#include "vdb/outside_reader.h"
#include "verify/check_voxels.h"

namespace tessera {

/// What `tessera verify` is asked for.
struct VerifyRequest {
    std::string meshPath, vdbPath;
    int timeStep = -1;  ///< ReadOptions::timeStep; -1 of a .pvd file: the step of the .vdb file's time
};

/// A figure that a file states, and what it is.
struct Claim {
    std::string field, figure;  ///< field: empty when it is of all
    double stated = 0, measured = 0, allowed = 0;
    bool holds() const;
};

/// How a .vdb file measures against the mesh that it was made from.
struct Verification {
    ImportedMesh mesh;  ///< repaired as the file's was
    std::vector<Claim> claims;
    ErrorReport measured;
    VoxelCheck voxels;
    OutsideReading reading;                 ///< as other programs see the file
    std::int64_t strayValues = 0;           ///< VdbFile::strayValues
    std::vector<std::string> gridProblems;  ///< VdbFile::gridProblems
    StageTimes times;
    bool holds() const;
};

/// Checks every voxel against the mesh, reads the grids as other programs do, measures the error anew and
/// compares it with what the file says. Throws InputError when the two don't belong together.
Verification verifyFile(const VerifyRequest& request, Job& job);
Json verifyJson(const VerifyRequest& request, const Verification& verification);

}  // namespace tessera
