#include "job/vdb_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "base/parallel.h"
#include "job/vdb_contents.h"
#include "pool/pool_target.h"
#include "pool/stored_bricks.h"
#include "tessera/error.h"

namespace tessera {

namespace {

/// One component of a field, or the length of a vector.
class ShownChannel {
  public:
    ShownChannel(const OutputField& field, std::optional<int> component) : field_(field) {
        if (component || field.components == 1) only_ = field.firstChannel + component.value_or(0);
    }

    /// A block of that channel alone.
    std::shared_ptr<const Block> of(const Block& block) const {
        auto shown = std::make_shared<Block>();
        shown->lattice = block.lattice;
        shown->box = block.box;
        shown->channels = 1;
        shown->coverage = block.coverage;
        const std::size_t points = block.count();
        shown->values.resize(points);
        for (std::size_t p = 0; p < points; ++p) shown->values[p] = valueAt(block, p);
        return shown;
    }

  private:
    float valueAt(const Block& block, std::size_t point) const {
        const auto at = [&](int channel) {
            return double(block.values[std::size_t(channel) * block.count() + point]);
        };
        if (only_ >= 0) return float(at(only_));
        double square = 0;
        for (int c = 0; c < field_.components; ++c)
            square += at(field_.firstChannel + c) * at(field_.firstChannel + c);
        return float(std::sqrt(square));
    }

    const OutputField& field_;
    int only_ = -1;
};

BrickPool makePool(GlThread& thread, std::size_t bricks, int brickCells, const ValueRange& range) {
    TexelCoding coding({ValueCoding(range, SampleFormat::r32f)}, SampleFormat::r32f);
    const std::int64_t edge = brickCells + 1;
    PoolOptions options;
    options.budgetBytes = std::int64_t(bricks) * edge * edge * edge * coding.pointBytes();
    // A little more, as atlases aren't of every size.
    options.budgetBytes += options.budgetBytes / 8 + 64 * edge * edge * edge * coding.pointBytes();
    return {thread, brickCells, std::move(coding), options};
}

class VdbSource : public PictureSource {
  public:
    VdbSource(VdbFile file, const OutputField& field, std::optional<int> component, GlThread& thread,
              Job& job)
        : threads_(job.execution.threads),
          title_(titleOf(field, component)),
          bounds_(coveredBounds(file)),
          frame_{file.tree.originWorld(),
                 file.tree.spacingWorld(levelOf(Depth(0), Depth(file.tree.levelCount() - 1))),
                 file.tree.brickCells()} {
        for (const OutputField& there : file.fields) fields_.push_back({there.name, there.components});
        if (bounds_.empty()) throw InputError("no voxel lies in the mesh: nothing to draw");
        const ShownChannel channel(field, component);
        StoredBricks stored =
            showStored(file.tree, file.store, {file.layers, file.halfFloat, true}, job.execution);
        file.store = BrickStore();
        parallelFor(job.execution, std::int64_t(stored.bricks.size()), [&](std::int64_t i) {
            ShownBrick& brick = stored.bricks[std::size_t(i)];
            brick.samples = channel.of(*brick.samples);
        });
        for (const ShownBrick& brick : stored.bricks)
            for (std::size_t p = 0; p < brick.samples->count(); ++p) {
                const auto value = double(brick.samples->values[p]);
                if (brick.samples->coverage[p] == 0 || !std::isfinite(value)) continue;
                range_.min = std::min(range_.min, value);
                range_.max = std::max(range_.max, value);
            }
        if (range_.empty()) throw InputError(fmt::format("{} has no finite value: nothing to draw", title_));
        // What lies beyond the layers of an extension isn't read.
        if (file.layers == 0)
            for (const std::string& note : stored.notes) job.say(note + "\n");
        if (file.statistics) errors_ = std::move(file.statistics->errors);
        stored_ = std::move(stored.bricks);
        for (std::size_t i = 0; i < stored_.size(); ++i) {
            const DepthKey& key = stored_[i].leaf.key;
            places_.emplace(key, i);
            deepest_ = std::max(deepest_, key.depth.halvings());
        }
        fillPool(thread);
    }

    const std::string& title() const override { return title_; }
    const Box3d& boundsWorld() const override { return bounds_; }
    const ValueRange& range() const override { return range_; }
    const std::vector<PictureField>& fields() const override { return fields_; }
    const BrickPool& pool() const override { return *pool_; }
    const BrickFrame& frame() const override { return frame_; }
    std::span<const PlacedBrick> bricks() const override { return placed_; }

    std::optional<Samples> samplesAt(const Vec3d& placeWorld) const override {
        for (int depth = 0; depth <= deepest_; ++depth) {
            const double edge = frame_.spacingWorld(Depth(depth)) * frame_.cells;
            const DepthKey key{Depth(depth), Vec3i(glm::floor((placeWorld - frame_.originWorld) / edge))};
            if (const auto at = places_.find(key); at != places_.end())
                return Samples{key, stored_[at->second].samples};
        }
        return std::nullopt;
    }
    std::vector<float> brickErrors() const override {
        std::vector<float> errors;
        if (!errors_.empty())
            for (const PlacedBrick& brick : placed_) errors.push_back(errors_[places_.at(brick.key)]);
        return errors;
    }
    void moveTo(GlThread& thread) override { fillPool(thread); }

  private:
    // Samples of coarse bricks stand for more of the volume.
    void fill(ValueHistogram& histogram) const override {
        for (const ShownBrick& brick : stored_) {
            const double volume = std::ldexp(1.0, -3 * brick.leaf.key.depth.halvings());
            for (std::size_t p = 0; p < brick.samples->count(); ++p)
                if (brick.samples->coverage[p] != 0) histogram.add(double(brick.samples->values[p]), volume);
        }
    }

    void fillPool(GlThread& thread) {
        pool_.reset();
        pool_.emplace(makePool(thread, stored_.size(), frame_.cells, range_));
        PoolTarget target(*pool_, threads_);
        target.publish({.removed = {}, .added = stored_});
        if (target.isBehind()) target.catchUp();
        placed_ = placeBricks(target, 0);
    }

    int threads_;
    std::vector<PictureField> fields_;
    std::string title_;
    Box3d bounds_;
    BrickFrame frame_;
    ValueRange range_;
    std::vector<ShownBrick> stored_;
    std::unordered_map<DepthKey, std::size_t, DepthKeyHash> places_;  // in stored_
    int deepest_ = 0;
    std::vector<float> errors_;  // one of each; empty: the file has none
    std::vector<PlacedBrick> placed_;
    std::optional<BrickPool> pool_;
};

}  // namespace

std::unique_ptr<PictureSource> openVdbSource(const std::string& path, const std::string& field,
                                             std::optional<int> component, GlThread& thread, Job& job) {
    VdbFile file = openVdb(path, VdbContents::all, job);
    const OutputField shown = chooseField(file, field);
    titleOf(shown, component);
    try {
        return std::make_unique<VdbSource>(std::move(file), shown, component, thread, job);
    } catch (const InputError& error) {
        throw InputError(path + ": " + error.what());
    }
}

}  // namespace tessera
