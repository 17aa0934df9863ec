#include "refine/sample_errors.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "base/large_pages.h"
#include "base/parallel.h"
#include "brick/leaf_tiles.h"
#include "mesh/geometry.h"
#include "refine/measure_kernel.h"
#include "refine/node_set.h"

namespace tessera {

namespace {

constexpr std::int64_t kErrorChunk = 16384;
constexpr std::int64_t kRunChunk = 16;
constexpr std::int64_t kPrefetch = 16;  // elements ahead: nodes are reached in no order
constexpr std::size_t kBatch = kMeasureLanes;
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

// Some samples on their way, and what belongs to them here. The corners' addresses are found for all of them
// before the first value is read, so that the reads from memory overlap.
struct Batch : MeasureBatch {
    Batch(int channelCount, std::size_t fields)
        : MeasureBatch{}, exact(std::size_t(channelCount)), errors(fields), nodeErrors(fields) {}

    std::uint32_t first = 0;  // sample of the first lane
    std::array<std::int32_t, kBatch> leaf;
    std::array<std::array<const float*, 8>, kBatch> corner;
    LaneFloats corners[8]{};                            // values of one channel
    std::vector<LaneDoubles> exact;                     // one a channel
    std::vector<LaneDoubles> errors;                    // one a field
    std::vector<std::array<LaneFloats, 4>> nodeErrors;  // one a field: of elements
};

// From a cell's first corner to its corners: tiles of the table, and points in the tile.
struct CornerSteps {
    std::array<int, 8> tile, point;
};

// @param edge of the table of tiles.
std::array<CornerSteps, 8> makeCornerSteps(int edge) {
    const std::array<int, 3> tileStep{edge * edge, edge, 1}, pointStep{64, 8, 1};
    std::array<CornerSteps, 8> all{};
    for (std::size_t beyond = 0; beyond < 8; ++beyond)
        for (std::size_t c = 0; c < 8; ++c)
            for (std::size_t a = 0; a < 3; ++a) {
                if (!(c >> a & 1)) continue;
                const bool isBeyond = beyond >> a & 1;
                all[beyond].tile[c] += isBeyond ? tileStep[a] : 0;
                all[beyond].point[c] += isBeyond ? -7 * pointStep[a] : pointStep[a];
            }
    return all;
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
    void gatherNodes(std::int64_t begin, std::int64_t end, const NodeSet& used, Batch& batch) const;
    void gatherElements(std::int64_t begin, std::int64_t end, Batch& batch, Part& part) const;
    void findCells(Batch& batch) const;
    bool findCorners(const TileView* tiles, int offset, int beyond,
                     std::array<const float*, 8>& corner) const;
    void measureBatch(Batch& batch, Part& part);
    void keepBatch(const Batch& batch, Part& part);
    void keep(std::uint32_t sample, std::int32_t leaf, std::span<const double> errors, Part& part);
    void addElements(const Batch& batch, Part& part) const;
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
    std::optional<Box3d> bounds_;  // from the tree's origin
    LeafTiles tiles_;
    std::array<CornerSteps, 8> cornerSteps_;  // by MeasureBatch::beyond
    std::vector<float> zeros_;  // what is read where there are no corners: a tile of every channel
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
      cornerSteps_(makeCornerSteps(tiles_.edge())),
      zeros_(std::size_t(samples.channels()) * kTilePoints),
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
    part.squares.resize(lists_.size());
    part.integrals.resize(std::size_t(samples_.channels()));
    return part;
}

// Sets the corners' addresses when all eight are stored and covered.
bool Measurement::findCorners(const TileView* tiles, int offset, int beyond,
                              std::array<const float*, 8>& corner) const {
    const CornerSteps& steps = cornerSteps_[std::size_t(beyond)];
    bool isFull = true;
    for (std::size_t c = 0; c < 8; ++c) {
        const TileView& view = tiles[steps.tile[c]];
        if (!view.values) return false;
        isFull &= view.coverage == nullptr;
        corner[c] = view.values + (offset + steps.point[c]);
    }
    if (isFull) return true;
    for (std::size_t c = 0; c < 8; ++c)
        if (!tiles[steps.tile[c]].covered(offset + steps.point[c])) return false;
    return true;
}

// Leaves, cells and corners of the batch's places. Lanes whose cell isn't made of stored samples aren't kept.
void Measurement::findCells(Batch& batch) const {
    const double inverseSpacing0 = 1.0 / tree_.spacingWorld(0);
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i) {
        if (batch.leaf[i] == kNoSample) continue;
        const Vec3d place(batch.place[0][i], batch.place[1][i], batch.place[2][i]);
        batch.leaf[i] = bounds_ && !contains(*bounds_, place) ? kOutsideLeaves
                                                              : leafOfPlace(tree_, place * inverseSpacing0);
        if (batch.leaf[i] < 0) continue;
        const LeafTiles::Leaf& leaf = tiles_.leaf(std::size_t(batch.leaf[i]));
        for (int a = 0; a < 3; ++a) batch.local[a][i] = place[a] * leaf.inverseSpacing - leaf.firstPoint[a];
    }
    measure::locateCells(batch, tree_.brickCells(), tiles_.edge());
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i) {
        std::array<const float*, 8>& corner = batch.corner[i];
        const std::size_t leaf = std::size_t(std::max(batch.leaf[i], 0));
        const bool isKept =
            batch.leaf[i] >= 0 && batch.leastCell[i] >= tiles_.leaf(leaf).firstCell &&
            findCorners(tiles_.tiles(leaf) + batch.tile[i], batch.offset[i], batch.beyond[i], corner);
        batch.isKept[i] = isKept;
        if (!isKept) corner.fill(zeros_.data());
        // Corners 4 to 7 lie beside these along z, mostly in the same cache line.
        for (std::size_t c = 0; c < 4; ++c) __builtin_prefetch(corner[c]);
    }
}

// Errors of the batch's samples: kept, or put off where they aren't made of stored samples alone.
void Measurement::measureBatch(Batch& batch, Part& part) {
    for (std::size_t i = std::size_t(batch.count); i < kBatch; ++i) batch.isKept[i] = batch.volume[i] = 0;
    findCells(batch);
    const bool isNode = batch.first < samples_.nodeCount();
    for (std::size_t f = 0; f < lists_.size(); ++f) {
        const SampledField& sampled = samples_.fields()[f];
        if (isNode && sampled.isCell()) continue;
        const bool isSquared = sampled.field->components > 1;
        LaneDoubles& errors = batch.errors[f];
        std::fill(std::begin(errors.lane), std::end(errors.lane), 0.0);
        for (int k = 0; k < sampled.field->components; ++k) {
            const std::size_t channel = std::size_t(sampled.firstChannel + k);
            for (std::size_t i = 0; i < std::size_t(batch.count); ++i)
                for (std::size_t c = 0; c < 8; ++c)
                    batch.corners[c][i] = batch.corner[i][c][channel * kTilePoints];
            measure::addDifference(batch, batch.corners, batch.exact[channel], isSquared, errors);
        }
        // A value that isn't finite may have come from a corner of weight zero: the long way leaves those
        // out.
        measure::finishErrors(batch, isSquared, errors);
    }
    keepBatch(batch, part);
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i) {
        part.outside += batch.leaf[i] == kOutsideLeaves;
        if (batch.leaf[i] < 0) continue;
        ++part.inside;
        if (batch.isKept[i] > 0)
            ++part.fullyCovered;
        else
            part.deferred.push_back({batch.first + std::uint32_t(i), batch.leaf[i], batch.volume[i]});
    }
}

void Measurement::keepBatch(const Batch& batch, Part& part) {
    const bool isNode = batch.first < samples_.nodeCount();
    LaneFloats listed;
    for (std::size_t f = 0; f < lists_.size(); ++f) {
        const SampledField& field = samples_.fields()[f];
        if (isNode && field.isCell()) continue;
        const double worst = measure::listErrors(batch, batch.errors[f], errorUnit(field), listed);
        std::copy_n(listed.lane, batch.count, lists_[f].data() + batch.first);
        if (worst > part.sums[f].worst.error) {
            std::uint32_t i = 0;
            while (!(batch.isKept[i] > 0 && batch.errors[f][i] == worst)) ++i;
            part.sums[f].worst.take(worst, batch.first + i);
        }
        if (!isNode) measure::addSquares(batch, listed, centroidWeight(field), part.squares[f]);
        if (!leafErrors_ || !(field.range > 0)) continue;
        for (std::size_t i = 0; i < std::size_t(batch.count); ++i)
            if (batch.isKept[i] > 0)
                raise((*leafErrors_)[std::size_t(batch.leaf[i])], batch.errors[f][i] / field.range);
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

void Measurement::gatherNodes(std::int64_t begin, std::int64_t end, const NodeSet& used, Batch& batch) const {
    batch.first = std::uint32_t(begin);
    batch.count = int(end - begin);
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i) {
        const std::size_t node = std::size_t(begin) + i;
        batch.leaf[i] = used.contains(node) ? kOutsideLeaves : kNoSample;
        batch.volume[i] = 0;
        const Vec3d place = samples_.placeWorld(node, tree_.originWorld());
        for (int a = 0; a < 3; ++a) batch.place[a][i] = place[a];
        for (const SampledField& field : samples_.fields())
            for (int c = 0; !field.isCell() && c < field.field->components; ++c)
                batch.exact[std::size_t(field.firstChannel + c)][i] = field.field->at(std::int64_t(node), c);
    }
}

std::vector<Part> Measurement::measureNodes(const NodeSet& used) {
    std::vector<Part> parts(std::size_t((mesh_.nodeCount() + kErrorChunk - 1) / kErrorChunk));
    parallelForChunks(execution_, mesh_.nodeCount(), kErrorChunk, [&](std::int64_t begin, std::int64_t end) {
        Part& part = parts[std::size_t(begin / kErrorChunk)] = newPart();
        Batch batch(samples_.channels(), lists_.size());
        for (std::int64_t first = begin; first < end; first += std::int64_t(kBatch)) {
            gatherNodes(first, std::min(end, first + std::int64_t(kBatch)), used, batch);
            measureBatch(batch, part);
        }
        finish(part);
        advance(2 * (end - begin) - std::int64_t(part.deferred.size()));
    });
    measureDeferred(parts);
    return parts;
}

// Those without a volume are no samples. The nodes' errors are known by now.
void Measurement::gatherElements(std::int64_t begin, std::int64_t end, Batch& batch, Part& part) const {
    const std::int64_t last = mesh_.elementCount() - 1;
    const std::span<const SampledField> fields = samples_.fields();
    const double* near = fields.empty() || fields[0].isCell() ? nullptr : fields[0].field->values.data();
    const int stride = near ? fields[0].field->components : 0;
    batch.first = std::uint32_t(samples_.nodeCount() + std::size_t(begin));
    batch.count = int(end - begin);
    const std::size_t count = std::size_t(batch.count);
    const std::array<std::int32_t, 4>* const tets = mesh_.tets.data() + begin;
    const Vec3d* const points = mesh_.points.data();
    for (std::size_t i = 0; i < count; ++i) {
        for (const std::int32_t node : tets[std::min(std::int64_t(i) + kPrefetch, last - begin)]) {
            __builtin_prefetch(points + node);
            if (near) __builtin_prefetch(near + std::int64_t(node) * stride);
        }
        batch.leaf[i] = kOutsideLeaves;
        for (std::size_t k = 0; k < 4; ++k) {
            const Vec3d& place = points[tets[i][k]];
            for (int a = 0; a < 3; ++a) batch.nodeWorld[k][a][i] = place[a];
        }
    }
    for (std::size_t f = 0; f < fields.size(); ++f) {
        const Field& field = *fields[f].field;
        for (int k = 0; k < field.components; ++k) {
            LaneDoubles& exact = batch.exact[std::size_t(fields[f].firstChannel + k)];
            for (std::size_t i = 0; i < count; ++i)
                exact[i] = samples_.exactValue(samples_.nodeCount() + std::size_t(begin) + i, field, k);
        }
        const float* const errors = lists_[f].data();
        for (std::size_t k = 0; k < 4 && !fields[f].isCell(); ++k)
            for (std::size_t i = 0; i < count; ++i) batch.nodeErrors[f][k][i] = errors[tets[i][k]];
    }
    measure::placeElements(batch, samples_.reference(), tree_.originWorld());
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i) {
        int sign = batch.sixfold[i] > 0 ? 1 : -1;
        if (batch.isCertain[i] == 0) {
            const auto& tet = mesh_.tets[std::size_t(begin) + i];
            sign = exactVolumeSign(mesh_.points[std::size_t(tet[0])], mesh_.points[std::size_t(tet[1])],
                                   mesh_.points[std::size_t(tet[2])], mesh_.points[std::size_t(tet[3])]);
        }
        part.inverted += sign < 0;
        if (sign != 0) continue;
        ++part.flat;
        batch.leaf[i] = kNoSample;
        batch.volume[i] = 0;
    }
}

// What elements add beside the centroids' errors: their nodes' and the exact field's integral.
void Measurement::addElements(const Batch& batch, Part& part) const {
    for (std::size_t f = 0; f < lists_.size(); ++f) {
        const SampledField& field = samples_.fields()[f];
        for (std::size_t k = 0; k < 4 && !field.isCell(); ++k)
            measure::addSquares(batch, batch.nodeErrors[f][k], kNodeWeight, part.squares[f]);
    }
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

std::vector<Part> Measurement::measureElements() {
    std::vector<Part> parts(std::size_t((mesh_.elementCount() + kErrorChunk - 1) / kErrorChunk));
    parallelForChunks(execution_, mesh_.elementCount(), kErrorChunk,
                      [&](std::int64_t begin, std::int64_t end) {
                          Part& part = parts[std::size_t(begin / kErrorChunk)] = newPart();
                          Batch batch(samples_.channels(), lists_.size());
                          for (std::int64_t first = begin; first < end; first += std::int64_t(kBatch)) {
                              gatherElements(first, std::min(end, first + std::int64_t(kBatch)), batch, part);
                              measureBatch(batch, part);
                              addElements(batch, part);
                          }
                          finish(part);
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
