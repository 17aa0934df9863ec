#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "mesh_files/read_mesh.h"
#include "reader/reader_limits.h"

namespace tessera {

/// The programs that read in a process of their own.
struct IsolatedReader {
    /// One that calls serveMeshReader with the arguments it finds behind these.
    std::string executable;
    std::vector<std::string> arguments;
    /// One that is tried before it, as tessera_read_mesh: it reads the common formats alone (readCommonMesh),
    /// and so starts ten times faster. It is given the request alone. Empty: none; one that can't be used is
    /// left out.
    std::string quickExecutable{};
};

/// The built or installed tessera_read_mesh that belongs to a tessera program; empty when there is none.
std::string quickReaderBeside(const std::string& executable);

/// readMesh in a process of its own, which takes crashes, endless loops and endless demands for memory with
/// it: they become an InputError that names the file and what happened. Errors, warnings and the mesh are
/// those of readMesh, bit for bit. The mesh comes back through memory that both share, and is checked. Throws
/// IoError when the process can't be started, std::bad_alloc when this one's own address space is too small.
MeshFile readMeshIsolated(const IsolatedReader& reader, const std::string& path, const ReadOptions& options,
                          const IsolationLimits& limits, const Execution& execution);

}  // namespace tessera
