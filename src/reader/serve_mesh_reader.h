#pragma once

#include <functional>
#include <span>
#include <string>

#include "mesh_files/read_mesh.h"

namespace tessera {

using MeshReader =
    std::function<MeshFile(const std::string& path, const ReadOptions& options, const Execution& execution)>;

/// The other side of readMeshIsolated, to be called before anything else in the program that it starts:
/// bounds this process, reads and reports. Returns the exit code; leave with it by _exit, as libraries have
/// nothing to tidy up. Throws InputError when it wasn't started by readMeshIsolated.
/// @param arguments those behind IsolatedReader::arguments.
int serveMeshReader(std::span<const std::string> arguments, const MeshReader& read = readMesh);

}  // namespace tessera
