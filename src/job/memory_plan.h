#pragma once

#include <cstdint>

#include "tessera/mesh.h"

namespace tessera {

/// Bytes for the samples of a run.
struct SampleBudget {
    std::int64_t levelsBytes = 0;  ///< all there is, or half of it when a flat grid stands beside the levels
    std::int64_t flatBytes = 0;    ///< half of it
};

/// What --max-memory leaves for samples once the program, the mesh and the work on it are paid for. Depends
/// on nothing but these numbers, so that a plan is the same on every machine. Throws InputError saying how
/// much would do when nothing is left.
/// @param channels components of all fields that are sampled.
SampleBudget sampleBudget(std::int64_t maxMemoryBytes, const TetMesh& mesh, int channels, bool flat);

}  // namespace tessera
