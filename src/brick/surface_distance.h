#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "brick/brick_store.h"
#include "brick/brick_tree.h"
#include "brick/kept_points.h"
#include "brick/seams.h"
#include "tessera/execution.h"
#include "tessera/lattice.h"

namespace tessera {

/// Signed distances from the mesh's surface are counted in voxels of a point's lattice, above 0 in the mesh,
/// and go no further than this: twice the diagonal of a cell, so that what a coarser brick interpolates on a
/// border lies within too.
inline constexpr double kFarFromSurface = 3.5;

/// The signed distances of the points of a brick's closed box that lie at cells which the surface runs
/// through.
class SurfacePoints {
  public:
    /// @param offset in the closed box, each above the one before.
    void add(std::uint32_t offset, double distanceVoxels) {
        points_.emplace_back(offset, float(std::clamp(distanceVoxels, -kFarFromSurface, kFarFromSurface)));
    }
    /// Null for a point that has none.
    const float* find(std::size_t offset) const {
        const auto at =
            std::lower_bound(points_.begin(), points_.end(), std::uint32_t(offset),
                             [](const auto& point, std::uint32_t wanted) { return point.first < wanted; });
        return at != points_.end() && at->first == offset ? &at->second : nullptr;
    }
    /// Offsets and distances.
    const std::vector<std::pair<std::uint32_t, float>>& all() const { return points_; }

  private:
    std::vector<std::pair<std::uint32_t, float>> points_;
};

/// The offsets of all corners of cells that have covered corners and others, ascending.
/// @param coverage of a box of so many points, x fastest: 0 where one isn't covered.
std::vector<std::uint32_t> cornersAtSurface(const std::vector<std::uint8_t>& coverage, const Vec3i& size);

/// How far a point is from the mesh's boundary, in voxels, at most kFarFromSurface.
/// @param lattice axis-parallel, of one spacing.
double distanceFromSurface(const NearestOnDemand& nearest, const Lattice& lattice, const Vec3i& p);

/// The signed distances of those points of a box. @param lattice axis-parallel, of one spacing.
SurfacePoints measureSurface(const NearestOnDemand& nearest, const Lattice& lattice, const IndexBox& box,
                             const std::vector<std::uint8_t>& coverage);

/// Gives the store the distances of all points that reading where the mesh ends needs: corners of cells at
/// the surface, and where those lie on the border to a coarser leaf what they are interpolated from. What was
/// there before goes. @param reconstruction of this tree and store. @param kept no other point gets one.
void measureSurface(const BrickTree& tree, BrickStore& store, const Reconstruction& reconstruction,
                    const NearestOnDemand& nearest, const KeptPoints& kept, const Execution& execution);

}  // namespace tessera
