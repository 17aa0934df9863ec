#include "refine/sample_errors.h"

#include <array>
#include <atomic>
#include <cmath>

#include "base/large_pages.h"
#include "base/parallel.h"
#include "brick/leaf_tiles.h"
#include "mesh/geometry.h"
#include "refine/node_set.h"

namespace tessera {

namespace {

constexpr std::int64_t kErrorChunk = 16384;
constexpr std::int64_t kRunChunk = 16;
constexpr std::int64_t kPrefetch = 16;  // elements ahead: nodes are reached in no order
constexpr std::size_t kBatch = 128;
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
    std::vector<Deferred> deferred;
    std::int64_t inside = 0, outside = 0, fullyCovered = 0, incomplete = 0, flat = 0, inverted = 0;
};

// Some samples on their way. The corners' addresses are found for all of them before the first value is read,
// so that the reads from memory overlap.
struct Batch {
    explicit Batch(int channels) : exact(std::size_t(channels) * kBatch) {}
    std::size_t count = 0;
    std::array<std::uint32_t, kBatch> sample;
    std::array<Vec3d, kBatch> placeWorld;  // from the tree's origin
    std::array<double, kBatch> volume;
    std::array<std::int32_t, kBatch> leaf;
    std::array<bool, kBatch> direct;
    std::array<Vec3d, kBatch> fraction;
    std::array<std::array<const float*, 8>, kBatch> corner;
    std::vector<double> exact;  // [channel * kBatch + position]
};

// Samples come near the last one, so its leaf is tried first, as long as that mostly succeeds.
class LastLeaf {
  public:
    LastLeaf(const BrickTree& tree, const LeafTiles& tiles)
        : tree_(tree), tiles_(tiles), inverseSpacing0_(1.0 / tree.spacingWorld(0)) {}
    /// The leaf that holds a place, -1 when there is none; world units from the tree's origin.
    std::int32_t find(const Vec3d& placeWorld);
    /// That place in the leaf's index space, from its first point.
    Vec3d local() const { return local_; }

  private:
    void locate(const Vec3d& placeWorld);
    bool isInside() const;

    const BrickTree& tree_;
    const LeafTiles& tiles_;
    double inverseSpacing0_;  // of level 0, 1 / world units
    std::int32_t leaf_ = -1;
    int credit_ = 8;
    Vec3d local_{0};
};

void LastLeaf::locate(const Vec3d& placeWorld) {
    const LeafTiles::Leaf& leaf = tiles_.leaf(std::size_t(leaf_));
    local_ = placeWorld * leaf.inverseSpacing - leaf.firstPoint;
}

bool LastLeaf::isInside() const {
    const double edge = tree_.brickCells();
    return local_.x >= 0 && local_.y >= 0 && local_.z >= 0 && local_.x < edge && local_.y < edge &&
           local_.z < edge;
}

std::int32_t LastLeaf::find(const Vec3d& placeWorld) {
    if (leaf_ >= 0 && credit_ > 0) {
        locate(placeWorld);
        credit_ += isInside() ? 1 : -1;
        if (isInside()) return leaf_;
    }
    leaf_ = leafOfPlace(tree_, placeWorld * inverseSpacing0_);
    if (leaf_ >= 0) locate(placeWorld);
    return leaf_;
}

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
    std::vector<Part> measureNodes(const NodeSet& used);
    std::vector<Part> measureElements();
    void gatherElements(std::int64_t begin, std::int64_t end, Batch& batch, Part& part);
    void locate(Batch& batch) const;
    bool findCorners(std::size_t leaf, const Vec3i& cell, std::array<const float*, 8>& corner) const;
    void measureBatch(Batch& batch, Part& part);
    bool fieldErrors(const Batch& batch, std::size_t i, std::span<double> errors) const;
    void keep(std::uint32_t sample, std::int32_t leaf, std::span<const double> errors, Part& part);
    void addBatch(std::size_t f, const Batch& batch, FieldSums& sums) const;
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
    std::optional<Box3d> bounds_;  // from the tree's origin
    LeafTiles tiles_;
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
      tiles_(tree, store, execution),
      lists_(samples.fields().size()) {
    for (std::vector<float>& list : lists_) {
        reserveLarge(list, samples.count());
        list.assign(samples.count(), -1.0f);
    }
    if (boundsWorld)
        bounds_ = Box3d{boundsWorld->min - tree.originWorld(), boundsWorld->max - tree.originWorld()};
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
    return part;
}

// Sets the corners' addresses when all eight are stored and covered.
bool Measurement::findCorners(std::size_t leaf, const Vec3i& cell,
                              std::array<const float*, 8>& corner) const {
    const TileView* tiles = tiles_.tiles(leaf);
    const int n = tiles_.edge();
    const Vec3i tile = cell >> 3, in = cell & 7;
    if (in.x < 7 && in.y < 7 && in.z < 7) {
        const TileView& view = tiles[(tile.x * n + tile.y) * n + tile.z];
        if (!view.values) return false;
        const int offset = (in.x * 8 + in.y) * 8 + in.z;
        if (view.coverage) {
            const std::uint64_t four = 0x303ull << (offset & 63);  // (0 or 1, 0 or 1) along y and z
            if (~(view.coverage[in.x] & view.coverage[in.x + 1]) & four) return false;
        }
        for (std::size_t c = 0; c < 8; ++c)
            corner[c] = view.values + offset + (c & 1 ? 64 : 0) + (c & 2 ? 8 : 0) + (c & 4 ? 1 : 0);
        return true;
    }
    for (int c = 0; c < 8; ++c) {
        const Vec3i p = cell + cornerOffset(c);
        const TileView& view = tiles[((p.x >> 3) * n + (p.y >> 3)) * n + (p.z >> 3)];
        const int offset = ((p.x & 7) * 8 + (p.y & 7)) * 8 + (p.z & 7);
        if (!view.values || !view.covered(offset)) return false;
        corner[std::size_t(c)] = view.values + offset;
    }
    return true;
}

void Measurement::locate(Batch& batch) const {
    const int brickCells = tree_.brickCells();
    LastLeaf last(tree_, tiles_);
    for (std::size_t i = 0; i < batch.count; ++i) {
        const Vec3d& place = batch.placeWorld[i];
        batch.direct[i] = false;
        batch.leaf[i] = -1;
        if (bounds_ && !contains(*bounds_, place)) continue;
        const std::int32_t leaf = last.find(place);
        if (leaf < 0) continue;
        batch.leaf[i] = leaf;
        const CellPlace at = locateInBrick(last.local(), brickCells);
        batch.fraction[i] = at.fraction;
        const int low = tiles_.leaf(std::size_t(leaf)).firstCell;
        if (at.cell.x < low || at.cell.y < low || at.cell.z < low) continue;
        if (!findCorners(std::size_t(leaf), at.cell, batch.corner[i])) continue;
        batch.direct[i] = true;
        // Corners 4 to 7 lie beside these along z, mostly in the same cache line.
        for (std::size_t c = 0; c < 4; ++c) __builtin_prefetch(batch.corner[i][c]);
    }
}

// |reconstructed - exact| of every field at a sample whose corners are known. False when one isn't finite.
bool Measurement::fieldErrors(const Batch& batch, std::size_t i, std::span<double> errors) const {
    const bool isNode = batch.sample[i] < samples_.nodeCount();
    std::array<double, 8> weights;
    for (std::size_t c = 0; c < 8; ++c) weights[c] = cornerWeight(batch.fraction[i], int(c));
    for (std::size_t f = 0; f < errors.size(); ++f) {
        const SampledField& sampled = samples_.fields()[f];
        errors[f] = -1;
        if (isNode && sampled.isCell()) continue;
        const int components = sampled.field->components;
        double sum = 0;
        for (int k = 0; k < components; ++k) {
            const std::size_t channel = std::size_t(sampled.firstChannel + k);
            double value = 0;
            for (std::size_t c = 0; c < 8; ++c)
                value += weights[c] * double(batch.corner[i][c][channel * kTilePoints]);
            const double difference = value - batch.exact[channel * kBatch + i];
            sum += components == 1 ? std::abs(difference) : difference * difference;
        }
        errors[f] = components == 1 ? sum : std::sqrt(sum);
        if (!std::isfinite(errors[f])) return false;
    }
    return true;
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

void Measurement::measureBatch(Batch& batch, Part& part) {
    std::array<double, 8> few;
    std::vector<double> many;
    if (lists_.size() > few.size()) many.resize(lists_.size());
    const std::span<double> errors = many.empty() ? std::span(few).first(lists_.size()) : std::span(many);
    locate(batch);
    for (std::size_t i = 0; i < batch.count; ++i) {
        if (batch.leaf[i] < 0) {
            ++part.outside;
            continue;
        }
        ++part.inside;
        // A value that isn't finite may have come from a corner of weight zero: the long way leaves those
        // out.
        if (batch.direct[i] && fieldErrors(batch, i, errors)) {
            ++part.fullyCovered;
            keep(batch.sample[i], batch.leaf[i], errors, part);
        } else {
            part.deferred.push_back({batch.sample[i], batch.leaf[i], batch.volume[i]});
        }
    }
}

std::vector<Part> Measurement::measureNodes(const NodeSet& used) {
    std::vector<Part> parts(std::size_t((mesh_.nodeCount() + kErrorChunk - 1) / kErrorChunk));
    parallelForChunks(execution_, mesh_.nodeCount(), kErrorChunk, [&](std::int64_t begin, std::int64_t end) {
        Part& part = parts[std::size_t(begin / kErrorChunk)] = newPart();
        Batch batch(samples_.channels());
        for (std::int64_t n = begin; n < end; ++n) {
            const std::size_t node = std::size_t(n);
            if (used.contains(node)) {
                batch.sample[batch.count] = std::uint32_t(node);
                batch.placeWorld[batch.count] = samples_.placeWorld(node, tree_.originWorld());
                batch.volume[batch.count] = 0;
                for (const SampledField& field : samples_.fields())
                    for (int c = 0; !field.isCell() && c < field.field->components; ++c)
                        batch.exact[std::size_t(field.firstChannel + c) * kBatch + batch.count] =
                            field.field->at(n, c);
                ++batch.count;
            }
            if (batch.count < kBatch && n + 1 < end) continue;
            measureBatch(batch, part);
            batch.count = 0;
        }
        advance(2 * (end - begin) - std::int64_t(part.deferred.size()));
    });
    measureDeferred(parts);
    return parts;
}

// Fills the batch with the elements that have a volume, and adds up the exact field's integral.
void Measurement::gatherElements(std::int64_t begin, std::int64_t end, Batch& batch, Part& part) {
    const Vec3d origin = tree_.originWorld();
    const std::int64_t last = mesh_.elementCount() - 1;
    const double* values = samples_.fields().empty() || samples_.fields()[0].isCell()
                               ? nullptr
                               : samples_.fields()[0].field->values.data();
    const int stride = values ? samples_.fields()[0].field->components : 0;
    batch.count = 0;
    for (std::int64_t e = begin; e < end; ++e) {
        for (const std::int32_t node : mesh_.tets[std::size_t(std::min(e + kPrefetch, last))]) {
            __builtin_prefetch(&mesh_.points[std::size_t(node)]);
            if (values) __builtin_prefetch(values + std::int64_t(node) * stride);
        }
        const auto& tet = mesh_.tets[std::size_t(e)];
        const Vec3d &a = mesh_.points[std::size_t(tet[0])], &b = mesh_.points[std::size_t(tet[1])],
                    &c = mesh_.points[std::size_t(tet[2])], &d = mesh_.points[std::size_t(tet[3])];
        const SixfoldVolume sixfold = sixfoldVolume(a, b, c, d);
        const bool certain = std::abs(sixfold.value) > sixfold.errorBound;
        const int sign = certain ? (sixfold.value > 0 ? 1 : -1) : exactVolumeSign(a, b, c, d);
        part.flat += sign == 0;
        part.inverted += sign < 0;
        if (sign == 0) continue;
        const std::size_t sample = samples_.nodeCount() + std::size_t(e), i = batch.count++;
        batch.sample[i] = std::uint32_t(sample);
        batch.volume[i] = elementVolume(sixfold.value);
        batch.placeWorld[i] = samples_.centroidWorld(a, b, c, d, origin);
        for (std::size_t f = 0; f < lists_.size(); ++f) {
            const SampledField& field = samples_.fields()[f];
            for (int k = 0; k < field.field->components; ++k) {
                const double mean = samples_.exactValue(sample, *field.field, k);
                batch.exact[std::size_t(field.firstChannel + k) * kBatch + i] = mean;
                if (std::isfinite(mean)) part.sums[f].integralMesh[std::size_t(k)] += batch.volume[i] * mean;
            }
        }
    }
}

// What a batch of elements adds: their centroids and nodes, one after the other. The sum stays in registers.
void Measurement::addBatch(std::size_t f, const Batch& batch, FieldSums& sums) const {
    const float* errors = lists_[f].data();
    const bool isCell = samples_.fields()[f].isCell();
    const double ofCentroid = centroidWeight(samples_.fields()[f]);
    WeightedSquares sum = sums.squares;
    for (std::size_t i = 0; i < batch.count; ++i) {
        sum.add(errors[batch.sample[i]], ofCentroid * batch.volume[i]);
        if (isCell) continue;
        for (const std::int32_t node : mesh_.tets[batch.sample[i] - samples_.nodeCount()])
            sum.add(errors[node], kNodeWeight * batch.volume[i]);
    }
    sums.squares = sum;
}

// The nodes' errors are known by now.
std::vector<Part> Measurement::measureElements() {
    std::vector<Part> parts(std::size_t((mesh_.elementCount() + kErrorChunk - 1) / kErrorChunk));
    parallelForChunks(execution_, mesh_.elementCount(), kErrorChunk,
                      [&](std::int64_t begin, std::int64_t end) {
                          Part& part = parts[std::size_t(begin / kErrorChunk)] = newPart();
                          Batch batch(samples_.channels());
                          for (std::int64_t first = begin; first < end; first += std::int64_t(kBatch)) {
                              gatherElements(first, std::min(end, first + std::int64_t(kBatch)), batch, part);
                              measureBatch(batch, part);
                              for (std::size_t f = 0; f < lists_.size(); ++f)
                                  addBatch(f, batch, part.sums[f]);
                          }
                          advance(2 * (end - begin) - std::int64_t(part.deferred.size()));
                      });
    measureDeferred(parts);
    return parts;
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
    // A leaf's largest error can't be taken back, so it needs to know the samples exactly from the start.
    const NodeSet used = leafErrors_ ? nodesOfVolumes(mesh_, execution_) : usedNodes(mesh_, execution_);
    std::vector<Part> nodes = measureNodes(used);
    const std::vector<Part> elements = measureElements();
    SampleErrors result;
    result.sums = newPart().sums;
    addSums(elements, result);
    if (result.flatElements > 0) {
        // Nodes of flat elements alone are no samples after all.
        const NodeSet exact = nodesOfVolumes(mesh_, execution_);
        if (exact != used) {
            for (auto& list : lists_) std::fill(list.begin(), list.begin() + mesh_.nodeCount(), -1.0f);
            nodes = measureNodes(exact);
        }
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
