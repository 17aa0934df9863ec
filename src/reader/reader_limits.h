#pragma once

#include <cstdint>
#include <string>

#include "mesh_files/read_mesh.h"

namespace tessera {

/// Bounds on the reading process. 0 means one from the size of the file, see defaultLimits.
struct IsolationLimits {
    /// Of the process and the one that asks it together, while it reads. It may take readingShare() of
    /// address space beyond what it takes when it starts, its threads included: it reads on fewer where their
    /// stacks would take more than an eighth.
    std::int64_t memoryBytes = 0;
    double seconds = 0;           ///< from its start to its last byte
    double processorSeconds = 0;  ///< of all its threads together; no bound where only `seconds` is given
};

/// What a bound leaves for reading: less what this process holds now, and what another takes when it starts.
std::int64_t readingShare(std::int64_t memoryBytes);

/// What a process hands over is no more than this part of its memory: it is copied from there.
inline constexpr std::int64_t kHandedOverShare = 2;

/// Bounds on looking at a file before its usual limits are known.
IsolationLimits limitsToLook();

/// Bounds for a mesh of this size on disk, its other parts and companion files included, each once: 640 MiB
/// and 96 bytes a byte of file, at most three quarters of the memory here; 3 s of processor time and a second
/// for every 4 MB, and ten times that, 60 s at least, until the end. Structured grids, which hold more cells
/// in fewer bytes, and files above 8 MB get more by the number of cells that they declare. Checks what a VTK
/// file declares. Throws InputError when the file is missing, empty or damaged at
/// first sight, or it or one that it names lies outside the folder that is allowed.
IsolationLimits defaultLimits(const std::string& path, const ReadOptions& options = {});

/// Bounds for a VDB file: 192 MiB and 96 bytes a byte of file, and times as for meshes.
IsolationLimits limitsOfVdb(const std::string& path);

}  // namespace tessera
