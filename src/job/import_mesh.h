#pragma once

#include <optional>
#include <string>

#include "job/job.h"
#include "mesh/repair.h"
#include "mesh_files/read_mesh.h"

namespace tessera {

/// A mesh as a job works on it: read, and repaired when that is wanted.
struct ImportedMesh : MeshFile {
    std::optional<RepairOptions> repairOptions;  ///< none: it was taken as it is
    RepairReport repair;
    double repairMs = 0;
    Box3d boundsWorld;  ///< TetMesh::boundsWorld()
};

/// Reads a mesh as the job is to read them; of a .pvd file the step that the options name. Throws as readMesh
/// and readMeshIsolated do.
MeshFile openMesh(const std::string& path, const ReadOptions& options, Job& job);

/// The same, and repairs it. Throws InputError too when the repair leaves no element.
ImportedMesh importMesh(const std::string& path, const ReadOptions& read,
                        const std::optional<RepairOptions>& repair, Job& job);

}  // namespace tessera
