#pragma once

#include <cstdint>
#include <span>

#include "index_space/node_frame.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

inline constexpr int kNearBatch = 64;  ///< elements looked at in one call

/// Elements whose bounding boxes hold lattice points, and the first and the last of these points on every
/// axis.
struct NearElements {
    static constexpr int kRoom = kNearBatch + 16;  ///< vectors are stored whole
    int count;
    alignas(64) std::int32_t element[kRoom], low[3][kRoom], high[3][kRoom];
};

/// Those of the elements first, first + 1, ..., first + count - 1 (kNearBatch at most) whose bounding boxes,
/// widened by the rounding of their nodes and by the margin (voxels), hold a lattice point of `all`;
/// ascending.
/// @param dropsBetween leaves out those, too, of which simple precision tells surely that they lie between
/// the lattice points of their boxes: those are no further than 2^-26 voxel away from no point.
void findNear(const TetMesh& mesh, std::span<const NodeFrame::Rough> rough, std::int64_t first, int count,
              const IndexBox& all, float marginVoxels, bool dropsBetween, NearElements& near);

}  // namespace tessera
