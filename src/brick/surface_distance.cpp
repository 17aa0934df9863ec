#include "brick/surface_distance.h"

#include <algorithm>
#include <cstddef>

#include "base/floor_div.h"
#include "base/parallel.h"
#include "brick/closed_coverage.h"

namespace tessera {

std::vector<std::uint32_t> cornersAtSurface(const std::vector<std::uint8_t>& coverage, const Vec3i& size) {
    const auto isCovered = [](std::uint8_t covered) { return covered != 0; };
    if (std::all_of(coverage.begin(), coverage.end(), isCovered) ||
        std::none_of(coverage.begin(), coverage.end(), isCovered))
        return {};
    const auto row = std::size_t(size.x), plane = row * std::size_t(size.y);
    // Bit 0: some corner of the cell above the point is covered; bit 1: some isn't. Axis by axis.
    std::vector<std::uint8_t> met(coverage.size());
    std::transform(coverage.begin(), coverage.end(), met.begin(),
                   [&](std::uint8_t covered) { return std::uint8_t(isCovered(covered) ? 1 : 2); });
    for (const std::size_t step : {std::size_t(1), row, plane})
        for (std::size_t p = 0; p + step < met.size(); ++p) met[p] |= met[p + step];
    // The last point of an axis begins no cell.
    std::vector<std::uint8_t> isCorner(coverage.size(), 0);
    for (std::size_t z = 0; z + 1 < std::size_t(size.z); ++z)
        for (std::size_t y = 0; y + 1 < std::size_t(size.y); ++y)
            for (std::size_t x = 0; x + 1 < row; ++x) {
                const std::size_t p = z * plane + y * row + x;
                if (met[p] != 3) continue;
                for (std::size_t c = 0; c < 8; ++c)
                    isCorner[p + (c & 1) + (c >> 1 & 1) * row + (c >> 2) * plane] = 1;
            }
    std::vector<std::uint32_t> corners;
    for (std::size_t p = 0; p < isCorner.size(); ++p)
        if (isCorner[p]) corners.push_back(std::uint32_t(p));
    return corners;
}

SurfacePoints measureSurface(const NearestPointIndex& nearest, const Lattice& lattice, const IndexBox& box,
                             const std::vector<std::uint8_t>& coverage) {
    const std::vector<std::uint32_t> corners = cornersAtSurface(coverage, box.size());
    const double spacing = lattice.uWorld.x;
    // Between a corner in the mesh and one that isn't the surface lies, a cell's diagonal away at most. But
    // by the seam rule a corner may not be covered that is in the mesh.
    const double reach = 1.75 * spacing;
    const Vec3i size = box.size();
    const std::vector<double> distances =
        nearest.distances({lattice.originWorld, spacing, box.min, size}, corners, reach);
    SurfacePoints points;
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const int n = int(corners[i]);
        const Vec3i p = box.min + Vec3i(n % size.x, n / size.x % size.y, n / (size.x * size.y));
        const double distance =
            distances[i] < reach ? distances[i] / spacing : distanceFromSurface(nearest, lattice, p);
        points.add(corners[i], coverage[corners[i]] != 0 ? distance : -distance);
    }
    return points;
}

double distanceFromSurface(const NearestPointIndex& nearest, const Lattice& lattice, const Vec3i& p) {
    const double spacing = lattice.uWorld.x;
    const NearestPoint found = nearest.find(lattice.worldFromIndex(Vec3d(p)), kFarFromSurface * spacing);
    return found.element < 0 ? kFarFromSurface : found.distanceWorld / spacing;
}

namespace {

/// A level, a lattice point and its distance.
struct Measured {
    BrickKey point;
    float distance;
};

/// Finds what the cells of leaves need.
class SurfaceSearch {
  public:
    SurfaceSearch(const BrickTree& tree, const Reconstruction& reconstruction,
                  const NearestPointIndex& nearest)
        : tree_(tree), reconstruction_(reconstruction), nearest_(nearest) {}

    std::vector<Measured> search(const BrickKey& leaf, const std::vector<std::uint8_t>& coverage) const {
        const IndexBox box = tree_.closedPoints(leaf);
        const Vec3i size = box.size();
        const SurfacePoints points = measureSurface(nearest_, tree_.lattice(leaf.level), box, coverage);
        std::vector<Measured> found;
        for (const auto& [offset, distance] : points.all()) {
            const int n = int(offset);
            const Vec3i p = box.min + Vec3i(n % size.x, n / size.x % size.y, n / (size.x * size.y));
            if (!addSources({leaf.level, p}, found)) found.push_back({{leaf.level, p}, distance});
        }
        return found;
    }

  private:
    /// Of a point that is interpolated in a coarser leaf; false when it isn't.
    bool addSources(const BrickKey& point, std::vector<Measured>& found) const {
        const int coarse = reconstruction_.coarserLevelAt(point.level, point.index);
        if (coarse < 0) return false;
        const int step = 1 << (coarse - point.level);
        const Vec3i cell = floorDiv(point.index, step);
        const Vec3d t = Vec3d(point.index - cell * step) / double(step);
        for (int c = 0; c < 8; ++c) {
            const BrickKey corner{coarse, cell + cornerOffset(c)};
            if (cornerWeight(t, c) > 0 && !addSources(corner, found))
                found.push_back({corner, distanceOf(corner)});
        }
        return true;
    }
    float distanceOf(const BrickKey& point) const {
        const double distance = distanceFromSurface(nearest_, tree_.lattice(point.level), point.index);
        return float(reconstruction_.isCovered(point.level, point.index) ? distance : -distance);
    }

    const BrickTree& tree_;
    const Reconstruction& reconstruction_;
    const NearestPointIndex& nearest_;
};

}  // namespace

void measureSurface(const BrickTree& tree, BrickStore& store, const Reconstruction& reconstruction,
                    const NearestPointIndex& nearest, const KeptPoints& kept, const Execution& execution) {
    const ClosedCoverage coverage(tree, store, reconstruction, execution);
    const SurfaceSearch search(tree, reconstruction, nearest);
    std::vector<std::vector<Measured>> found(tree.leafCount());
    parallelFor(execution, std::int64_t(tree.leafCount()), [&](std::int64_t i) {
        const auto leaf = std::size_t(i);
        if (!coverage.isSurelyWhole(leaf))
            found[leaf] = search.search(tree.leaves()[leaf], coverage.of(leaf));
    });
    store.surface().clear();
    for (const std::vector<Measured>& ofLeaf : found)
        for (const Measured& at : ofLeaf) {
            if (!kept.keeps(at.point.level, at.point.index)) continue;
            Tile& tile = store.surface()[{at.point.level, floorDiv(at.point.index, kTileSize)}];
            if (!tile.values) tile.values = std::make_unique<float[]>(kTilePoints);
            tile.cover(offsetInTile(at.point.index));
            tile.values[std::size_t(offsetInTile(at.point.index))] = at.distance;
        }
}

}  // namespace tessera
