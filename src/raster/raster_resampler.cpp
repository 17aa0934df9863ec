#include "raster/raster_resampler.h"

#include <algorithm>
#include <atomic>
#include <deque>
#include <future>
#include <limits>
#include <mutex>
#include <numeric>
#include <optional>

#include "base/parallel.h"
#include "base/timer.h"
#include "device/texture_slots.h"
#include "gl/gl_platform.h"
#include "index_space/element_bins.h"
#include "raster/hard_elements.h"
#include "raster/raster_budget.h"
#include "raster/raster_device.h"
#include "raster/regions.h"
#include "resample/bound_mesh.h"
#include "resample/check_lattice.h"
#include "resample/statistic_names.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// Fewer near the boxes become records faster on the processor.
constexpr std::size_t kManyElements = std::size_t(1) << 15;

/// A region on its way through the device.
struct RegionJob {
    RasterRegion region;
    PreparedRegion prepared;  ///< kept until the device is done
    /// Kept for the passes after the first, when there is room for all of them.
    std::vector<std::shared_ptr<const SliceBatch>> batches;
    std::shared_ptr<const ScanBoxes> boxes;  ///< in place of primitives where the region is scanned
    std::vector<std::future<void>> draws;
    std::vector<std::future<RasterImage>> images;
};

class BoundRaster : public BoundResampler {
  public:
    BoundRaster(const TetMesh& mesh, std::span<const int> fields, const BindOptions& options,
                GlPlatform platform, std::shared_ptr<const SliceGenerator> generator, bool isPublished)
        : mesh_(mesh, fields, routed(options, isPublished)),
          format_(options.format),
          isPublished_(isPublished),
          isScan_(generator == nullptr),
          primitives_(options.primitives),
          sliceAxis_(options.sliceAxis),
          workBytes_(options.workBytes),
          platform_(platform),
          target_(nameOf(platform)),
          generator_(std::move(generator)) {
        if (sliceAxis_ && (isScan_ || *sliceAxis_ < 0 || *sliceAxis_ > 2))
            throw InputError(isScan_ ? "it doesn't draw slices: there is no axis to choose"
                                     : "the axis of slices is 0, 1 or 2");
        if (mesh.elementCount() >= std::int64_t(1) << 30)
            throw InputError("a mesh may have at most 2^30 - 1 elements");
        for (const int f : fields) {
            const Field& field = mesh.fields[std::size_t(f)];
            for (int c = 0; c < field.components; ++c) channels_.emplace_back(field, c, format_);
        }
    }

    std::string_view target() const override { return target_; }

    ResampleStatistics resample(const Lattice& lattice, std::span<const IndexBox> boxes,
                                const BlockSink& sink, const Execution& execution) override {
        checkLattice(lattice, boxes);
        RasterDevice& device = sharedRasterDevice(platform_);
        const std::lock_guard lock(device.exclusive);
        return Run(*this, device, lattice, boxes, sink, execution).all();
    }

    ResampleStatistics resampleToDevice(const Lattice& lattice, std::span<const IndexBox> boxes,
                                        DeviceSlots& slots, const Execution& execution) override {
        RasterDevice& device = sharedRasterDevice(platform_);
        auto* textures = dynamic_cast<TextureSlots*>(&slots);
        const bool areHere = textures && &textures->thread() == &device.thread();
        checkSlots(slots, areHere);
        // Slots want layers along z, and the published methods' results depend on the axis.
        if (!areHere || isPublished_)
            return BoundResampler::resampleToDevice(lattice, boxes, slots, execution);
        checkLattice(lattice, boxes);
        const std::lock_guard lock(device.exclusive);
        const BlockSink nobody = [](std::size_t, const Block&) {};
        return Run(*this, device, lattice, boxes, nobody, execution, textures).all();
    }

  private:
    /// One call of resample().
    class Run {
      public:
        Run(const BoundRaster& bound, RasterDevice& device, const Lattice& lattice,
            std::span<const IndexBox> boxes, const BlockSink& sink, const Execution& execution,
            const TextureSlots* slots = nullptr)
            : bound_(bound),
              device_(device),
              lattice_(lattice),
              boxes_(boxes),
              sink_(sink),
              execution_(execution),
              slots_(slots),
              budget_(shareOut(bound.workBytes_, int(bound.channels_.size()))),
              room_(budget_.queueBytes) {}

        ResampleStatistics all();

      private:
        void plan();
        /// The mesh as the device makes records of it; null where the processor makes them: few elements, or
        /// what is near a brick alone, aren't worth the way to the device.
        std::shared_ptr<const DeviceMesh> meshOnDevice();
        void binRegions();
        /// Starts the first region that is left, the index-th of all.
        void start(std::size_t index);
        /// The same where the device makes the records.
        void startOnDevice();
        /// Lists what the device is to make records of, and makes the geometry; cuts regions with too many
        /// elements.
        RecordMaker::Made makeRecords(RegionJob& job);
        /// Puts pieces of a region before those that are left; false when it can't be cut.
        bool cut(const RasterRegion& region, std::int64_t pieces);
        void postResult(RegionJob& job, std::size_t pass);
        void generate(RegionJob& job, std::size_t pass);
        void emit(RegionJob& job, std::size_t pass);
        void post(RegionJob& job, std::shared_ptr<const SliceBatch> batch, std::shared_ptr<const void> room);
        /// Copies a rendered region into the slots.
        void keep(GlContext& context, const RasterRegion& region, std::size_t pass);
        void finishOldest();
        void copyPart(const RasterRegion& region, const RasterRegion::Part& part,
                      const std::vector<RasterImage>& images);
        void copyChannels(const RasterRegion& region, const RasterRegion::Part& part,
                          const RasterImage& image, std::size_t pass, Block& block,
                          std::int64_t& covered) const;
        Block& open(std::size_t box);
        void deliver(std::size_t box);
        /// Frame and axes are set by plan().
        RasterInputs inputs() const { return {mesh(), frame_, channels_, bound_.format_, axes_}; }
        const TetMesh& mesh() const { return part_ ? *part_ : bound_.mesh_.whole(); }

        const BoundRaster& bound_;
        RasterDevice& device_;
        const Lattice& lattice_;
        std::span<const IndexBox> boxes_;
        const BlockSink& sink_;
        const Execution& execution_;
        const TextureSlots* slots_;  ///< where samples stay on the device; the sink then gets nothing
        RasterBudget budget_;
        QueueRoom room_;

        std::optional<std::vector<std::int32_t>> near_;  ///< the elements near the boxes, where they are few
        std::optional<TetMesh> part_;                    ///< those, where the processor makes the records
        std::vector<ChannelCoding> channels_;            ///< of the part or of the whole mesh
        NodeFrame frame_;
        SliceAxes axes_;
        std::shared_ptr<const DeviceMesh> deviceMesh_;
        std::deque<RasterRegion> left_;  ///< to be started
        std::deque<RegionJob> jobs_;     ///< under way, oldest first; tasks refer to them
        ElementBins bins_;
        std::vector<std::unique_ptr<Block>> blocks_;
        std::vector<int> partsLeft_;  ///< of each box
        ResampleStatistics statistics_;
        std::mutex mutex_;
    };

    void checkSlots(const DeviceSlots& slots, bool areHere) const {
        if (slots.channels() != int(channels_.size()))
            throw InputError("slots of " + std::to_string(slots.channels()) + " channels can't take " +
                             std::to_string(channels_.size()));
        if (areHere && slots.format() != format_)
            throw InputError("slots of " + std::string(nameOf(slots.format())) + " can't take samples in " +
                             std::string(nameOf(format_)));
    }

    /// Of a part of the mesh.
    std::vector<ChannelCoding> channelsOn(const TetMesh& part) const {
        std::vector<ChannelCoding> channels = channels_;
        std::size_t c = 0;
        for (const Field& field : part.fields)
            for (int k = 0; k < field.components; ++k, ++c) channels[c] = channels[c].on(field);
        return channels;
    }

    /// The published methods' results depend on the slice axis, which goes by the whole mesh.
    static BindOptions routed(BindOptions options, bool isPublished) {
        if (isPublished) options.route = Route::pass;
        return options;
    }

    BoundMesh mesh_;
    SampleFormat format_;
    bool isPublished_;
    bool isScan_;
    Primitives primitives_;
    std::optional<int> sliceAxis_;
    std::int64_t workBytes_;
    GlPlatform platform_;
    std::string target_;
    std::shared_ptr<const SliceGenerator> generator_;
    std::vector<ChannelCoding> channels_;
    mutable std::shared_ptr<const DeviceMesh> onDevice_;  ///< the whole mesh, once a call needed it
    mutable bool isTooLarge_ = false;                     ///< for the device's memory
};

ResampleStatistics BoundRaster::Run::all() {
    Timer timer;
    near_ = bound_.mesh_.elementsNear(lattice_, boxes_, execution_);
    deviceMesh_ = meshOnDevice();
    if (near_ && !deviceMesh_) part_ = bound_.mesh_.part(*near_);
    channels_ = part_ ? bound_.channelsOn(*part_) : bound_.channels_;
    plan();
    statistics_.addMs(stage::bin, timer.restart());
    try {
        const auto pointsLeft = [&] {
            std::int64_t points = 0;
            for (const RasterRegion& region : left_) points += region.points.count();
            return points;
        };
        const std::int64_t all = pointsLeft();
        for (std::size_t index = 0; !left_.empty(); ++index) {
            execution_.throwIfCancelled();
            // The device draws one region while the processor prepares the next.
            if (deviceMesh_)
                startOnDevice();
            else
                start(index);
            if (jobs_.size() > 1) finishOldest();
            execution_.report(Stage::sampling, all - pointsLeft(), all);
        }
        while (!jobs_.empty()) finishOldest();
    } catch (...) {
        // What is queued refers to this call's data: let it pass. Its counts are nobody's.
        device_.thread().run([&](GlContext& context) {
            context.discardFailures();
            device_.takeCounts();
        });
        throw;
    }
    const RasterCounts counts = device_.thread().run([&](GlContext&) { return device_.takeCounts(); });
    for (std::size_t b = 0; b < boxes_.size() && !slots_; ++b)
        if (boxes_[b].empty()) {
            open(b);
            deliver(b);
        }
    statistics_.addMs(stage::upload, counts.uploadMs);
    statistics_.addMs(stage::render, counts.renderMs);
    statistics_.addMs(stage::readBack, counts.readBackMs);
    statistics_.add(counted::fragments, counts.fragments);
    statistics_.add(counted::polygons, counts.polygons);
    statistics_.add(counted::vertices, counts.vertices);
    statistics_.add(counted::uploadBytes, counts.uploadBytes);
    statistics_.add(counted::readBackBytes, counts.readBackBytes);
    statistics_.addMs(stage::sample, timer.elapsedMs());
    return statistics_;
}

void BoundRaster::Run::plan() {
    const std::vector<RasterRegion> regions = planRasterRegions(boxes_, budget_.regionPoints);
    left_.assign(regions.begin(), regions.end());
    axes_ = SliceAxes::along(2);
    if (deviceMesh_) {
        if (!slots_ && !bound_.isScan_)
            axes_ = SliceAxes::along(bound_.sliceAxis_.value_or(
                deviceMesh_->layerAxis({lattice_.uWorld.x, lattice_.vWorld.y, lattice_.wWorld.z})));
        std::span<const std::int32_t> candidates;
        if (near_) candidates = *near_;
        device_.thread().run([&](GlContext& context) {
            device_.records().place(context, *deviceMesh_, lattice_, candidates);
            device_.countUpload(std::int64_t(candidates.size_bytes()));
        });
    } else {
        frame_ = frameNodes(mesh(), lattice_, execution_);
        if (!slots_ && !bound_.isScan_)
            axes_ = SliceAxes::along(bound_.sliceAxis_ ? *bound_.sliceAxis_
                                                       : chooseLayerAxis(mesh(), frame_, execution_));
        binRegions();
    }
    blocks_.resize(boxes_.size());
    partsLeft_.assign(boxes_.size(), 0);
    for (const RasterRegion& region : left_)
        for (const RasterRegion::Part& part : region.parts) ++partsLeft_[part.box];
    statistics_.add(counted::elementsNear, near_ ? std::int64_t(near_->size()) : mesh().elementCount());
    statistics_.add(counted::coveredPoints, 0);
    statistics_.add(counted::elementBlockPairs, std::int64_t(bins_.elements.size()));
}

std::shared_ptr<const DeviceMesh> BoundRaster::Run::meshOnDevice() {
    if (bound_.isPublished_ || bound_.primitives_ == Primitives::processor) return nullptr;
    if (mesh().tets.empty() || !lattice_.isAxisParallel()) return nullptr;
    if (near_) {
        std::int64_t points = 0;
        for (const IndexBox& box : boxes_) points += box.count();
        const std::size_t worthIt = bound_.mesh_.route() == Route::automatic ? kManyElements : 1;
        if (near_->size() < worthIt || points <= kFewPoints) return nullptr;
    }
    // An emulated device's memory is this process's own.
    const auto channels = int(bound_.channels_.size());
    const WorkMemory work = rasterWorkMemory(channels);
    const std::int64_t bytes = bound_.workBytes_ > 0 ? std::max(bound_.workBytes_, work.least) : work.most;
    const std::int64_t ofMesh = DeviceMesh::bytesOf(mesh(), bound_.channels_);
    GlThread& thread = device_.thread();
    if (thread.info().isSoftware) {
        if (ofMesh > bytes / 4) return nullptr;
        budget_ = shareOut(bytes - ofMesh, channels);
    } else if (ofMesh > thread.info().limits.storageBlockBytes) {
        return nullptr;  // no buffer may be larger
    }
    if (!thread.run([&](GlContext& context) { return device_.records().isExact(context); })) return nullptr;
    if (bound_.onDevice_ || bound_.isTooLarge_) return bound_.onDevice_;
    const DeviceMesh::Source source(mesh(), bound_.channels_, bound_.format_, execution_);
    try {
        bound_.onDevice_ = thread.run([&](GlContext& context) {
            auto made = std::make_unique<DeviceMesh>(context, source);
            context.throwIfFailed();
            device_.countUpload(made->uploadedBytes());
            return std::shared_ptr<const DeviceMesh>(
                made.release(), [&thread](const DeviceMesh* mesh) { thread.dispose(mesh); });
        });
    } catch (const GlMemoryError&) {
        bound_.isTooLarge_ = true;  // regions may have room where the mesh has none
    }
    return bound_.onDevice_;
}

/// Regions that more elements reach than there is memory for are cut.
void BoundRaster::Run::binRegions() {
    for (;;) {
        std::vector<IndexBox> regionBoxes;
        for (const RasterRegion& region : left_) regionBoxes.push_back(region.points);
        bins_ = binElements(mesh(), frame_, regionBoxes, execution_, {.marginVoxels = float(kLargestMargin)});
        std::vector<RasterRegion> cut;
        for (std::size_t r = 0; r < left_.size(); ++r)
            cutRegion(std::move(left_[r]),
                      1 + (std::int64_t(bins_.of(r).size()) - 1) / budget_.regionElements, cut);
        const bool isDone = cut.size() == left_.size();
        left_.assign(cut.begin(), cut.end());
        if (isDone) return;
    }
}

bool BoundRaster::Run::cut(const RasterRegion& region, std::int64_t pieces) {
    std::vector<RasterRegion> cut;
    cutRegion(region, pieces, cut);
    if (cut.size() <= 1) return false;
    for (const RasterRegion::Part& part : region.parts) --partsLeft_[part.box];
    for (const RasterRegion& piece : cut)
        for (const RasterRegion::Part& part : piece.parts) ++partsLeft_[part.box];
    left_.insert(left_.begin(), cut.begin(), cut.end());
    return true;
}

RecordMaker::Made BoundRaster::Run::makeRecords(RegionJob& job) {
    RecordMaker& maker = device_.records();
    const int channels = std::min(int(channels_.size()), int(kChannelsAPass));
    for (;;) {
        job.region = std::move(left_.front());
        left_.pop_front();
        const IndexBox points = job.prepared.points = job.region.points;
        const std::int64_t near = device_.thread().run(
            [&](GlContext& context) { return maker.findNear(context, *deviceMesh_, points); });
        const std::int64_t bytes = RecordMaker::bytesFor(near, 0, channels);
        if (bytes > budget_.recordBytes && cut(job.region, 1 + bytes / budget_.recordBytes)) continue;
        const auto make = [&](std::int64_t most) {
            const std::optional<int> axis = bound_.isScan_ ? std::nullopt : std::optional(axes_.l);
            return device_.thread().run(
                [&](GlContext& context) { return maker.makeGeometry(context, *deviceMesh_, most, axis); });
        };
        std::optional<RecordMaker::Made> made = make(budget_.recordBytes);
        if (!made && cut(job.region, 2)) continue;
        if (!made) made = make(RecordMaker::kNoBound);
        statistics_.add(counted::elementBlockPairs, near);
        statistics_.add(counted::elementSlicePairs, made->emptyPairs);
        for (const auto& ofLayer : made->layers)
            for (const std::uint32_t count : ofLayer) statistics_.add(counted::elementSlicePairs, count);
        return *std::move(made);
    }
}

void BoundRaster::Run::startOnDevice() {
    RegionJob& job = jobs_.emplace_back();
    const Timer timer;
    const auto made = std::make_shared<const RecordMaker::Made>(makeRecords(job));
    statistics_.addMs(stage::bin, timer.elapsedMs());
    statistics_.add(counted::exactElements, std::int64_t(made->hard.size()));
    // Those that the processor decides become a mesh of their own.
    const TetMesh hard = bound_.mesh_.part(made->hard);
    const NodeFrame hardFrame = frameNodes(hard, lattice_, execution_);
    const std::vector<ChannelCoding> hardChannels = bound_.channelsOn(hard);
    const RasterInputs ofHard{hard, hardFrame, hardChannels, bound_.format_, axes_};
    job.prepared.hard.resize(made->hard.size());
    std::iota(job.prepared.hard.begin(), job.prepared.hard.end(), 0);
    const RasterInputs inputs = this->inputs();
    for (std::size_t pass = 0; pass < inputs.passCount(); ++pass) {
        const bool isLast = pass + 1 == inputs.passCount();
        job.draws.push_back(device_.thread().post([this, &job, inputs, pass](GlContext& context) {
            device_.begin(context, job.region.points, inputs, pass, *deviceMesh_, bound_.isScan_);
        }));
        auto points = std::make_shared<const std::vector<DecidedPoint>>(
            decideHardElements(ofHard, job.prepared, pass, execution_));
        job.draws.push_back(device_.thread().post([this, points, made, pass, isLast](GlContext& context) {
            if (bound_.isScan_) {
                ScanRecords records = device_.records().records();
                records.runs = made->runs;
                device_.scan(context, records, *points, pass, isLast);
                return;
            }
            device_.draw(context, *deviceMesh_, bound_.generator_->shader(), made->layers,
                         budget_.queueBytes);
            device_.draw(context, *points);
        }));
        postResult(job, pass);
    }
}

void BoundRaster::Run::start(std::size_t index) {
    RegionJob& job = jobs_.emplace_back();
    job.region = std::move(left_.front());
    left_.pop_front();
    const RasterInputs inputs = this->inputs();
    const Timer timer;
    const auto prepare = bound_.isPublished_ ? preparePublishedRegion : prepareRegion;
    job.prepared = prepare(inputs, job.region.points, bins_.of(index), execution_);
    statistics_.addMs(stage::bin, timer.elapsedMs());
    statistics_.add(counted::exactElements, std::int64_t(job.prepared.hard.size()));
    statistics_.add(counted::elementSlicePairs, job.prepared.emptyPairs);
    for (std::size_t pass = 0; pass < inputs.passCount(); ++pass) {
        job.draws.push_back(device_.thread().post([this, &job, inputs, pass](GlContext& context) {
            device_.begin(context, job.prepared, inputs, pass, bound_.isScan_);
        }));
        generate(job, pass);
        postResult(job, pass);
    }
    job.batches.clear();
}

void BoundRaster::Run::postResult(RegionJob& job, std::size_t pass) {
    if (slots_)
        job.draws.push_back(device_.thread().post(
            [this, pass, &job](GlContext& context) { keep(context, job.region, pass); }));
    else
        job.images.push_back(
            device_.thread().post([this](GlContext& context) { return device_.readBack(context); }));
}

void BoundRaster::Run::keep(GlContext& context, const RasterRegion& region, std::size_t pass) {
    for (const RasterRegion::Part& part : region.parts) {
        SlotPlace place = slots_->place(part.box, pass);
        place.at += part.points.min - boxes_[part.box].min;
        device_.copyTo(context, part.points, place, region.points.min);
    }
    device_.finishRegion(context);
}

void BoundRaster::Run::post(RegionJob& job, std::shared_ptr<const SliceBatch> batch,
                            std::shared_ptr<const void> room) {
    job.draws.push_back(device_.thread().post([this, batch = std::move(batch), room = std::move(room)](
                                                  GlContext& context) { device_.draw(context, *batch); }));
}

void BoundRaster::Run::emit(RegionJob& job, std::size_t pass) {
    constexpr int kLayersASlab = 8;
    const RasterInputs inputs = this->inputs();
    const PreparedRegion& prepared = job.prepared;
    const int layers = prepared.points.size()[axes_.l];
    const ActiveElements active = listActiveElements(prepared, axes_, kLayersASlab);
    std::vector<SlabInput> slabs;
    std::int64_t bytes = 0;
    for (std::size_t s = 0; s < active.slabCount(); ++s) {
        if (active.of(s).empty()) continue;
        SlabInput& slab = slabs.emplace_back();
        slab.axes = axes_;
        slab.size = prepared.points.size();
        slab.layerBegin = int(s) * kLayersASlab;
        slab.layerEnd = std::min(slab.layerBegin + kLayersASlab, layers);
        slab.elements = prepared.elements;
        slab.active = active.of(s);
        if (bound_.isPublished_) {
            slab.published = prepared.published;
            slab.nodeCodes = prepared.nodeCodes[pass];
            slab.channels = inputs.recordedChannels(pass);
        }
        bytes += primitiveBytes(slab);
    }
    // Primitives know nothing of channels, but those of the published methods hold values.
    const bool areKept = inputs.passCount() > 1 && !bound_.isPublished_ && bytes <= budget_.queueBytes;
    parallelFor(execution_, std::int64_t(slabs.size()), [&](std::int64_t i) {
        const SlabInput& slab = slabs[std::size_t(i)];
        std::shared_ptr<const void> room = room_.take(primitiveBytes(slab));
        auto batch = std::make_shared<SliceBatch>();
        if (bound_.isPublished_)
            bound_.generator_->emitPublished(slab, *batch);
        else
            bound_.generator_->emit(slab, *batch);
        const std::lock_guard guard(mutex_);
        if (pass == 0) {
            statistics_.add(counted::elementSlicePairs, batch->pairs);
            statistics_.add(counted::polygons, batch->polygons);
        }
        if (areKept) job.batches.push_back(batch);
        post(job, std::move(batch), std::move(room));
    });
}

void BoundRaster::Run::generate(RegionJob& job, std::size_t pass) {
    const Timer timer;
    const RasterInputs inputs = this->inputs();
    if (bound_.isScan_)
        job.boxes = job.boxes ? job.boxes : std::make_shared<const ScanBoxes>(listScanBoxes(job.prepared));
    else if (job.batches.empty())
        emit(job, pass);
    else
        for (const auto& batch : job.batches) post(job, batch, nullptr);
    auto points = std::make_shared<const std::vector<DecidedPoint>>(
        decideHardElements(inputs, job.prepared, pass, execution_));
    job.draws.push_back(device_.thread().post(
        [this, points, boxes = job.boxes, pass, isLast = pass + 1 == inputs.passCount()](GlContext& context) {
            if (boxes)
                device_.scan(context, *boxes, *points, pass, isLast);
            else
                device_.draw(context, *points);
        }));
    statistics_.addMs(stage::generate, timer.elapsedMs());
}

void BoundRaster::Run::finishOldest() {
    RegionJob& job = jobs_.front();
    std::vector<RasterImage> images;
    for (auto& draw : job.draws) draw.get();
    for (auto& image : job.images) {
        images.push_back(image.get());
        if (!images.back().isFilled)
            device_.thread().run([&](GlContext& context) { device_.waitFor(context, images.back()); });
    }
    job.prepared = {};
    if (slots_) {
        jobs_.pop_front();
        return;
    }
    const auto& parts = job.region.parts;
    parallelFor(execution_, std::int64_t(parts.size()),
                [&](std::int64_t p) { copyPart(job.region, parts[std::size_t(p)], images); });
    jobs_.pop_front();
}

Block& BoundRaster::Run::open(std::size_t box) {
    const std::lock_guard lock(mutex_);
    std::unique_ptr<Block>& opened = blocks_[box];
    if (!opened) {
        opened = std::make_unique<Block>();
        Block& block = *opened;
        block.lattice = lattice_;
        block.box = boxes_[box];
        block.channels = int(bound_.channels_.size());
        block.values.assign(block.count() * bound_.channels_.size(), 0.0f);
        block.coverage.assign(block.count(), 0);
    }
    return *opened;
}

void BoundRaster::Run::deliver(std::size_t box) {
    sink_(box, *blocks_[box]);
    blocks_[box].reset();
}

void BoundRaster::Run::copyPart(const RasterRegion& region, const RasterRegion::Part& part,
                                const std::vector<RasterImage>& images) {
    Block& block = open(part.box);
    std::int64_t covered = 0;
    for (std::size_t pass = 0; pass < images.size(); ++pass)
        copyChannels(region, part, images[pass], pass, block, covered);
    bool isWhole = false;
    {
        const std::lock_guard lock(mutex_);
        statistics_.add(counted::coveredPoints, covered);
        isWhole = --partsLeft_[part.box] == 0;
    }
    if (isWhole) deliver(part.box);
}

/// The usual case, without a branch a point: one channel, and coverage that the codes tell.
std::int64_t copyRow(const float* codes, std::int64_t stride, int count, const ChannelCoding& coding,
                     const SampleMarks& marks, float* values, std::uint8_t* coverage) {
    int covered = 0;
    for (int i = 0; i < count; ++i) {
        const float code = codes[i * stride];
        const bool isCovered = code != marks.uncovered;
        const float value =
            code >= marks.invalidFrom ? std::numeric_limits<float>::quiet_NaN() : coding.decode(code);
        values[i] = isCovered ? value : 0.0f;
        coverage[i] = isCovered;
        covered += isCovered;
    }
    return covered;
}

void BoundRaster::Run::copyChannels(const RasterRegion& region, const RasterRegion::Part& part,
                                    const RasterImage& image, std::size_t pass, Block& block,
                                    std::int64_t& covered) const {
    const RasterInputs inputs = this->inputs();
    const std::span<const ChannelCoding> codings = inputs.channelsOf(pass);
    const SampleMarks marks = sampleMarks(bound_.format_);
    const Vec3i size = region.points.size();
    std::int64_t stride[3];
    stride[axes_.s] = 1;
    stride[axes_.t] = size[axes_.s];
    stride[axes_.l] = std::int64_t(size[axes_.s]) * size[axes_.t];
    const bool hasCoverage = !image.coverage.empty();
    Vec3i p = part.points.min;
    for (p.z = part.points.min.z; p.z < part.points.max.z; ++p.z)
        for (p.y = part.points.min.y; p.y < part.points.max.y; ++p.y) {
            const Vec3i at = p - region.points.min;
            const std::int64_t from = at.x * stride[0] + at.y * stride[1] + at.z * stride[2];
            const std::size_t to = block.offset(p);
            const int count = part.points.max.x - part.points.min.x;
            if (codings.size() == 1 && pass == 0 && !hasCoverage) {
                covered +=
                    copyRow(image.codes.data() + from * image.components, stride[0] * image.components, count,
                            codings[0], marks, block.values.data() + to, block.coverage.data() + to);
                continue;
            }
            for (int i = 0; i < count; ++i) {
                const auto pixel = std::size_t(from + i * stride[0]);
                const float* codes = image.codes.data() + pixel * std::size_t(image.components);
                const bool isCovered = hasCoverage ? image.coverage[pixel] != 0 : codes[0] != marks.uncovered;
                if (!isCovered) continue;
                block.coverage[to + std::size_t(i)] = 1;
                covered += pass == 0;
                for (std::size_t c = 0; c < codings.size(); ++c) {
                    const bool isInvalid =
                        hasCoverage ? ((image.coverage[pixel] - 1) >> c) & 1 : codes[c] >= marks.invalidFrom;
                    block.values[(pass * kChannelsAPass + c) * block.count() + to + std::size_t(i)] =
                        isInvalid ? std::numeric_limits<float>::quiet_NaN() : codings[c].decode(codes[c]);
                }
            }
        }
}

}  // namespace

RasterResampler::RasterResampler(std::string name, std::string description, Method method,
                                 std::unique_ptr<const SliceGenerator> generator)
    : Resampler({.name = std::move(name),
                 .description = std::move(description),
                 .isOnDevice = true,
                 .isSliced = method != Method::scan,
                 .targetsAgree = false,
                 .meetsContract = method != Method::published,
                 .formats = {SampleFormat::r32f, SampleFormat::r16f, SampleFormat::r16, SampleFormat::r8},
                 .spillBoundVoxels = 0x1p-8,
                 .placeBoundVoxels = 0x1p-8}),
      method_(method),
      generator_(std::move(generator)) {}

std::string RasterResampler::unavailableReason() const {
    return availableGlPlatforms().empty() ? noGlReason() : std::string();
}

WorkMemory RasterResampler::workMemory(int channels) const {
    return rasterWorkMemory(channels);
}

std::vector<std::string> RasterResampler::targets() const {
    std::vector<std::string> names;
    for (const GlPlatform platform : availableGlPlatforms()) names.emplace_back(nameOf(platform));
    return names;
}

std::unique_ptr<BoundResampler> RasterResampler::bind(const TetMesh& mesh, std::span<const int> fields,
                                                      const BindOptions& options) const {
    std::optional<GlPlatform> wanted;
    if (!options.target.empty()) wanted = parseGlPlatform(options.target);
    return std::make_unique<BoundRaster>(mesh, fields, options, chooseGlPlatform(wanted), generator_,
                                         method_ == Method::published);
}

}  // namespace tessera
