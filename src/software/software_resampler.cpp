#include "software/software_resampler.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>

#include "base/error.h"
#include "base/timer.h"
#include "resample/check_lattice.h"
#include "software/element_bins.h"
#include "software/scan.h"

namespace tessera {

namespace {

constexpr int kLargestRegion = 64, kSmallestRegion = 16;
constexpr int kRegionsPerThread = 4;
/// Blocks in flight may take this much before regions are worked strictly block by block.
constexpr std::int64_t kReorderLimitBytes = std::int64_t(256) << 20;

// A block being filled, and what decides who owns its points. Kept and used again for the next block.
struct Work {
    Block block;
    std::vector<std::int32_t> owner;
    std::unique_ptr<double[]> rank;  // meaningful only where owner has kRankKnown
    std::size_t rankSize = 0;
    std::vector<float*> channelValues;
    std::atomic<int> regionsLeft{0};

    void prepare(const Lattice& lattice, const IndexBox& box, int channels) {
        block.lattice = lattice;
        block.box = box;
        block.channels = channels;
        const std::size_t count = block.count();
        block.values.resize(count * std::size_t(channels));
        block.coverage.resize(count);
        owner.resize(count);
        if (rankSize < count) {
            rank.reset(new double[count]);
            rankSize = count;
        }
        channelValues.resize(std::size_t(channels));
        for (std::size_t c = 0; c < channelValues.size(); ++c)
            channelValues[c] = block.values.data() + c * count;
    }
};

// A part of a box that one thread fills.
struct Region {
    std::size_t box;
    IndexBox points;
};

void cutIntoRegions(std::size_t box, const IndexBox& points, int edge, std::vector<Region>& regions) {
    for (int z = points.min.z; z < points.max.z; z += edge)
        for (int y = points.min.y; y < points.max.y; y += edge)
            for (int x = points.min.x; x < points.max.x; x += edge) {
                const Vec3i low{x, y, z};
                regions.push_back({box, {low, glm::min(low + edge, points.max)}});
            }
}

// Regions small enough to keep every thread busy; results don't depend on the cut.
std::vector<Region> planRegions(std::span<const IndexBox> boxes, int threads) {
    std::vector<Region> regions;
    for (int edge = kLargestRegion;; edge /= 2) {
        regions.clear();
        for (std::size_t b = 0; b < boxes.size(); ++b) cutIntoRegions(b, boxes[b], edge, regions);
        if (edge <= kSmallestRegion || threads == 1 ||
            regions.size() >= std::size_t(kRegionsPerThread * threads))
            break;
    }
    return regions;
}

class BoundSoftware : public BoundResampler {
  public:
    BoundSoftware(const TetMesh& mesh, std::span<const int> fields, const ScanTarget& target)
        : mesh_(mesh), target_(target) {
        if (mesh.elementCount() > kElementMask) throw InputError("a mesh may have at most 2^30 - 1 elements");
        for (const int f : fields) {
            TESSERA_CHECK(f >= 0 && std::size_t(f) < mesh.fields.size(), "no such field");
            const Field& field = mesh.fields[std::size_t(f)];
            for (int c = 0; c < field.components; ++c)
                channels_.push_back(
                    {field.values.data(), field.components, c, field.location == FieldLocation::cell});
        }
    }

    std::string_view target() const override { return target_.name; }

    ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                const BlockSink& sink, const Execution& execution) override {
        checkLattice(lattice, boxes);
        Timer timer;
        ResampleStatistics statistics;
        const std::vector<Region> regions = planRegions(boxes, execution.threadCount());
        std::vector<IndexBox> regionBoxes;
        regionBoxes.reserve(regions.size());
        for (const Region& region : regions) regionBoxes.push_back(region.points);
        const NodeFrame frame = frameNodes(mesh_, lattice, execution);
        const ElementBins bins = binElements(mesh_, frame, regionBoxes, execution);
        statistics.elementBlockPairs = std::int64_t(bins.elements.size());
        statistics.binMs = timer.restart();

        std::vector<std::unique_ptr<Work>> works(boxes.size());
        std::vector<int> regionCounts(boxes.size(), 0);
        for (const Region& region : regions) ++regionCounts[region.box];
        const std::vector<std::size_t> order = workOrder(boxes, regions, bins);
        std::mutex mutex;
        std::vector<std::unique_ptr<Work>> idle;
        std::atomic<std::int64_t> done{0};
        parallelFor(execution, std::int64_t(regions.size()), [&](std::int64_t i) {
            const std::size_t r = order[std::size_t(i)];
            const std::size_t box = regions[r].box;
            Work* work = nullptr;
            {
                std::lock_guard lock(mutex);
                if (!works[box]) {
                    if (idle.empty()) {
                        works[box] = std::make_unique<Work>();
                    } else {
                        works[box] = std::move(idle.back());
                        idle.pop_back();
                    }
                    works[box]->prepare(lattice, boxes[box], int(channels_.size()));
                    works[box]->regionsLeft = regionCounts[box];
                }
                work = works[box].get();
            }
            ScanCounts counts;
            const std::int64_t covered = fillRegion(frame, regions[r].points, bins.of(r), *work, counts);
            {
                std::lock_guard lock(mutex);
                statistics.scanlines += counts.scanlines;
                statistics.contested += counts.contested;
                statistics.exactElements += counts.exactElements;
                statistics.coveredPoints += covered;
            }
            if (--work->regionsLeft == 0) {
                sink(box, work->block);
                std::lock_guard lock(mutex);
                idle.push_back(std::move(works[box]));
            }
            execution.report(Stage::sampling, ++done, std::int64_t(regions.size()));
        });
        // A box without points still gets its call.
        for (std::size_t b = 0; b < boxes.size(); ++b) {
            if (regionCounts[b] != 0) continue;
            Work work;
            work.prepare(lattice, boxes[b], int(channels_.size()));
            sink(b, work.block);
        }
        statistics.sampleMs = timer.elapsedMs();
        return statistics;
    }

  private:
    // The most expensive regions first, so that no thread is left with one at the end; block by block when
    // that would hold too many blocks in memory.
    std::vector<std::size_t> workOrder(std::span<const IndexBox> boxes, const std::vector<Region>& regions,
                                       const ElementBins& bins) const {
        std::vector<std::size_t> order(regions.size());
        for (std::size_t r = 0; r < order.size(); ++r) order[r] = r;
        std::int64_t bytes = 0;
        for (const IndexBox& box : boxes) bytes += box.count() * std::int64_t(4 * channels_.size() + 5);
        if (bytes <= kReorderLimitBytes)
            std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
                return bins.of(a).size() > bins.of(b).size();
            });
        return order;
    }

    std::int64_t fillRegion(const NodeFrame& frame, const IndexBox& region,
                            std::span<const std::int32_t> elements, Work& work, ScanCounts& counts) const {
        const Vec3i size = work.block.box.size();
        const ScanInput input{mesh_, frame, channels_};
        const ScanOutput output{region,
                                work.block.box,
                                {1, size.x, std::int64_t(size.x) * size.y},
                                work.channelValues,
                                work.owner.data(),
                                work.rank.get()};
        const std::int64_t rowLength = region.size().x;
        const auto forEachRow = [&](const auto& visit) {
            for (int z = region.min.z; z < region.max.z; ++z)
                for (int y = region.min.y; y < region.max.y; ++y) visit(output.offset({region.min.x, y, z}));
        };
        forEachRow([&](std::int64_t offset) {
            std::fill_n(output.owner + offset, rowLength, kNoOwner);
            for (float* values : output.values) std::fill_n(values + offset, rowLength, 0.0f);
        });
        target_.scan(input, output, elements, counts);
        std::int64_t covered = 0;
        forEachRow([&](std::int64_t offset) {
            const std::int32_t* owner = output.owner + offset;
            std::uint8_t* coverage = work.block.coverage.data() + offset;
            int inRow = 0;
            for (std::int64_t i = 0; i < rowLength; ++i) {
                coverage[i] = owner[i] >= 0;
                inRow += coverage[i];
            }
            covered += inRow;
        });
        return covered;
    }

    const TetMesh& mesh_;
    const ScanTarget& target_;
    std::vector<ScanChannel> channels_;
};

}  // namespace

std::vector<std::string> SoftwareResampler::targets() const {
    std::vector<std::string> names;
    for (const ScanTarget& target : scanTargets()) names.push_back(target.name);
    return names;
}

double SoftwareResampler::spillBoundVoxels() const {
    return 0x1p-12;
}
double SoftwareResampler::placeBoundVoxels() const {
    return 0x1p-24;
}

std::unique_ptr<BoundResampler> SoftwareResampler::bind(const TetMesh& mesh, std::span<const int> fields,
                                                        const BindOptions& options) const {
    if (options.format != SampleFormat::r32f)
        throw InputError("the software resampler samples in r32f only, not in " +
                         std::string(nameOf(options.format)));
    if (options.classification != Classification::arithmetic)
        throw InputError("the software resampler classifies by arithmetic only");
    for (const ScanTarget& candidate : scanTargets())
        if (options.target.empty() || candidate.name == options.target)
            return std::make_unique<BoundSoftware>(mesh, fields, candidate);
    throw InputError("the software resampler has no target named " + options.target + " on this processor");
}

}  // namespace tessera
