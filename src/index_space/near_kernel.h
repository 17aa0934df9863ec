#pragma once

#include <cstdint>
#include <span>

#include "index_space/node_frame.h"
#include "tessera/lattice.h"
#include "tessera/mesh.h"

namespace tessera {

inline constexpr int kNearBatch = 64;  ///< elements looked at in one call

/// Cubes of lattice points whose edges are powers of two, in rows along x, y and z from the first point of a
/// box on.
struct NearGrid {
    IndexBox box;
    Vec3i shift{0}, cells{1};  ///< log2 of the edge; cubes along each axis

    Vec3i cellOf(const Vec3i& p) const {
        return {(p.x - box.min.x) >> shift.x, (p.y - box.min.y) >> shift.y, (p.z - box.min.z) >> shift.z};
    }
    std::int32_t index(const Vec3i& cell) const { return (cell.z * cells.y + cell.y) * cells.x + cell.x; }
};

/// Elements whose bounding boxes hold lattice points.
struct NearElements {
    static constexpr int kRoom = kNearBatch + 16;  ///< vectors are stored whole
    int count;
    alignas(64) std::int32_t element[kRoom];
    alignas(64) std::int32_t low[3][kRoom], high[3][kRoom];  ///< first and last of these points on each axis
    alignas(64) std::int32_t cell[kRoom];                    ///< that holds them all; -1 where there is none
};

/// Which elements are near.
struct NearTest {
    float marginVoxels = 0;  ///< bounding boxes are widened by this, besides their slight widening
    /// Also leaves out those of which simple precision tells surely that they lie between the lattice points
    /// of their boxes, if these are eight at most: more than 2^-26 voxel away from them.
    bool dropsBetween = false;
};

/// Those of the elements first, first + 1, ..., first + count - 1 (kNearBatch at most) whose bounding boxes,
/// widened by the rounding of their nodes, hold a lattice point of the grid's box; ascending.
void findNear(const TetMesh& mesh, std::span<const NodeFrame::Rough> rough, std::int64_t first, int count,
              const NearGrid& grid, const NearTest& test, NearElements& near);

}  // namespace tessera
