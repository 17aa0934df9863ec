#include "index_space/element_bins.h"

#include <algorithm>
#include <bit>
#include <cmath>

#if defined(__SSE2__)
#include <emmintrin.h>

#include "base/parallel.h"
#endif

namespace tessera {

namespace {

constexpr std::int64_t kAhead = 24;

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

// Bounds in lattice points; the fourth number is padding.
struct alignas(16) LatticeBounds {
    std::int32_t low[4], high[4];
};

// Nodes may lie anywhere; what is beyond every lattice index is cut to just beyond it, so that it fits an
// int.
constexpr float kFarthest = 0x1p30f + 2048.0f;

// Bounds of an element in lattice points from the rounded node places, widened by their rounding. False when
// they hold none.
#if defined(__SSE2__)
bool latticeBounds(const NodeFrame& frame, const std::array<std::int32_t, 4>& tet, float margin,
                   LatticeBounds& bounds) {
    const auto place = [&](std::size_t k) { return _mm_load_ps(frame.rough[std::size_t(tet[k])].index); };
    const __m128 n0 = place(0), n1 = place(1), n2 = place(2), n3 = place(3);
    const __m128 least = _mm_min_ps(_mm_min_ps(n0, n1), _mm_min_ps(n2, n3));
    const __m128 most = _mm_max_ps(_mm_max_ps(n0, n1), _mm_max_ps(n2, n3));
    const __m128 magnitude = _mm_castsi128_ps(_mm_set1_epi32(0x7fffffff)), unit = _mm_set1_ps(0x1p-22f),
                 tiny = _mm_set1_ps(0x1p-26f + margin);
    const auto slack = [&](__m128 x) { return _mm_add_ps(_mm_mul_ps(_mm_and_ps(x, magnitude), unit), tiny); };
    const auto cut = [](__m128 x) {
        return _mm_max_ps(_mm_min_ps(x, _mm_set1_ps(kFarthest)), _mm_set1_ps(-kFarthest));
    };
    const __m128 from = cut(_mm_sub_ps(least, slack(least))), to = cut(_mm_add_ps(most, slack(most)));
    // Ceil and floor: truncate, then correct where that went the wrong way (a true comparison is the integer
    // -1).
    const __m128i fromCut = _mm_cvttps_epi32(from), toCut = _mm_cvttps_epi32(to);
    const __m128i low =
        _mm_sub_epi32(fromCut, _mm_castps_si128(_mm_cmplt_ps(_mm_cvtepi32_ps(fromCut), from)));
    const __m128i high = _mm_add_epi32(toCut, _mm_castps_si128(_mm_cmpgt_ps(_mm_cvtepi32_ps(toCut), to)));
    _mm_store_si128(reinterpret_cast<__m128i*>(bounds.low), low);
    _mm_store_si128(reinterpret_cast<__m128i*>(bounds.high), high);
    return _mm_movemask_epi8(_mm_cmpgt_epi32(low, high)) == 0;
}
#else
bool latticeBounds(const NodeFrame& frame, const std::array<std::int32_t, 4>& tet, float margin,
                   LatticeBounds& bounds) {
    bool some = true;
    for (int a = 0; a < 3; ++a) {
        float least = frame.rough[std::size_t(tet[0])].index[a], most = least;
        for (std::size_t k = 1; k < 4; ++k) {
            least = std::min(least, frame.rough[std::size_t(tet[k])].index[a]);
            most = std::max(most, frame.rough[std::size_t(tet[k])].index[a]);
        }
        least -= std::fabs(least) * 0x1p-22f + 0x1p-26f + margin;
        most += std::fabs(most) * 0x1p-22f + 0x1p-26f + margin;
        bounds.low[a] = std::int32_t(std::ceil(std::clamp(least, -kFarthest, kFarthest)));
        bounds.high[a] = std::int32_t(std::floor(std::clamp(most, -kFarthest, kFarthest)));
        some = some && bounds.low[a] <= bounds.high[a];
    }
    return some;
}
#endif

}  // namespace

ElementBins binElements(const TetMesh& mesh, const NodeFrame& frame, std::span<const IndexBox> regions,
                        const Execution& execution, float marginVoxels) {
    ElementBins bins;
    bins.first.assign(regions.size() + 1, 0);
    if (regions.empty()) return bins;
    const RegionGrid grid(regions);
    const IndexBox& all = grid.bounds();
    const std::int64_t elements = mesh.elementCount();
    const std::int64_t chunk = std::max<std::int64_t>(4096, elements / (8 * execution.threadCount()) + 1);
    const std::size_t chunks = std::size_t((elements + chunk - 1) / chunk);
    // Calls found(element, low, high) for the chunk's elements that share lattice points low..high with the
    // regions.
    const auto forEachNear = [&](std::int64_t begin, std::int64_t end, const auto& found) {
        for (std::int64_t e = begin; e < end; ++e) {
            if (e + kAhead < end)  // elements come in no order that caches could guess
                for (const std::int32_t node : mesh.tets[std::size_t(e + kAhead)])
                    __builtin_prefetch(&frame.rough[std::size_t(node)]);
            LatticeBounds bounds;
            if (!latticeBounds(frame, mesh.tets[std::size_t(e)], marginVoxels, bounds)) continue;
            const Vec3i low = glm::max(Vec3i{bounds.low[0], bounds.low[1], bounds.low[2]}, all.min);
            const Vec3i high = glm::min(Vec3i{bounds.high[0], bounds.high[1], bounds.high[2]}, all.max - 1);
            if (low.x <= high.x && low.y <= high.y && low.z <= high.z) found(std::int32_t(e), low, high);
        }
    };
    if (regions.size() == 1) {
        std::vector<std::vector<std::int32_t>> lists(chunks);
        parallelForChunks(execution, elements, chunk, [&](std::int64_t begin, std::int64_t end) {
            std::vector<std::int32_t>& list = lists[std::size_t(begin / chunk)];
            list.reserve(std::size_t(end - begin));
            forEachNear(begin, end, [&](std::int32_t e, const Vec3i&, const Vec3i&) { list.push_back(e); });
        });
        for (const std::vector<std::int32_t>& list : lists)
            bins.elements.insert(bins.elements.end(), list.begin(), list.end());
        bins.first[1] = std::int64_t(bins.elements.size());
        return bins;
    }
    std::vector<std::vector<Pair>> pairs(chunks);
    std::vector<std::vector<std::int32_t>> counts(chunks);
    parallelForChunks(execution, elements, chunk, [&](std::int64_t begin, std::int64_t end) {
        std::vector<Pair>& found = pairs[std::size_t(begin / chunk)];
        std::vector<std::int32_t>& count = counts[std::size_t(begin / chunk)];
        count.assign(regions.size(), 0);
        found.reserve(std::size_t(end - begin));
        forEachNear(begin, end, [&](std::int32_t e, const Vec3i& low, const Vec3i& high) {
            grid.forEachRegion(low, high, [&](std::int32_t region) {
                found.push_back({region, e});
                ++count[std::size_t(region)];
            });
        });
    });
    for (std::size_t r = 0; r < regions.size(); ++r) {
        std::int64_t next = bins.first[r];
        for (std::size_t c = 0; c < chunks; ++c) {
            const std::int32_t count = counts[c][r];
            counts[c][r] = std::int32_t(next - bins.first[r]);
            next += count;
        }
        bins.first[r + 1] = next;
    }
    resizeLarge(bins.elements, std::size_t(bins.first.back()));
    parallelFor(execution, std::int64_t(chunks), [&](std::int64_t c) {
        std::vector<std::int32_t>& place = counts[std::size_t(c)];
        for (const Pair& pair : pairs[std::size_t(c)]) {
            const std::size_t r = std::size_t(pair.region);
            bins.elements[std::size_t(bins.first[r] + place[r]++)] = pair.element;
        }
    });
    return bins;
}

}  // namespace tessera
