#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "tessera/mesh.h"

namespace tessera {

/// The mesh point nearest to a place outside the mesh, as a blend of nodes of one element.
struct NearestPoint {
    std::int32_t element = -1;            ///< -1: none within the given distance
    std::array<std::int32_t, 3> nodes{};  ///< boundary face
    std::array<double, 3> weights{};      ///< in [0, 1], sum 1
    double distanceWorld = 0;

    /// The field's value there; NaN when it depends on a value that isn't finite.
    double value(const Field& field, int component) const;
};

/// Finds nearest points on the mesh boundary with a bounding volume hierarchy over the boundary faces. Ties
/// go to the lowest element index, so results never depend on threads. Thread-safe after construction.
class NearestPointIndex {
  public:
    explicit NearestPointIndex(const TetMesh& mesh, int threads = 0);
    ~NearestPointIndex();
    /// @param maxDistanceWorld faces further away need not be found.
    NearestPoint find(const Vec3d& pointWorld, double maxDistanceWorld) const;
    /// Points originWorld + spacingWorld (i, j, k), (i, j, k) from `first` on.
    struct PointGrid {
        Vec3d originWorld{0};
        double spacingWorld = 1;
        Vec3i first{0}, size{0};
    };
    /// How far points of a grid are from the boundary, in world units: `reachWorld` where that is further.
    /// @param offsets of the points among all of the grid, x fastest.
    std::vector<double> distances(const PointGrid& grid, std::span<const std::uint32_t> offsets,
                                  double reachWorld) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
