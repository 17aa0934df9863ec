#include "compare/sampling_grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/check.h"
#include "resample/check_lattice.h"
#include "tessera/error.h"

namespace tessera {

namespace {

constexpr int kMostPoints = 1 << 20;

void checkBounds(const Box3d& bounds) {
    const Vec3d size = bounds.size();
    if (bounds.empty() || !(std::max({size.x, size.y, size.z}) > 0))
        throw InputError("the mesh has no extent to put lattice points in");
}

}  // namespace

SamplingGrid cubicGrid(const Box3d& boundsWorld, int pointsAlongLongest) {
    checkBounds(boundsWorld);
    if (pointsAlongLongest < 2) throw InputError("a lattice needs at least 2 points along the longest axis");
    const Vec3d size = boundsWorld.size();
    return cubicGridOfSpacing(boundsWorld,
                              std::max({size.x, size.y, size.z}) / double(pointsAlongLongest - 1));
}

SamplingGrid cubicGridOfSpacing(const Box3d& boundsWorld, double spacingWorld) {
    checkBounds(boundsWorld);
    checkSpacing(spacingWorld);
    SamplingGrid grid{Lattice::axisParallel(boundsWorld.min, spacingWorld), {}};
    for (int axis = 0; axis < 3; ++axis) {
        // The quotient's rounding must not cost the last point.
        const double steps = std::floor(boundsWorld.size()[axis] / spacingWorld * (1 + 1e-12));
        if (!(steps < kMostPoints))
            throw InputError("more than " + std::to_string(kMostPoints) +
                             " lattice points along one axis; choose a larger spacing");
        grid.points.max[axis] = int(steps) + 1;
    }
    return grid;
}

SamplingGrid spanningGrid(const Box3d& boundsWorld, const Vec3i& points) {
    checkBounds(boundsWorld);
    const Vec3d size = boundsWorld.size();
    for (int axis = 0; axis < 3; ++axis) {
        if (points[axis] < 2) throw InputError("a grid that spans the mesh needs at least 2 points an axis");
        if (!(size[axis] > 0))
            throw InputError("a grid that spans the mesh needs a mesh with an extent along every axis");
    }
    const Vec3d step = size / Vec3d(points - 1);
    return {{boundsWorld.min, {step.x, 0, 0}, {0, step.y, 0}, {0, 0, step.z}}, {Vec3i(0), points}};
}

std::vector<IndexBox> cutIntoBoxes(const IndexBox& points, int edge) {
    TESSERA_CHECK(edge > 0, "a box has an edge");
    std::vector<IndexBox> boxes;
    for (int z = points.min.z; z < points.max.z; z += edge)
        for (int y = points.min.y; y < points.max.y; y += edge)
            for (int x = points.min.x; x < points.max.x; x += edge) {
                const Vec3i low{x, y, z};
                boxes.push_back({low, glm::min(low + edge, points.max)});
            }
    return boxes;
}

}  // namespace tessera
