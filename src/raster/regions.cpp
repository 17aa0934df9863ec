#include "raster/regions.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "base/floor_div.h"

namespace tessera {

namespace {

constexpr int kSmallestEdge = 32;
/// A region is cut when it holds this many times the points that are wanted.
constexpr std::int64_t kWaste = 3;

using Parts = std::vector<RasterRegion::Part>;

Vec3i cellOf(const Vec3i& point, const Vec3i& edge) {
    return {floorDiv(point.x, edge.x), floorDiv(point.y, edge.y), floorDiv(point.z, edge.z)};
}

struct CellOrder {
    bool operator()(const Vec3i& a, const Vec3i& b) const {
        return std::tie(a.z, a.y, a.x) < std::tie(b.z, b.y, b.x);
    }
};

void cutByCells(std::span<const RasterRegion::Part> parts, const Vec3i& edge,
                std::map<Vec3i, Parts, CellOrder>& cells) {
    for (const RasterRegion::Part& part : parts) {
        if (part.points.empty()) continue;
        const Vec3i low = cellOf(part.points.min, edge), high = cellOf(part.points.max - 1, edge);
        Vec3i cell;
        for (cell.z = low.z; cell.z <= high.z; ++cell.z)
            for (cell.y = low.y; cell.y <= high.y; ++cell.y)
                for (cell.x = low.x; cell.x <= high.x; ++cell.x) {
                    const Vec3i corner = cell * edge;
                    cells[cell].push_back({part.box, intersect(part.points, {corner, corner + edge})});
                }
    }
}

void planCells(std::span<const RasterRegion::Part> parts, const Vec3i& edge, std::int64_t maxPoints,
               std::vector<RasterRegion>& regions) {
    std::map<Vec3i, Parts, CellOrder> cells;
    cutByCells(parts, edge, cells);
    for (auto& [cell, ofCell] : cells) {
        RasterRegion region{ofCell.front().points, {}};
        std::int64_t wanted = 0;
        for (const RasterRegion::Part& part : ofCell) {
            region.points = {glm::min(region.points.min, part.points.min),
                             glm::max(region.points.max, part.points.max)};
            wanted += part.points.count();
        }
        const std::int64_t count = region.points.count();
        const int longest = std::max({edge.x, edge.y, edge.z});
        const bool isWasteful = count > kWaste * wanted && longest > kSmallestEdge;
        if ((count > maxPoints && count > 1) || isWasteful) {
            // The longest edge of the cell first, z before y before x: memory runs along x.
            Vec3i half = edge;
            int& cut = half.z == longest ? half.z : half.y == longest ? half.y : half.x;
            cut /= 2;
            planCells(ofCell, half, maxPoints, regions);
        } else {
            region.parts = std::move(ofCell);
            regions.push_back(std::move(region));
        }
    }
}

}  // namespace

Vec3i cellOrigin(const IndexBox& region) {
    return floorDiv(region.min, kCellEdge) * kCellEdge;
}

std::vector<RasterRegion> planRasterRegions(std::span<const IndexBox> boxes, std::int64_t maxPoints) {
    Parts parts;
    for (std::size_t b = 0; b < boxes.size(); ++b) parts.push_back({b, boxes[b]});
    std::vector<RasterRegion> regions;
    planCells(parts, Vec3i(kCellEdge), maxPoints, regions);
    return regions;
}

void cutRegion(RasterRegion region, std::int64_t pieces, std::vector<RasterRegion>& regions) {
    const Vec3i size = region.points.size();
    const int longest = std::max({size.x, size.y, size.z});
    if (pieces <= 1 || longest < 2 * kShortestEdge) {
        regions.push_back(std::move(region));
        return;
    }
    const int axis = size.z == longest ? 2 : size.y == longest ? 1 : 0;
    IndexBox halves[2] = {region.points, region.points};
    halves[0].max[axis] = halves[1].min[axis] = region.points.min[axis] + longest / 2;
    for (const IndexBox& half : halves) {
        RasterRegion part{half, {}};
        for (const RasterRegion::Part& wanted : region.parts) {
            const IndexBox common = intersect(wanted.points, half);
            if (!common.empty()) part.parts.push_back({wanted.box, common});
        }
        if (!part.parts.empty()) cutRegion(std::move(part), (pieces + 1) / 2, regions);
    }
}

}  // namespace tessera
