#include "software/software_resampler.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <utility>

#include "base/parallel.h"
#include "base/timer.h"
#include "index_space/element_bins.h"
#include "resample/bound_mesh.h"
#include "resample/check_lattice.h"
#include "resample/statistic_names.h"
#include "software/scan_kernel.h"
#include "tessera/error.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

constexpr int kLargestRegion = 64, kSmallestRegion = 16;
constexpr int kRegionsPerThread = 4;
/// What a bound resampler keeps between calls: so many blocks, none larger.
constexpr std::size_t kKeptWorks = 4, kKeptBytes = std::size_t(8) << 20;
/// Blocks in flight may take this much before regions are worked strictly block by block.
constexpr std::int64_t kReorderLimitBytes = std::int64_t(256) << 20;
constexpr std::int64_t kMostWorkBytes = std::int64_t(512) << 20;
/// Of a point in flight, beside its values.
constexpr std::int64_t kPointBytes = 13;

// A block being filled, and what decides who owns its points. Kept and used again for the next block.
struct Work {
    Block block;
    std::unique_ptr<std::int32_t[]> owner;  // meaningful only where runs start
    std::unique_ptr<double[]> rank;         // meaningful only where owner has kRankKnown
    std::size_t ownersSize = 0;
    std::vector<float*> channelValues;
    std::atomic<int> regionsLeft{0};

    std::size_t memoryBytes() const {
        return 4 * block.values.capacity() + block.coverage.capacity() + 12 * ownersSize;
    }

    void prepare(const Lattice& lattice, const IndexBox& box, int channels) {
        block.lattice = lattice;
        block.box = box;
        block.channels = channels;
        const std::size_t count = block.count();
        block.values.resize(count * std::size_t(channels));
        block.coverage.resize(count);
        if (ownersSize < count) {
            owner = std::make_unique_for_overwrite<std::int32_t[]>(count);
            rank = std::make_unique_for_overwrite<double[]>(count);
            ownersSize = count;
        }
        channelValues.resize(std::size_t(channels));
        for (std::size_t c = 0; c < channelValues.size(); ++c)
            channelValues[c] = block.values.data() + c * count;
    }
};

// Makes the marks of covered points 1, the block's coverage, and counts them.
std::int64_t coverMarked(std::uint8_t* marks, std::int64_t count) {
    constexpr std::uint64_t kOfEach = 0x0101010101010101;
    std::int64_t covered = 0, i = 0;
    for (; i + 8 <= count; i += 8) {
        std::uint64_t eight;
        std::memcpy(&eight, marks + i, sizeof eight);
        eight = (eight | eight >> 1) & kOfEach;
        std::memcpy(marks + i, &eight, sizeof eight);
        covered += std::int64_t(eight * kOfEach >> 56);
    }
    for (; i < count; ++i) covered += marks[i] = marks[i] != kNotCovered;
    return covered;
}

// A part of a box that one thread fills.
struct Region {
    std::size_t box;
    IndexBox points;
};

// Equal parts of about `edge` points: a closed brick of 65 isn't cut.
void cutIntoRegions(std::size_t box, const IndexBox& points, int edge, std::vector<Region>& regions) {
    if (points.empty()) return;
    const Vec3i size = points.size();
    const Vec3i parts = glm::max((size + edge / 2) / edge, Vec3i(1));
    const auto corner = [&](const Vec3i& part) {
        Vec3i at;
        for (int a = 0; a < 3; ++a) at[a] = points.min[a] + int(std::int64_t(size[a]) * part[a] / parts[a]);
        return at;
    };
    Vec3i p;
    for (p.z = 0; p.z < parts.z; ++p.z)
        for (p.y = 0; p.y < parts.y; ++p.y)
            for (p.x = 0; p.x < parts.x; ++p.x) regions.push_back({box, {corner(p), corner(p + 1)}});
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

std::vector<ScanChannel> channelsOf(const TetMesh& mesh, std::span<const int> fields) {
    std::vector<ScanChannel> channels;
    for (const int f : fields) {
        const Field& field = mesh.fields[std::size_t(f)];
        for (int c = 0; c < field.components; ++c)
            channels.push_back(
                {field.values.data(), field.components, c, field.location == FieldLocation::cell});
    }
    return channels;
}

ElementBins everyElement(const TetMesh& mesh) {
    ElementBins bins{{0, mesh.elementCount()}, UninitializedVector<std::int32_t>(mesh.tets.size())};
    std::iota(bins.elements.begin(), bins.elements.end(), 0);
    return bins;
}

class BoundSoftware : public BoundResampler {
  public:
    BoundSoftware(const TetMesh& mesh, std::span<const int> fields, const BindOptions& options,
                  const ScanTarget& target)
        : bound_(mesh, fields, options),
          workBytes_(options.workBytes > 0 ? options.workBytes : std::numeric_limits<std::int64_t>::max()),
          target_(target),
          channels_(channelsOf(mesh, fields)) {
        if (mesh.elementCount() > kElementMask) throw InputError("a mesh may have at most 2^30 - 1 elements");
    }

    std::string_view target() const override { return target_.name; }

    ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                const BlockSink& sink, const Execution& given) override {
        checkLattice(lattice, boxes);
        Timer timer;
        ResampleStatistics statistics;
        const Execution execution = withinMemory(given, boxes);
        const std::vector<Region> regions = planRegions(boxes, execution.threadCount());
        std::vector<IndexBox> regionBoxes;
        regionBoxes.reserve(regions.size());
        for (const Region& region : regions) regionBoxes.push_back(region.points);
        const std::optional<TetMesh> part = bound_.near(lattice, boxes, execution);
        const TetMesh& mesh = part ? *part : bound_.whole();
        std::vector<ScanChannel> channels = channels_;
        if (part) channels = channelsOf(*part, everyField(*part));
        const NodeFrame frame = frameNodes(mesh, lattice, execution, channels);
        const ScanInput input{mesh, frame, channels};
        // The elements near a single region are its own.
        const ElementBins bins = part && regions.size() == 1 ? everyElement(mesh)
                                                             : binElements(mesh, frame, regionBoxes,
                                                                           execution, {.dropsBetween = true});
        statistics.add(counted::elementsNear, mesh.elementCount());
        statistics.add(counted::elementBlockPairs, std::int64_t(bins.elements.size()));
        statistics.addMs(stage::bin, timer.restart());
        ScanCounts counts;
        std::int64_t coveredPoints = 0;

        std::vector<std::unique_ptr<Work>> works(boxes.size());
        std::vector<int> regionCounts(boxes.size(), 0);
        for (const Region& region : regions) ++regionCounts[region.box];
        const std::vector<std::size_t> order = workOrder(boxes, regions, bins);
        std::mutex mutex;
        std::vector<std::unique_ptr<Work>> idle = takeIdle();
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
            ScanCounts ofRegion;
            const std::int64_t covered = fillRegion(input, regions[r].points, bins.of(r), *work, ofRegion);
            {
                std::lock_guard lock(mutex);
                counts += ofRegion;
                coveredPoints += covered;
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
        keepIdle(std::move(idle));
        statistics.add(counted::exactElements, counts.exactElements);
        statistics.add(counted::scanlines, counts.scanlines);
        statistics.add(counted::contested, counts.contested);
        statistics.add(counted::coveredPoints, coveredPoints);
        statistics.addMs(stage::sample, timer.elapsedMs());
        return statistics;
    }

  private:
    /// With fewer threads where their blocks would take more than is allowed.
    Execution withinMemory(const Execution& given, std::span<const IndexBox> boxes) const {
        std::int64_t points = 1;
        for (const IndexBox& box : boxes) points = std::max(points, box.count());
        const std::int64_t ofBlock = points * std::int64_t(4 * channels_.size() + kPointBytes);
        Execution execution = given;
        execution.threads = int(std::clamp<std::int64_t>(workBytes_ / ofBlock, 1, given.threadCount()));
        return execution;
    }

    // Memory that the last call left, so that one brick after another costs no new pages.
    std::vector<std::unique_ptr<Work>> takeIdle() {
        const std::lock_guard lock(idleMutex_);
        return std::exchange(idle_, {});
    }
    void keepIdle(std::vector<std::unique_ptr<Work>> works) {
        std::erase_if(works, [](const auto& work) { return work->memoryBytes() > kKeptBytes; });
        if (works.size() > kKeptWorks) works.resize(kKeptWorks);
        const std::lock_guard lock(idleMutex_);
        idle_ = std::move(works);
    }

    // The most expensive regions first, so that no thread is left with one at the end; block by block when
    // that would hold too many blocks in memory.
    std::vector<std::size_t> workOrder(std::span<const IndexBox> boxes, const std::vector<Region>& regions,
                                       const ElementBins& bins) const {
        std::vector<std::size_t> order(regions.size());
        for (std::size_t r = 0; r < order.size(); ++r) order[r] = r;
        std::int64_t bytes = 0;
        for (const IndexBox& box : boxes)
            bytes += box.count() * std::int64_t(4 * channels_.size() + kPointBytes);
        if (bytes <= std::min(kReorderLimitBytes, workBytes_))
            std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
                return bins.of(a).size() > bins.of(b).size();
            });
        return order;
    }

    std::int64_t fillRegion(const ScanInput& input, const IndexBox& region,
                            std::span<const std::int32_t> elements, Work& work, ScanCounts& counts) const {
        const Vec3i size = work.block.box.size();
        const ScanOutput output{region,
                                work.block.box,
                                {1, size.x, std::int64_t(size.x) * size.y},
                                work.channelValues,
                                work.block.coverage.data(),
                                work.owner.get(),
                                work.rank.get()};
        const auto forEachRow = [&](const auto& visit) {
            if (region == work.block.box) return visit(std::int64_t(0), region.count());
            for (int z = region.min.z; z < region.max.z; ++z)
                for (int y = region.min.y; y < region.max.y; ++y)
                    visit(output.offset({region.min.x, y, z}), std::int64_t(region.size().x));
        };
        forEachRow([&](std::int64_t offset, std::int64_t length) {
            std::fill_n(output.marks + offset, length, kNotCovered);
        });
        target_.scan(input, output, elements, counts);
        std::int64_t covered = 0;
        forEachRow([&](std::int64_t offset, std::int64_t length) {
            const std::int64_t inRow = coverMarked(output.marks + offset, length);
            covered += inRow;
            if (inRow == length) return;
            for (float* values : output.values)
                for (std::int64_t i = 0; i < length; ++i)
                    if (output.marks[offset + i] == 0) values[offset + i] = 0;
        });
        return covered;
    }

    std::mutex idleMutex_;
    std::vector<std::unique_ptr<Work>> idle_;
    BoundMesh bound_;
    std::int64_t workBytes_;
    const ScanTarget& target_;
    std::vector<ScanChannel> channels_;
};

}  // namespace

std::vector<std::string> SoftwareResampler::targets() const {
    std::vector<std::string> names;
    for (const ScanTarget& target : scanTargets()) names.push_back(target.name);
    return names;
}

WorkMemory SoftwareResampler::workMemory(int channels) const {
    const WorkMemory usual = Resampler::workMemory(channels);
    return {0, usual.least, std::max(usual.least, kMostWorkBytes)};
}

SoftwareResampler::SoftwareResampler()
    : Resampler({.name = "software",
                 .description = "scanline walk on the processor, exact coverage",
                 .spillBoundVoxels = 0x1p-12,
                 .placeBoundVoxels = 0x1p-24}) {}

std::unique_ptr<BoundResampler> SoftwareResampler::bind(const TetMesh& mesh, std::span<const int> fields,
                                                        const BindOptions& options) const {
    if (options.format != SampleFormat::r32f)
        throw InputError("the software resampler samples in r32f only, not in " +
                         std::string(nameOf(options.format)));
    for (const ScanTarget& candidate : scanTargets())
        if (options.target.empty() || candidate.name == options.target)
            return std::make_unique<BoundSoftware>(mesh, fields, options, candidate);
    throw InputError("the software resampler has no target named " + options.target + " on this processor");
}

}  // namespace tessera
