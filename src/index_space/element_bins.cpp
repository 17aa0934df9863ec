#include "index_space/element_bins.h"

#include <algorithm>
#include <bit>

#include "base/check.h"
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
        IndexBox& box = grid_.box = regions[0];
        Vec3d sum(0);
        for (const IndexBox& region : regions) {
            box.min = glm::min(box.min, region.min);
            box.max = glm::max(box.max, region.max);
            sum += Vec3d(region.size());
        }
        const Vec3i usual(sum / double(regions.size()));
        std::size_t cells = 1;
        for (int a = 0; a < 3; ++a) {
            const std::int64_t extent = std::int64_t(box.max[a]) - box.min[a];
            const int edge = std::max(usual[a], int((extent + kMostCells - 1) / kMostCells));
            grid_.shift[a] = std::bit_width(unsigned(edge) - 1);
            grid_.cells[a] = int((extent - 1) >> grid_.shift[a]) + 1;
            cells *= std::size_t(grid_.cells[a]);
        }
        first_.assign(cells + 1, 0);
        forEachCellOfRegions([&](std::size_t cell, std::int32_t) { ++first_[cell + 1]; });
        for (std::size_t c = 0; c < cells; ++c) first_[c + 1] += first_[c];
        list_.resize(std::size_t(first_[cells]));
        std::vector<std::int32_t> next(first_.begin(), first_.end() - 1);
        forEachCellOfRegions(
            [&](std::size_t cell, std::int32_t region) { list_[std::size_t(next[cell]++)] = region; });
        only_.assign(cells, -1);
        for (std::size_t r = 0; r < regions.size(); ++r) markFilled(std::int32_t(r));
    }

    const NearGrid& grid() const { return grid_; }

    // Calls found(region) once for every region that an element's lattice points share.
    template <class Found>
    void forEachRegion(const NearElements& near, int i, const Found& found) const {
        const std::int32_t cell = near.cell[i];
        // Most elements are small: most lie in one cell, and most cells in one region.
        if (cell >= 0 && only_[std::size_t(cell)] >= 0) return found(only_[std::size_t(cell)]);
        const Vec3i low{near.low[0][i], near.low[1][i], near.low[2][i]},
            high{near.high[0][i], near.high[1][i], near.high[2][i]};
        forEachCell(grid_.cellOf(low), grid_.cellOf(high), [&](std::int32_t at, const Vec3i& place) {
            for (std::int32_t k = first_[std::size_t(at)]; k < first_[std::size_t(at) + 1]; ++k) {
                const std::int32_t region = list_[std::size_t(k)];
                const IndexBox& box = regions_[std::size_t(region)];
                // One branch for six comparisons.
                const bool isBeside = (high.x < box.min.x) | (high.y < box.min.y) | (high.z < box.min.z) |
                                      (low.x >= box.max.x) | (low.y >= box.max.y) | (low.z >= box.max.z);
                // A region that shares several cells with the points counts in the first only.
                if (!isBeside && grid_.cellOf(glm::max(low, box.min)) == place) found(region);
            }
        });
    }

  private:
    static constexpr int kMostCells = 128;

    // Calls visit(index, place) for the cells a..b.
    template <class Visit>
    void forEachCell(const Vec3i& a, const Vec3i& b, const Visit& visit) const {
        for (int z = a.z; z <= b.z; ++z)
            for (int y = a.y; y <= b.y; ++y)
                for (int x = a.x; x <= b.x; ++x) visit(grid_.index({x, y, z}), Vec3i(x, y, z));
    }
    template <class Visit>
    void forEachCellOfRegions(const Visit& visit) const {
        for (std::size_t r = 0; r < regions_.size(); ++r)
            forEachCell(grid_.cellOf(regions_[r].min), grid_.cellOf(regions_[r].max - 1),
                        [&](std::int32_t cell, const Vec3i&) { visit(std::size_t(cell), std::int32_t(r)); });
    }
    // Notes the cells that the region alone reaches into, and fills.
    void markFilled(std::int32_t region) {
        const IndexBox& box = regions_[std::size_t(region)];
        forEachCell(
            grid_.cellOf(box.min), grid_.cellOf(box.max - 1), [&](std::int32_t at, const Vec3i& place) {
                const std::size_t cell = std::size_t(at);
                const Vec3i edge{1 << grid_.shift.x, 1 << grid_.shift.y, 1 << grid_.shift.z};
                const Vec3i low = grid_.box.min + place * edge, high = glm::min(low + edge, grid_.box.max);
                const bool isFilled = box.contains(low) && box.contains(high - 1);
                if (isFilled && first_[cell + 1] - first_[cell] == 1) only_[cell] = region;
            });
    }

    std::span<const IndexBox> regions_;
    NearGrid grid_;
    std::vector<std::int32_t> first_, list_;
    std::vector<std::int32_t> only_;  ///< the region that fills a cell and is its only one, else -1
};

// The pairs that a chunk of elements finds: as many as it has elements in a place of its own, and what is
// left over.
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
    TESSERA_CHECK(!test.dropsBetween || test.marginVoxels == 0, "what lies between points may be near them");
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
                     grid.grid(), test, near);
            for (int i = 0; i < near.count; ++i)
                grid.forEachRegion(near, i, [&](std::int32_t region) {
                    pairs.add({region, near.element[i]});
                });
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
