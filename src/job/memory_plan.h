#pragma once

#include <cstdint>

#include "tessera/mesh.h"
#include "tessera/resampler.h"

namespace tessera {

/// Bytes of a run that are shared out once its mesh is there.
struct MemoryShares {
    std::int64_t levelsBytes =
        0;                       ///< for samples: all there is, or half of it when a flat grid stands beside
    std::int64_t flatBytes = 0;  ///< half of it
    std::int64_t workBytes = 0;  ///< BindOptions::workBytes
};

/// What a bound on a run leaves once the program, the mesh and the work on it are paid for. Depends on
/// nothing but these numbers, so that a plan is the same on every machine. Throws InputError saying how much
/// would do when nothing is left.
/// @param maxMemoryBytes what --max-memory says; 0: defaultMemoryBytes().
/// @param work of the resampler, with the channels of all fields that are sampled.
MemoryShares shareMemory(std::int64_t maxMemoryBytes, const TetMesh& mesh, bool flat, const WorkMemory& work);

}  // namespace tessera
