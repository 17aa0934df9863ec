#pragma once

#include <vector>

#include "tessera/lattice.h"
#include "tessera/vec.h"

namespace tessera {

/// A lattice and the points of it that are sampled.
struct SamplingGrid {
    Lattice lattice;
    IndexBox points;
};

/// Points of one spacing from the lower corner of the bounds on, all within them; along the longest axis
/// there are `pointsAlongLongest`, so the first and the last lie on the bounds. Throws InputError for bounds
/// that are empty or a single point, or fewer than 2 points.
SamplingGrid cubicGrid(const Box3d& boundsWorld, int pointsAlongLongest);
/// The same with a given spacing. Throws InputError too when an axis would take more than 2^20 points.
SamplingGrid cubicGridOfSpacing(const Box3d& boundsWorld, double spacingWorld);
/// `points` along each axis, the first and the last on the bounds: the voxels are boxes. Throws InputError
/// for bounds without volume or fewer than 2 points.
SamplingGrid spanningGrid(const Box3d& boundsWorld, const Vec3i& points);

/// The box in parts of at most `edge` points an axis, x fastest.
std::vector<IndexBox> cutIntoBoxes(const IndexBox& points, int edge);

}  // namespace tessera
