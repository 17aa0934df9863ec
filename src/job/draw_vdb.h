#pragma once

#include <array>
#include <optional>
#include <string>

#include "job/job.h"
#include "job/run_report.h"
#include "mesh/field_range.h"
#include "tessera/vec.h"

namespace tessera {

/// What `tessera picture` is asked for: one slice of a .vdb file as a .png.
struct DrawRequest {
    std::string input, output;         ///< output: a .png file; "-": standard output
    std::string field;                 ///< empty: the first
    std::string mesh;                  ///< the file's mesh: draws up to its surface; empty: whole voxels
    int axis = 2;                      ///< the slice is normal to it
    std::optional<double> at;          ///< where along that axis, world units; none: the middle
    std::optional<int> component;      ///< of a vector; none: its length
    std::optional<Box3d> boundsWorld;  ///< shows only this box
    std::optional<std::array<double, 2>> range;  ///< values at the ends of the colour map
    int pixels = 800;                            ///< along the longer edge
    bool bricks = false;                         ///< draws the edges of the bricks
};

/// What was drawn.
struct DrawnSlice {
    std::string field;
    double positionWorld = 0;  ///< along the axis
    int width = 0, height = 0;
    ValueRange range;  ///< of what is shown
};

/// Throws InputError when there is nothing to draw, and IoError.
DrawnSlice drawVdb(const DrawRequest& request, Job& job);
Json drawnJson(const DrawRequest& request, const DrawnSlice& drawn);

}  // namespace tessera
