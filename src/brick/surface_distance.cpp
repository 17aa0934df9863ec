#include "brick/surface_distance.h"

#include <algorithm>
#include <cstddef>

#include "base/floor_div.h"
#include "base/parallel.h"
#include "brick/closed_coverage.h"

namespace tessera {

namespace {

/// The inverse of Block::offset().
Vec3i pointAt(const IndexBox& box, std::uint32_t offset) {
    const Vec3i size = box.size();
    const int n = int(offset);
    return box.min + Vec3i(n % size.x, n / size.x % size.y, n / (size.x * size.y));
}

}  // namespace

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

SurfacePoints measureSurface(const NearestOnDemand& nearest, const Lattice& lattice, const IndexBox& box,
                             const std::vector<std::uint8_t>& coverage) {
    SurfacePoints points;
    const std::vector<std::uint32_t> corners = cornersAtSurface(coverage, box.size());
    if (corners.empty()) return points;
    const double spacing = lattice.uWorld.x;
    // Between a corner in the mesh and one that isn't the surface lies, a cell's diagonal away at most. But
    // by the seam rule a corner may not be covered that is in the mesh.
    const double reach = 1.75 * spacing;
    const std::vector<double> distances =
        nearest.get().distances({lattice.originWorld, spacing, box.min, box.size()}, corners, reach);
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const double distance = distances[i] < reach
                                    ? distances[i] / spacing
                                    : distanceFromSurface(nearest, lattice, pointAt(box, corners[i]));
        points.add(corners[i], coverage[corners[i]] != 0 ? distance : -distance);
    }
    return points;
}

double distanceFromSurface(const NearestOnDemand& nearest, const Lattice& lattice, const Vec3i& p) {
    const double spacing = lattice.uWorld.x;
    const NearestPoint found =
        nearest.get().find(lattice.worldFromIndex(Vec3d(p)), kFarFromSurface * spacing);
    return found.element < 0 ? kFarFromSurface : found.distanceWorld / spacing;
}

void measureSurface(const BrickTree& tree, BrickStore& store, const Reconstruction& reconstruction,
                    const NearestOnDemand& nearest, const KeptPoints& kept, const Execution& execution) {
    struct Measured {
        BrickKey point;  // a level and a lattice point
        float distance;
    };
    const ClosedCoverage coverage(tree, store, reconstruction, execution);
    std::vector<std::vector<Measured>> found(tree.leafCount());
    parallelFor(execution, std::int64_t(tree.leafCount()), [&](std::int64_t i) {
        const auto leaf = std::size_t(i);
        if (coverage.isSurelyWhole(leaf)) return;
        const int level = tree.leaves()[leaf].level;
        const IndexBox box = tree.closedPoints(tree.leaves()[leaf]);
        const SurfacePoints points = measureSurface(nearest, tree.lattice(level), box, coverage.of(leaf));
        for (const auto& point : points.all())
            reconstruction.visitCorners(level, pointAt(box, point.first), [&](int at, const Vec3i& corner) {
                if (at == level) return found[leaf].push_back({{at, corner}, point.second});
                const double distance = distanceFromSurface(nearest, tree.lattice(at), corner);
                found[leaf].push_back(
                    {{at, corner}, float(reconstruction.isCovered(at, corner) ? distance : -distance)});
            });
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
