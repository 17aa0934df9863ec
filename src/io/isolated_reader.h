#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "io/read_mesh.h"

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

/// Bounds on the reading process. 0 means one from the size of the file, see defaultLimits.
struct IsolationLimits {
    /// Address space beyond what the program takes when it starts, its threads included: it reads on fewer
    /// where their stacks would take more than an eighth.
    std::int64_t memoryBytes = 0;
    double seconds = 0;           ///< from its start to its last byte
    double processorSeconds = 0;  ///< of all its threads together; no bound where only `seconds` is given
};

/// Bounds for a mesh of this size on disk, its other parts and companion files included, each once: 640 MiB
/// and 96 bytes a byte of file, at most three quarters of the memory here; 3 s of processor time and a second
/// for every 4 MB, and ten times that, 60 s at least, until the end. Structured grids, which hold more cells
/// in fewer bytes, and files above 8 MB get more by the number of cells that they declare. Checks what a VTK
/// file declares. Throws InputError when the file is missing, empty or damaged at first sight.
IsolationLimits defaultLimits(const std::string& path, std::span<const std::string> otherParts = {});

/// readMesh in a process of its own, which takes crashes, endless loops and endless demands for memory with
/// it: they become an InputError that names the file and what happened. Errors, warnings and the mesh are
/// those of readMesh, bit for bit. The mesh comes back through memory that both share, and is checked. Throws
/// IoError when the process can't be started, std::bad_alloc when this one's own address space is too small.
MeshFile readMeshIsolated(const IsolatedReader& reader, const std::string& path, const ReadOptions& options,
                          const IsolationLimits& limits, const Execution& execution);

using MeshReader =
    std::function<MeshFile(const std::string& path, const ReadOptions& options, const Execution& execution)>;

/// The other side, to be called before anything else in the program that readMeshIsolated starts: bounds this
/// process, reads and reports. Returns the exit code; leave with it by _exit, as libraries have nothing to
/// tidy up. Throws InputError when it wasn't started by readMeshIsolated.
/// @param arguments those behind IsolatedReader::arguments.
int serveMeshReader(std::span<const std::string> arguments, const MeshReader& read = readMesh);

}  // namespace tessera
