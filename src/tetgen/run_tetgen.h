#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "surface/size_field.h"
#include "surface/surface.h"

namespace tessera {

/// What TetGen is given.
struct TetgenInput {
    std::span<const Vec3d> points;
    std::span<const std::array<std::int32_t, 3>> triangles;  ///< empty: the points' Delaunay mesh is wanted
    std::vector<Vec3d> holesWorld;
    std::vector<RegionSeed> regions;
    double quality = 0;             ///< bound on circumradius over shortest edge
    double minDihedralDegrees = 0;  ///< wished for
    bool splitsBoundary = false;
    const SizeField* size = nullptr;  ///< null: no wish
};

struct TetgenOutput {
    /// Those given in their order, then those added.
    std::vector<Vec3d> points;
    /// Positively oriented (volumeSign), but for rounding of points that were added.
    std::vector<std::array<std::int32_t, 4>> tets;
    /// Of every element the region it lies in: 1, 2, ... as the seeds are, then those without; empty for
    /// points.
    std::vector<double> regions;
    /// What became of the triangles given.
    struct Face {
        std::array<std::int32_t, 3> nodes;
        std::int32_t triangle;
    };
    std::vector<Face> faces;
};

/// Runs TetGen 1.5 in this process: it may crash, and never end. Throws InputError when TetGen refuses what
/// it is given, std::bad_alloc when it runs out of memory. One run at a time.
TetgenOutput runTetgen(const TetgenInput& input);

}  // namespace tessera
