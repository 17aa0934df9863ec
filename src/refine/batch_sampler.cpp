#include "refine/batch_sampler.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/check.h"
#include "base/parallel.h"
#include "mesh/geometry.h"

namespace tessera {

namespace {

constexpr std::int64_t kNodeChunk = 16384;
constexpr std::int64_t kPrefetch = 24;  // elements ahead: nodes are reached in no order
constexpr std::int64_t kNotPlain = 1;
// From a cell's first corner to those that begin its rows along z, in points of a tile.
constexpr std::array<int, 4> kRows{0, kTileSize* kTileSize, kTileSize, (kTileSize + 1) * kTileSize};

std::int64_t addressOf(const float* values) {
    return reinterpret_cast<std::int64_t>(values);
}
const float* valuesAt(std::int64_t address) {
    return reinterpret_cast<const float*>(address);
}

}  // namespace

// @param edge of the table of tiles.
std::array<BatchSampler::CornerSteps, 8> BatchSampler::makeCornerSteps(int edge) {
    constexpr std::int64_t kPoint = sizeof(float);
    const std::array<std::int64_t, 3> tileStep{std::int64_t(edge) * edge, edge, 1},
        pointStep{64 * kPoint, 8 * kPoint, kPoint};
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

BatchSampler::BatchSampler(const SampledMesh& samples, const BrickTree& tree, const BrickStore& store,
                           const Execution& execution)
    : samples_(samples),
      mesh_(samples.mesh()),
      tree_(tree),
      tiles_(tree, store, execution),
      stride_(std::size_t(tiles_.edge()) * std::size_t(tiles_.edge()) * std::size_t(tiles_.edge())),
      walk_(tree.walk()),
      cornerSteps_(makeCornerSteps(tiles_.edge())),
      zeros_(std::size_t(samples.channels()) * kTilePoints) {
    for (const SampledField& field : samples.fields()) {
        if (field.isCell()) continue;
        nearField_ = field.field;
        nearChannel_ = field.firstChannel;
        break;
    }
    findPlainTiles();
    resizeLarge(nodes_, mesh_.points.size());
    parallelForChunks(execution, mesh_.nodeCount(), kNodeChunk, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t n = begin; n < end; ++n) {
            const Vec3d& place = mesh_.points[std::size_t(n)];
            nodes_[std::size_t(n)] = {{place.x, place.y, place.z, nearField_ ? nearField_->at(n, 0) : 0}};
        }
    });
}

// Where the values go that come with the places.
LaneDoubles& BatchSampler::nearChannel(SampleBatch& batch) const {
    return nearField_ ? batch.exact[std::size_t(nearChannel_)] : batch.sixfold;
}

// Exact values of the channels that don't come with the places.
void BatchSampler::gatherChannels(std::int64_t first, SampleBatch& batch) const {
    const bool isNode = std::size_t(first) < samples_.nodeCount();
    for (const SampledField& field : samples_.fields())
        for (int c = 0; !(isNode && field.isCell()) && c < field.field->components; ++c) {
            const int channel = field.firstChannel + c;
            if (channel == nearChannel_) continue;
            for (std::size_t i = 0; i < std::size_t(batch.count); ++i)
                batch.exact[std::size_t(channel)][i] =
                    samples_.exactValue(std::size_t(first) + i, *field.field, c);
        }
}

void BatchSampler::gatherNodes(std::int64_t first, int count, SampleBatch& batch) const {
    batch.first = std::uint32_t(first);
    batch.count = count;
    batch.samples = batch.lanes();
    std::copy_n(nodes_.data() + first, count, batch.node[0]);
    measure::placeNodes(batch, tree_.originWorld(), nearChannel(batch));
    gatherChannels(first, batch);
    std::fill(std::begin(batch.volume.lane), std::end(batch.volume.lane), 0.0);
}

BatchSampler::ElementCounts BatchSampler::gatherElements(std::int64_t first, int count,
                                                         SampleBatch& batch) const {
    const std::array<std::int32_t, 4>* const tets = mesh_.tets.data() + first;
    const std::int64_t last = mesh_.elementCount() - 1 - first;
    batch.first = std::uint32_t(samples_.nodeCount() + std::size_t(first));
    batch.count = count;
    batch.samples = batch.lanes();
    std::copy_n(tets, count, batch.tet);
    std::fill(batch.tet + count, std::end(batch.tet), batch.tet[0]);
    for (std::int64_t i = 0; i < count; ++i)
        for (const std::int32_t node : tets[std::min(i + kPrefetch, last)])
            __builtin_prefetch(nodes_.data() + node);
    measure::gatherNodes(batch, nodes_.data());
    const ElementSigns signs =
        measure::placeElements(batch, samples_.reference(), tree_.originWorld(), nearChannel(batch));
    gatherChannels(batch.first, batch);
    ElementCounts counts{0, std::popcount(signs.negative)};
    for (LaneBits left = signs.uncertain; left; left &= left - 1) {
        const int i = std::countr_zero(left);
        const auto& tet = batch.tet[i];
        const int sign =
            exactVolumeSign(mesh_.points[std::size_t(tet[0])], mesh_.points[std::size_t(tet[1])],
                            mesh_.points[std::size_t(tet[2])], mesh_.points[std::size_t(tet[3])]);
        counts.inverted += sign < 0;
        if (sign != 0) continue;
        ++counts.flat;
        batch.samples &= ~(LaneBits(1) << i);
        batch.volume[std::size_t(i)] = 0;
    }
    std::fill(batch.volume.lane + count, std::end(batch.volume.lane), 0.0);
    return counts;
}

void BatchSampler::findLeaves(const Box3d& bounds, SampleBatch& batch) const {
    const double inverseSpacing0 = 1.0 / tree_.spacingWorld(0);
    batch.inLeaves = walk_.roots ? measure::findLeaves(batch, walk_, inverseSpacing0, bounds) : 0;
    batch.inLeaves &= batch.samples;
    for (LaneBits left = batch.samples & ~batch.inLeaves; left; left &= left - 1) {
        const std::size_t i = std::size_t(std::countr_zero(left));
        const Vec3d place(batch.place[0][i], batch.place[1][i], batch.place[2][i]);
        if (!contains(bounds, place)) continue;
        batch.leaf[i] = leafOfPlace(tree_, place * inverseSpacing0);
        if (batch.leaf[i] >= 0) batch.inLeaves |= LaneBits(1) << i;
    }
    for (LaneBits left = batch.inLeaves; left; left &= left - 1) {
        const std::size_t i = std::size_t(std::countr_zero(left));
        const LeafTiles::Leaf& leaf = tiles_.leaf(std::size_t(batch.leaf[i]));
        batch.frame[i] = {{leaf.firstPoint.x, leaf.firstPoint.y, leaf.firstPoint.z, leaf.inverseSpacing}};
    }
}

void BatchSampler::findPlainTiles() {
    const int edge = tiles_.edge();
    TESSERA_CHECK(tree_.leafCount() * stride_ < std::size_t(1) << 31, "tiles are counted in 32 bits");
    plainTiles_.resize(tree_.leafCount() * stride_, kNotPlain);
    for (std::size_t leaf = 0; leaf < tree_.leafCount(); ++leaf)
        for (int t = 0; t < int(stride_); ++t) {
            const TileView& view = tiles_.tiles(leaf)[t];
            // Tiles of cells before the first one that reads stored samples only.
            const bool isFirst = t / (edge * edge) == 0 || t / edge % edge == 0 || t % edge == 0;
            if (view.values && !view.coverage && !(isFirst && tiles_.leaf(leaf).firstCell > 0))
                plainTiles_[leaf * stride_ + std::size_t(t)] = addressOf(view.values);
        }
}

// Whether all corners of a lane's cell are stored and covered; then sets their addresses.
bool BatchSampler::findScattered(std::size_t lane, SampleBatch& batch) const {
    const CornerSteps& steps = cornerSteps_[std::size_t(batch.beyond[lane])];
    const std::size_t leaf = std::size_t(batch.leaf[lane]);
    const std::size_t tile = leaf * stride_ + std::size_t(batch.tile[lane]);
    const std::int64_t offset = batch.offset[lane];
    std::array<std::int64_t, 8>& corner = batch.corners[lane];
    const std::int64_t* const plain = plainTiles_.data() + tile;
    std::int64_t tags = 0;
    for (std::size_t c = 0; c < 8; ++c) {
        const std::int64_t values = plain[steps.tile[c]];
        tags |= values;
        corner[c] = values + (offset * std::int64_t(sizeof(float)) + steps.point[c]);
    }
    if (!(tags & kNotPlain)) return true;
    if (batch.leastCell[lane] < tiles_.leaf(leaf).firstCell) return false;
    const TileView* const views = tiles_.tiles(leaf) + batch.tile[lane];
    for (std::size_t c = 0; c < 8; ++c) {
        const TileView& view = views[steps.tile[c]];
        const std::int64_t point = offset + steps.point[c] / std::int64_t(sizeof(float));
        if (!view.values || !view.covered(int(point))) return false;
        corner[c] = addressOf(view.values + point);
    }
    return true;
}

// The corners' addresses are found for all samples before the first value is read, so that the reads from
// memory overlap.
void BatchSampler::findCorners(SampleBatch& batch) const {
    batch.kept = measure::findCorners(batch, batch.inLeaves, plainTiles_.data(), int(stride_));
    batch.scatteredCount = 0;
    for (LaneBits left = batch.lanes() & ~batch.kept; left; left &= left - 1) {
        const std::size_t i = std::size_t(std::countr_zero(left));
        batch.corner[i] = addressOf(zeros_.data());
        if (!(batch.inLeaves >> i & 1) || !findScattered(i, batch)) continue;
        batch.kept |= LaneBits(1) << i;
        batch.scattered[batch.scatteredCount++] = std::uint8_t(i);
        for (const std::int64_t corner : batch.corners[i]) __builtin_prefetch(valuesAt(corner));
    }
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i) {
        const float* const corner = valuesAt(batch.corner[i]);
        for (const int point : kRows) __builtin_prefetch(corner + point);
    }
}

void BatchSampler::readCorners(int channel, SampleBatch& batch) const {
    const std::size_t from = std::size_t(channel) * kTilePoints;
    for (std::size_t i = 0; i < std::size_t(batch.count); ++i) {
        const float* const corner = valuesAt(batch.corner[i]) + from;
        for (std::size_t row = 0; row < 4; ++row)
            std::memcpy(&batch.values.row[row][2 * i], corner + kRows[row], 2 * sizeof(float));
    }
    for (std::size_t n = 0; n < batch.scatteredCount; ++n)
        for (std::size_t c = 0; c < 8; ++c)
            batch.values.at(c, batch.scattered[n]) = valuesAt(batch.corners[batch.scattered[n]][c])[from];
}

void BatchSampler::measure(SampleBatch& batch) const {
    measure::locateCells(batch, tree_.brickCells(), tiles_.edge());
    findCorners(batch);
    const bool isNode = batch.first < samples_.nodeCount();
    for (std::size_t f = 0; f < batch.errors.size(); ++f) {
        const SampledField& sampled = samples_.fields()[f];
        if (isNode && sampled.isCell()) continue;
        const bool isSquared = sampled.field->components > 1;
        LaneDoubles& errors = batch.errors[f];
        std::fill(std::begin(errors.lane), std::end(errors.lane), 0.0);
        for (int k = 0; k < sampled.field->components; ++k) {
            const int channel = sampled.firstChannel + k;
            readCorners(channel, batch);
            measure::addDifference(batch, batch.values, batch.exact[std::size_t(channel)], isSquared, errors);
        }
        // A value that isn't finite may have come from a corner of weight zero: the long way leaves those
        // out.
        measure::finishErrors(batch, isSquared, errors);
    }
}

}  // namespace tessera
