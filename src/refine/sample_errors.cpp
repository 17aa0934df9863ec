#include "refine/sample_errors.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <limits>

#include "base/large_pages.h"
#include "base/parallel.h"
#include "refine/batch_sampler.h"
#include "refine/node_set.h"

namespace tessera {

namespace {

constexpr std::int64_t kErrorChunk = 16384;
constexpr std::int64_t kRunChunk = 16;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNodeWeight = 1.0 / 20, kCentroidWeight = 4.0 / 5;

// A sample whose cell isn't made of stored samples alone; its leaf's turn comes after all others.
struct Deferred {
    std::uint32_t sample;
    std::int32_t leaf;
    double volume;  // elements only
};

// What one chunk of samples comes to.
struct Part {
    std::vector<FieldSums> sums;
    // Of what is measured in batches, until the part is done: one a field, and one a channel.
    std::vector<SquareSums> squares;
    std::vector<LaneSums> integrals;
    std::vector<Deferred> deferred;
    std::int64_t inside = 0, outside = 0, fullyCovered = 0, incomplete = 0, flat = 0, inverted = 0;
};

void raise(double& slot, double value) {
    std::atomic_ref<double> largest(slot);
    double old = largest.load(std::memory_order_relaxed);
    while (value > old && !largest.compare_exchange_weak(old, value, std::memory_order_relaxed)) {
    }
}

class Measurement {
  public:
    Measurement(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                const Reconstruction& reconstruction, const std::optional<Box3d>& boundsWorld,
                const Execution& execution, std::vector<double>* leafErrors);
    SampleErrors run();

  private:
    std::vector<Part> measureNodes(const NodeSet* used);
    std::vector<Part> measureElements(NodeSet& used);
    template <class MeasureBatches>
    std::vector<Part> measureParts(std::int64_t count, const MeasureBatches& measureBatches);
    void measureBatch(SampleBatch& batch, Part& part);
    void keepBatch(const SampleBatch& batch, Part& part);
    void keep(std::uint32_t sample, std::int32_t leaf, std::span<const double> errors, Part& part);
    void addElements(const SampleBatch& batch, Part& part) const;
    void finish(Part& part) const;
    double centroidWeight(const SampledField& field) const { return field.isCell() ? 1 : kCentroidWeight; }
    void measureDeferred(std::vector<Part>& parts);
    void advance(std::int64_t pieces);
    Part newPart() const;
    void addSums(const std::vector<Part>& parts, SampleErrors& result) const;

    const SampledMesh& samples_;
    const TetMesh& mesh_;
    const BrickTree& tree_;
    const BrickStore& store_;
    const Reconstruction& reconstruction_;
    const Execution& execution_;
    std::vector<double>* leafErrors_;
    Box3d bounds_{Vec3d(-kInfinity), Vec3d(kInfinity)};  // from the tree's origin
    BatchSampler sampler_;
    std::vector<std::vector<float>> lists_;
    std::atomic<std::int64_t> done_{0};  // pieces of work, see advance
};

Measurement::Measurement(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                         const Reconstruction& reconstruction, const std::optional<Box3d>& boundsWorld,
                         const Execution& execution, std::vector<double>* leafErrors)
    : samples_(samples),
      mesh_(samples.mesh()),
      tree_(tree),
      store_(store),
      reconstruction_(reconstruction),
      execution_(execution),
      leafErrors_(leafErrors),
      sampler_(samples, tree, store, execution),
      lists_(samples.fields().size()) {
    for (std::vector<float>& list : lists_) {
        reserveLarge(list, samples.count());
        list.assign(samples.count(), -1.0f);
    }
    if (boundsWorld) bounds_ = {boundsWorld->min - tree.originWorld(), boundsWorld->max - tree.originWorld()};
}

// A sample is two pieces of work, the second one done at once unless it is deferred.
void Measurement::advance(std::int64_t pieces) {
    const std::int64_t all = 2 * (mesh_.nodeCount() + mesh_.elementCount());
    execution_.report(Stage::measuring, done_ += pieces, all);
}

Part Measurement::newPart() const {
    Part part;
    part.sums.resize(lists_.size());
    for (std::size_t f = 0; f < part.sums.size(); ++f)
        part.sums[f].integralMesh.assign(std::size_t(samples_.fields()[f].field->components), 0);
    part.squares.resize(lists_.size());
    part.integrals.resize(std::size_t(samples_.channels()));
    return part;
}

// Errors of the batch's samples: kept, or put off where they aren't made of stored samples alone.
void Measurement::measureBatch(SampleBatch& batch, Part& part) {
    sampler_.findLeaves(bounds_, batch);
    sampler_.measure(batch);
    keepBatch(batch, part);
    part.inside += std::popcount(batch.inLeaves);
    part.outside += std::popcount(batch.samples & ~batch.inLeaves);
    part.fullyCovered += std::popcount(batch.kept);
    for (LaneBits left = batch.inLeaves & ~batch.kept; left; left &= left - 1) {
        const std::size_t i = std::size_t(std::countr_zero(left));
        part.deferred.push_back({batch.first + std::uint32_t(i), batch.leaf[i], batch.volume[i]});
    }
}

void Measurement::keepBatch(const SampleBatch& batch, Part& part) {
    const bool isNode = batch.first < samples_.nodeCount();
    LaneFloats listed;
    for (std::size_t f = 0; f < lists_.size(); ++f) {
        const SampledField& field = samples_.fields()[f];
        if (isNode && field.isCell()) continue;
        const double worst = measure::listErrors(batch, batch.errors[f], errorUnit(field), listed);
        std::copy_n(listed.lane, batch.count, lists_[f].data() + batch.first);
        if (worst > part.sums[f].worst.error) {
            std::uint32_t i = 0;
            while (!(batch.kept >> i & 1 && batch.errors[f][i] == worst)) ++i;
            part.sums[f].worst.take(worst, batch.first + i);
        }
        if (!isNode) measure::addSquares(batch, listed, centroidWeight(field), part.squares[f]);
        if (!leafErrors_ || !(field.range > 0)) continue;
        for (LaneBits left = batch.kept; left; left &= left - 1) {
            const std::size_t i = std::size_t(std::countr_zero(left));
            raise((*leafErrors_)[std::size_t(batch.leaf[i])], batch.errors[f][i] / field.range);
        }
    }
}

void Measurement::keep(std::uint32_t sample, std::int32_t leaf, std::span<const double> errors, Part& part) {
    double largest = 0;
    for (std::size_t f = 0; f < errors.size(); ++f) {
        const SampledField& field = samples_.fields()[f];
        const double share = errors[f] / errorUnit(field);
        lists_[f][sample] = errors[f] < 0 ? -1.0f : float(share);
        part.sums[f].worst.take(errors[f], sample);
        if (field.range > 0 && share > largest) largest = share;
    }
    if (leafErrors_) raise((*leafErrors_)[std::size_t(leaf)], largest);
}

// What elements add beside the centroids' errors: their nodes' and the exact field's integral.
void Measurement::addElements(const SampleBatch& batch, Part& part) const {
    for (std::size_t f = 0; f < lists_.size(); ++f)
        if (!samples_.fields()[f].isCell())
            measure::addNodeSquares(batch, lists_[f].data(), kNodeWeight, part.squares[f]);
    for (std::size_t c = 0; c < batch.exact.size(); ++c)
        measure::addIntegral(batch, batch.exact[c], part.integrals[c]);
}

// Adds up the lanes of what a part measured in batches.
void Measurement::finish(Part& part) const {
    for (std::size_t f = 0; f < lists_.size(); ++f) {
        part.sums[f].squares += {part.squares[f].squares.sum(), part.squares[f].weights.sum()};
        std::vector<double>& integral = part.sums[f].integralMesh;
        for (std::size_t k = 0; k < integral.size(); ++k)
            integral[k] += part.integrals[std::size_t(samples_.fields()[f].firstChannel) + k].sum();
    }
}

// Calls measureBatches(first, count, batch, part) for all samples of a kind, a batch at a time.
template <class MeasureBatches>
std::vector<Part> Measurement::measureParts(std::int64_t count, const MeasureBatches& measureBatches) {
    std::vector<Part> parts(std::size_t((count + kErrorChunk - 1) / kErrorChunk));
    parallelForChunks(execution_, count, kErrorChunk, [&](std::int64_t begin, std::int64_t end) {
        Part& part = parts[std::size_t(begin / kErrorChunk)] = newPart();
        SampleBatch batch(samples_.channels(), lists_.size());
        for (std::int64_t first = begin; first < end; first += kMeasureLanes)
            measureBatches(first, int(std::min(end - first, std::int64_t(kMeasureLanes))), batch, part);
        finish(part);
        advance(2 * (end - begin) - std::int64_t(part.deferred.size()));
    });
    measureDeferred(parts);
    return parts;
}

// @param used those that are samples; all when null.
std::vector<Part> Measurement::measureNodes(const NodeSet* used) {
    return measureParts(mesh_.nodeCount(),
                        [&](std::int64_t first, int count, SampleBatch& batch, Part& part) {
                            sampler_.gatherNodes(first, count, batch);
                            for (int i = 0; used && i < count; ++i)
                                if (!used->contains(std::size_t(first + i)))
                                    batch.samples &= ~(LaneBits(1) << i);
                            measureBatch(batch, part);
                        });
}

// The nodes' errors are known by now. @param used receives the nodes of elements that aren't flat.
std::vector<Part> Measurement::measureElements(NodeSet& used) {
    return measureParts(mesh_.elementCount(),
                        [&](std::int64_t first, int count, SampleBatch& batch, Part& part) {
                            const auto counts = sampler_.gatherElements(first, count, batch);
                            part.flat += counts.flat;
                            part.inverted += counts.inverted;
                            for (LaneBits left = batch.samples; left; left &= left - 1)
                                used.insert(batch.tet[std::countr_zero(left)]);
                            measureBatch(batch, part);
                            addElements(batch, part);
                        });
}

// Measures what the parts put off, leaf by leaf, so that a corner outside the mesh or on a seam is worked out
// once for its leaf; appends the parts that this makes.
void Measurement::measureDeferred(std::vector<Part>& parts) {
    std::vector<Deferred> all;
    for (Part& part : parts) {
        all.insert(all.end(), part.deferred.begin(), part.deferred.end());
        part.deferred = {};
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const Deferred& a, const Deferred& b) { return a.leaf < b.leaf; });
    std::vector<std::size_t> runs;  // where each leaf's begin
    for (std::size_t i = 0; i < all.size(); ++i)
        if (i == 0 || all[i].leaf != all[i - 1].leaf) runs.push_back(i);
    const std::size_t before = parts.size();
    const std::int64_t count = std::int64_t(runs.size());
    runs.push_back(all.size());
    parts.resize(before + std::size_t((count + kRunChunk - 1) / kRunChunk));
    parallelForChunks(execution_, count, kRunChunk, [&](std::int64_t begin, std::int64_t end) {
        Part& part = parts[before + std::size_t(begin / kRunChunk)] = newPart();
        LeafSampler sampler(samples_, tree_, store_, reconstruction_);
        std::vector<double> errors(lists_.size());
        for (std::int64_t run = begin; run < end; ++run) {
            sampler.enter(std::size_t(all[runs[std::size_t(run)]].leaf));
            for (std::size_t i = runs[std::size_t(run)]; i < runs[std::size_t(run) + 1]; ++i) {
                const PointSource source = sampler.measure(all[i].sample, errors);
                part.fullyCovered += source == PointSource::covered;
                part.incomplete += source == PointSource::missing;
                keep(all[i].sample, all[i].leaf, errors, part);
                if (all[i].sample < samples_.nodeCount()) continue;
                for (std::size_t f = 0; f < lists_.size(); ++f)
                    part.sums[f].squares.add(lists_[f][all[i].sample],
                                             centroidWeight(samples_.fields()[f]) * all[i].volume);
            }
            advance(std::int64_t(runs[std::size_t(run) + 1] - runs[std::size_t(run)]));
        }
    });
}

void Measurement::addSums(const std::vector<Part>& parts, SampleErrors& result) const {
    for (const Part& part : parts) {
        result.outside += part.outside;
        result.fullyCovered += part.fullyCovered;
        result.incomplete += part.incomplete;
        result.flatElements += part.flat;
        result.invertedElements += part.inverted;
        for (std::size_t f = 0; f < result.sums.size(); ++f) {
            FieldSums& sums = result.sums[f];
            const FieldSums& more = part.sums[f];
            if (more.worst.error >= 0) sums.worst.take(more.worst.error, more.worst.sample);
            sums.squares += more.squares;
            for (std::size_t k = 0; k < sums.integralMesh.size(); ++k)
                sums.integralMesh[k] += more.integralMesh[k];
        }
    }
}

SampleErrors Measurement::run() {
    // Nodes count as samples until the elements have said which are. A leaf's largest error can't be taken
    // back, so it needs to know from the start.
    std::optional<NodeSet> known;
    if (leafErrors_) known = nodesOfVolumes(mesh_, execution_);
    std::vector<Part> nodes = measureNodes(known ? &*known : nullptr);
    NodeSet used(samples_.nodeCount());
    const std::vector<Part> elements = measureElements(used);
    SampleErrors result;
    result.sums = newPart().sums;
    addSums(elements, result);
    if (!known && !used.containsAll()) {
        for (auto& list : lists_) std::fill(list.begin(), list.begin() + mesh_.nodeCount(), -1.0f);
        nodes = measureNodes(&used);
    }
    addSums(nodes, result);
    for (const Part& part : nodes) result.nodes += part.inside;
    for (const Part& part : elements) result.centroids += part.inside;
    result.lists = std::move(lists_);
    return result;
}

}  // namespace

SampleErrors measureSamples(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                            const Reconstruction& reconstruction, const std::optional<Box3d>& boundsWorld,
                            const Execution& execution, std::vector<double>* leafErrors) {
    if (leafErrors) leafErrors->assign(tree.leafCount(), 0.0);
    return Measurement(samples, tree, store, reconstruction, boundsWorld, execution, leafErrors).run();
}

}  // namespace tessera
