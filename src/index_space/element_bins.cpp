#include "index_space/element_bins.h"

#include <algorithm>
#include <bit>

#include "base/parallel.h"
#include "index_space/near_kernel.h"

namespace tessera {

namespace {

struct Pair {
    std::int32_t region;
    std::int32_t element;
};

// A coarse grid over all regions; each cell lists the regions that reach into it.
class RegionGrid {
  public:
    explicit RegionGrid(std::span<const IndexBox> regions) : regions_(regions) {
        bounds_ = regions[0];
        Vec3d sum(0);
        for (const IndexBox& region : regions) {
            bounds_.min = glm::min(bounds_.min, region.min);
            bounds_.max = glm::max(bounds_.max, region.max);
            sum += Vec3d(region.size());
        }
        const Vec3i usual(sum / double(regions.size()));
        std::size_t cells = 1;
        for (int a = 0; a < 3; ++a) {
            const int extent = bounds_.max[a] - bounds_.min[a];
            const int edge = std::max(usual[a], (extent + kMostCells - 1) / kMostCells);
            shift_[a] = std::bit_width(unsigned(edge) - 1);  // a power of two: this runs for every element
            cells_[a] = ((extent - 1) >> shift_[a]) + 1;
            cells *= std::size_t(cells_[a]);
        }
        first_.assign(cells + 1, 0);
        forEachCellOfRegions([&](std::size_t cell, std::int32_t) { ++first_[cell + 1]; });
        for (std::size_t c = 0; c < cells; ++c) first_[c + 1] += first_[c];
        list_.resize(std::size_t(first_[cells]));
        std::vector<std::int32_t> next(first_.begin(), first_.end() - 1);
        forEachCellOfRegions(
            [&](std::size_t cell, std::int32_t region) { list_[std::size_t(next[cell]++)] = region; });
    }

    const IndexBox& bounds() const { return bounds_; }

    // Calls found(region) once for every region that shares a lattice point with the closed box low..high
    // inside bounds().
    template <class Found>
    void forEachRegion(const Vec3i& low, const Vec3i& high, const Found& found) const {
        const Vec3i a = cellOf(low), b = cellOf(high);
        // Most boxes are small: most lie in one cell, and most cells in one region.
        if (a == b) return forEachRegionOf(index(a), low, high, found);
        for (int z = a.z; z <= b.z; ++z)
            for (int y = a.y; y <= b.y; ++y)
                for (int x = a.x; x <= b.x; ++x)
                    forEachRegionOf(index({x, y, z}), low, high, [&](std::int32_t region) {
                        // A region that shares several cells with the box counts in the first only.
                        const Vec3i corner = glm::max(low, regions_[std::size_t(region)].min);
                        if (cellOf(corner) == Vec3i{x, y, z}) found(region);
                    });
    }

  private:
    static constexpr int kMostCells = 128;

    // The same for the regions of one cell.
    template <class Found>
    void forEachRegionOf(std::size_t cell, const Vec3i& low, const Vec3i& high, const Found& found) const {
        for (std::int32_t i = first_[cell]; i < first_[cell + 1]; ++i) {
            const std::int32_t region = list_[std::size_t(i)];
            const IndexBox& box = regions_[std::size_t(region)];
            // One branch for six comparisons.
            const bool isBeside = (high.x < box.min.x) | (high.y < box.min.y) | (high.z < box.min.z) |
                                  (low.x >= box.max.x) | (low.y >= box.max.y) | (low.z >= box.max.z);
            if (!isBeside) found(region);
        }
    }

    Vec3i cellOf(const Vec3i& p) const {
        return {(p.x - bounds_.min.x) >> shift_.x, (p.y - bounds_.min.y) >> shift_.y,
                (p.z - bounds_.min.z) >> shift_.z};
    }
    std::size_t index(const Vec3i& cell) const {
        return (std::size_t(cell.z) * std::size_t(cells_.y) + std::size_t(cell.y)) * std::size_t(cells_.x) +
               std::size_t(cell.x);
    }
    template <class Visit>
    void forEachCellOfRegions(const Visit& visit) const {
        for (std::size_t r = 0; r < regions_.size(); ++r) {
            const Vec3i a = cellOf(regions_[r].min), b = cellOf(regions_[r].max - 1);
            for (int z = a.z; z <= b.z; ++z)
                for (int y = a.y; y <= b.y; ++y)
                    for (int x = a.x; x <= b.x; ++x) visit(index({x, y, z}), std::int32_t(r));
        }
    }

    std::span<const IndexBox> regions_;
    IndexBox bounds_;
    Vec3i shift_{0}, cells_{1};
    std::vector<std::int32_t> first_, list_;
};

// The pairs that a chunk of elements finds: as many as it has elements in a place of its own, and what is left
// over.
class ChunkPairs {
  public:
    void start(std::span<Pair> room, std::size_t regions) {
        room_ = room;
        counts.assign(regions, 0);
    }
    void add(const Pair& pair) {
        ++counts[std::size_t(pair.region)];
        if (used_ < room_.size())
            room_[used_++] = pair;
        else
            more_.push_back(pair);
    }
    template <class Visit>
    void forEach(const Visit& visit) const {
        for (const Pair& pair : room_.first(used_)) visit(pair);
        for (const Pair& pair : more_) visit(pair);
    }

    std::vector<std::int32_t> counts;  ///< of each region

  private:
    std::span<Pair> room_;
    std::size_t used_ = 0;
    std::vector<Pair> more_;
};

}  // namespace

ElementBins binElements(const TetMesh& mesh, const NodeFrame& frame, std::span<const IndexBox> regions,
                        const Execution& execution, const NearTest& test) {
    ElementBins bins;
    bins.first.assign(regions.size() + 1, 0);
    if (regions.empty()) return bins;
    const RegionGrid grid(regions);
    const std::int64_t elements = mesh.elementCount();
    const std::int64_t chunk = std::max<std::int64_t>(4096, elements / (8 * execution.threadCount()) + 1);
    UninitializedVector<Pair> room;
    resizeLarge(room, std::size_t(elements));
    std::vector<ChunkPairs> chunks(std::size_t((elements + chunk - 1) / chunk));
    parallelForChunks(execution, elements, chunk, [&](std::int64_t begin, std::int64_t end) {
        ChunkPairs& pairs = chunks[std::size_t(begin / chunk)];
        pairs.start(std::span(room).subspan(std::size_t(begin), std::size_t(end - begin)), regions.size());
        NearElements near;
        for (std::int64_t first = begin; first < end; first += kNearBatch) {
            findNear(mesh, frame.rough, first, int(std::min<std::int64_t>(kNearBatch, end - first)),
                     grid.bounds(), test.marginVoxels, test.dropsBetween, near);
            for (int i = 0; i < near.count; ++i)
                grid.forEachRegion({near.low[0][i], near.low[1][i], near.low[2][i]},
                                   {near.high[0][i], near.high[1][i], near.high[2][i]},
                                   [&](std::int32_t region) { pairs.add({region, near.element[i]}); });
        }
    });
    for (std::size_t r = 0; r < regions.size(); ++r) {
        std::int64_t next = bins.first[r];
        for (ChunkPairs& pairs : chunks) {
            const std::int32_t count = pairs.counts[r];
            pairs.counts[r] = std::int32_t(next - bins.first[r]);
            next += count;
        }
        bins.first[r + 1] = next;
    }
    resizeLarge(bins.elements, std::size_t(bins.first.back()));
    parallelFor(execution, std::int64_t(chunks.size()), [&](std::int64_t c) {
        std::vector<std::int32_t>& place = chunks[std::size_t(c)].counts;
        chunks[std::size_t(c)].forEach([&](const Pair& pair) {
            const std::size_t r = std::size_t(pair.region);
            bins.elements[std::size_t(bins.first[r] + place[r]++)] = pair.element;
        });
    });
    return bins;
}

}  // namespace tessera
