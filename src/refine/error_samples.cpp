#include "refine/error_samples.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/check.h"
#include "base/parallel.h"
#include "brick/leaf_tiles.h"
#include "mesh/field_range.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

constexpr std::int64_t kSampleChunk = 16384;

SampledField describe(const Field& field, int firstChannel) {
    SampledField result{&field, firstChannel, 0, 0};
    for (int c = 0; c < field.components; ++c) {
        const ValueRange range = fieldRange(field, c);
        if (range.empty()) continue;
        result.range = std::max(result.range, range.width());
        result.largest = std::max({result.largest, std::abs(range.min), std::abs(range.max)});
    }
    return result;
}

}  // namespace

SampledMesh::SampledMesh(const TetMesh& mesh, std::span<const int> fields, const Execution& execution)
    : mesh_(&mesh) {
    TESSERA_CHECK(mesh.points.size() + mesh.tets.size() < (std::size_t(1) << 32),
                  "samples are counted in 32 bits");
    fields_.resize(fields.size());
    for (std::size_t f = 0; f < fields.size(); ++f) {
        fields_[f].firstChannel = channels_;
        channels_ += mesh.fields[std::size_t(fields[f])].components;
    }
    parallelFor(execution, std::int64_t(fields.size()), [&](std::int64_t f) {
        fields_[std::size_t(f)] =
            describe(mesh.fields[std::size_t(fields[std::size_t(f)])], fields_[std::size_t(f)].firstChannel);
    });
    if (!mesh.points.empty()) reference_ = mesh.points[0];
}

ErrorSamples::ErrorSamples(const TetMesh& mesh, std::span<const int> fields, const Execution& execution)
    : SampledMesh(mesh, fields, execution), volume_(mesh.tets.size()), nodes_(mesh.points.size()) {
    parallelForChunks(
        execution, mesh.elementCount(), kSampleChunk, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t e = begin; e < end; ++e) {
                const auto& tet = mesh.tets[std::size_t(e)];
                const Vec3d &a = mesh.points[std::size_t(tet[0])], &b = mesh.points[std::size_t(tet[1])],
                            &c = mesh.points[std::size_t(tet[2])], &d = mesh.points[std::size_t(tet[3])];
                const SixfoldVolume sixfold = sixfoldVolume(a, b, c, d);
                if (!(std::abs(sixfold.value) > sixfold.errorBound) && exactVolumeSign(a, b, c, d) == 0)
                    continue;
                volume_[std::size_t(e)] = elementVolume(sixfold.value);
                nodes_.insert(tet);
            }
        });
}

std::int32_t leafOfPlace(const BrickTree& tree, const Vec3d& index0) {
    std::int64_t leaf = tree.findLeafAt(index0);
    if (leaf < 0) {
        // A place on the mesh's lower side can round to just below the first brick.
        const Vec3d whole = glm::round(index0);
        Vec3d snapped = index0;
        for (int a = 0; a < 3; ++a)
            if (std::abs(index0[a] - whole[a]) < 1e-6) snapped[a] = whole[a];
        leaf = tree.findLeafAt(snapped);
    }
    return leaf < 0 ? kOutsideLeaves : std::int32_t(leaf);
}

SamplesByLeaf sortSamples(const ErrorSamples& samples, const BrickTree& tree,
                          const std::optional<Box3d>& boundsWorld, const Execution& execution) {
    std::vector<std::int32_t> leafOf(samples.count(), kNoSample);
    const double inverse = 1.0 / tree.spacingWorld(0);
    const Vec3d origin = tree.originWorld();
    std::optional<Box3d> bounds;
    if (boundsWorld) bounds = Box3d{boundsWorld->min - origin, boundsWorld->max - origin};
    parallelForChunks(
        execution, std::int64_t(samples.count()), kSampleChunk, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t s = begin; s < end; ++s) {
                if (!samples.exists(std::size_t(s))) continue;
                const Vec3d place = samples.placeWorld(std::size_t(s), origin);
                leafOf[std::size_t(s)] =
                    bounds && !contains(*bounds, place) ? kOutsideLeaves : leafOfPlace(tree, place * inverse);
            }
        });
    SamplesByLeaf sorted;
    sorted.first.assign(tree.leafCount() + 1, 0);
    for (const std::int32_t leaf : leafOf) {
        if (leaf >= 0) ++sorted.first[std::size_t(leaf) + 1];
    }
    for (std::size_t i = 1; i < sorted.first.size(); ++i) sorted.first[i] += sorted.first[i - 1];
    sorted.ids.resize(sorted.first.back());
    std::vector<std::size_t> next(sorted.first.begin(), sorted.first.end() - 1);
    for (std::size_t s = 0; s < leafOf.size(); ++s)
        if (leafOf[s] >= 0) sorted.ids[next[std::size_t(leafOf[s])]++] = std::uint32_t(s);
    return sorted;
}

LeafSampler::LeafSampler(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                         const Reconstruction& reconstruction)
    : samples_(&samples),
      tree_(&tree),
      store_(&store),
      reconstruction_(&reconstruction),
      values_(std::size_t(store.channels())),
      slotOf_(std::size_t(tree.brickCells() + 1) * std::size_t(tree.brickCells() + 1) *
                  std::size_t(tree.brickCells() + 1),
              -1) {}

void LeafSampler::enter(std::size_t leaf) {
    leaf_ = leaf;
    const BrickKey& key = tree_->leaves()[leaf];
    firstPoint_ = key.index * tree_->brickCells();
    inverseSpacing_ = 1.0 / tree_->spacingWorld(key.level);
    for (const std::int32_t slot : touched_) slotOf_[std::size_t(slot)] = -1;
    touched_.clear();
    slotValues_.clear();
    slotSource_.clear();
    coarserNear_ = hasCoarserNeighbour(*tree_, leaf);
}

bool LeafSampler::readCorners(const Vec3i& cell, Corners& corners) const {
    const int n = store_->tilesPerEdge();
    for (int c = 0; c < 8; ++c) {
        const Vec3i p = cell + cornerOffset(c);
        const Tile* tile = store_->tile(leaf_, ((p.x >> 3) * n + (p.y >> 3)) * n + (p.z >> 3));
        const int offset = ((p.x & 7) * 8 + (p.y & 7)) * 8 + (p.z & 7);
        if (!tile || !tile->covered(offset)) return false;
        corners.tile[c] = tile;
        corners.offset[c] = offset;
    }
    return true;
}

PointSource LeafSampler::reconstructSlowly(const CellPlace& place) {
    const std::size_t channels = values_.size();
    const int edge = tree_->brickCells() + 1;
    PointSource source = PointSource::covered;
    std::fill(values_.begin(), values_.end(), 0.0);
    for (int c = 0; c < 8; ++c) {
        const double weight = cornerWeight(place.fraction, c);
        if (weight == 0) continue;
        const Vec3i p = place.cell + cornerOffset(c);
        std::int32_t& slot = slotOf_[std::size_t((p.z * edge + p.y) * edge + p.x)];
        if (slot < 0) {
            slot = std::int32_t(slotSource_.size());
            touched_.push_back((p.z * edge + p.y) * edge + p.x);
            slotValues_.resize(slotValues_.size() + channels);
            slotSource_.push_back(reconstruction_->resolve(tree_->leaves()[leaf_].level, firstPoint_ + p, 0,
                                                           std::span(slotValues_).last(channels)));
        }
        source = std::min(source, slotSource_[std::size_t(slot)]);
        const double* corner = slotValues_.data() + std::size_t(slot) * channels;
        for (std::size_t v = 0; v < channels; ++v) values_[v] += weight * corner[v];
    }
    return source;
}

bool LeafSampler::fieldErrors(std::size_t sample, std::span<double> errors) const {
    const bool isNode = sample < samples_->nodeCount();
    bool allFinite = true;
    for (std::size_t f = 0; f < errors.size(); ++f) {
        const SampledField& sampled = samples_->fields()[f];
        if (isNode && sampled.isCell()) {
            errors[f] = -1;
            continue;
        }
        const int components = sampled.field->components;
        double sum = 0;
        for (int c = 0; c < components; ++c) {
            const double difference = values_[std::size_t(sampled.firstChannel + c)] -
                                      samples_->exactValue(sample, *sampled.field, c);
            sum += components == 1 ? std::abs(difference) : difference * difference;
        }
        errors[f] = components == 1 ? sum : std::sqrt(sum);
        if (!std::isfinite(errors[f])) {
            errors[f] = std::numeric_limits<double>::quiet_NaN();
            allFinite = false;
        }
    }
    return allFinite;
}

PointSource LeafSampler::measure(std::size_t sample, std::span<double> errors) {
    const int b = tree_->brickCells();
    const Vec3d index = samples_->placeWorld(sample, tree_->originWorld()) * inverseSpacing_;
    const CellPlace place = locateInBrick(index - Vec3d(firstPoint_), b);
    const Vec3i& cell = place.cell;
    const int low = coarserNear_ ? 1 : 0;
    Corners corners;
    if (cell.x >= low && cell.y >= low && cell.z >= low && cell.x + 1 < b && cell.y + 1 < b &&
        cell.z + 1 < b && readCorners(cell, corners)) {
        double weights[8];
        for (int c = 0; c < 8; ++c) weights[c] = cornerWeight(place.fraction, c);
        for (std::size_t v = 0; v < values_.size(); ++v) {
            double sum = 0;
            for (int c = 0; c < 8; ++c)
                sum += weights[c] * double(corners.tile[c]->channel(int(v))[corners.offset[c]]);
            values_[v] = sum;
        }
        // A value that isn't finite may have come from a corner of weight zero: the slow way leaves those
        // out.
        if (fieldErrors(sample, errors)) return PointSource::covered;
    }
    const PointSource source = reconstructSlowly(place);
    fieldErrors(sample, errors);
    return source;
}

}  // namespace tessera
