#include "brick/seams.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"

namespace tessera {

Reconstruction::Reconstruction(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                               const BrickStore& store, const NearestPointIndex& nearest)
    : mesh_(&mesh), tree_(&tree), store_(&store), nearest_(&nearest) {
    nameChannels(fields);
}

Reconstruction::Reconstruction(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                               const BrickStore& store, const NearestOnDemand& nearest)
    : mesh_(&mesh), tree_(&tree), store_(&store), nearestOnDemand_(&nearest) {
    nameChannels(fields);
}

void Reconstruction::nameChannels(std::span<const int> fields) {
    for (const int f : fields)
        for (int c = 0; c < mesh_->fields[std::size_t(f)].components; ++c) channelOf_.emplace_back(f, c);
    TESSERA_CHECK(std::int64_t(channelOf_.size()) == store_->channels(),
                  "the fields are the store's channels");
}

SeamValue Reconstruction::at(int level, const Vec3i& p, int channel) const {
    SeamValue result;
    result.covered = resolve(level, p, channel, std::span(&result.value, 1));
    return result;
}

bool Reconstruction::resolve(int level, const Vec3i& p, int firstChannel, std::span<double> values) const {
    const int b = tree_->brickCells();
    const Vec3i owner = floorDiv(p, b);
    const Vec3i rest = p - owner * b;
    // The bricks of this level whose closed boxes hold p: the owner, and on each axis where p lies on a
    // border the one before it.
    int coarsest = level;
    std::int64_t ownerLeaf = -1;
    const int mask = (rest.x == 0 ? 1 : 0) | (rest.y == 0 ? 2 : 0) | (rest.z == 0 ? 4 : 0);
    for (int side = 0; side < 8; ++side) {
        if (side & ~mask) continue;
        const BrickKey key{level, owner - Vec3i(side & 1, (side >> 1) & 1, side >> 2)};
        const std::int64_t leaf = tree_->findCovering(key);
        if (side == 0) ownerLeaf = leaf;
        if (leaf >= 0) coarsest = std::max(coarsest, tree_->leaves()[std::size_t(leaf)].level);
    }
    if (coarsest > level) return fromCoarse(level, p, coarsest, firstChannel, values);
    if (ownerLeaf >= 0) return stored(std::size_t(ownerLeaf), rest, level, p, firstChannel, values);
    const std::int64_t finer = tree_->findLeafAt(level, p);
    if (finer < 0) return outside(level, p, firstChannel, values);
    const BrickKey& key = tree_->leaves()[std::size_t(finer)];
    const Vec3i local = p * (1 << (level - key.level)) - key.index * b;
    return stored(std::size_t(finer), local, level, p, firstChannel, values);
}

bool Reconstruction::stored(std::size_t leaf, const Vec3i& local, int level, const Vec3i& p, int firstChannel,
                            std::span<double> values) const {
    const int n = store_->tilesPerEdge();
    const Tile* tile = store_->tile(leaf, ((local.x >> 3) * n + (local.y >> 3)) * n + (local.z >> 3));
    const int offset = ((local.x & 7) * 8 + (local.y & 7)) * 8 + (local.z & 7);
    if (!tile || !tile->covered(offset)) return outside(level, p, firstChannel, values);
    for (std::size_t c = 0; c < values.size(); ++c)
        values[c] = double(tile->channel(firstChannel + int(c))[offset]);
    return true;
}

bool Reconstruction::fromCoarse(int level, const Vec3i& p, int coarse, int firstChannel,
                                std::span<double> values) const {
    const int step = 1 << (coarse - level);
    const Vec3i cell = floorDiv(p, step);
    const Vec3d t = Vec3d(p - cell * step) / double(step);
    if (t == Vec3d(0)) return resolve(coarse, cell, firstChannel, values);
    bool covered = true;
    std::array<double, 16> few;
    std::vector<double> many;
    if (values.size() > few.size()) many.resize(values.size());
    const std::span<double> corner = many.empty() ? std::span(few).first(values.size()) : std::span(many);
    std::fill(values.begin(), values.end(), 0.0);
    for (int c = 0; c < 8; ++c) {
        const double weight = cornerWeight(t, c);
        if (weight == 0) continue;
        covered &= resolve(coarse, cell + cornerOffset(c), firstChannel, corner);
        for (std::size_t v = 0; v < values.size(); ++v) values[v] += weight * corner[v];
    }
    return covered;
}

bool Reconstruction::outside(int level, const Vec3i& p, int firstChannel, std::span<double> values) const {
    if (values.empty()) return false;  // the caller asks for coverage only
    const Vec3d place = tree_->lattice(level).worldFromIndex(Vec3d(p));
    // Most callers ask within a voxel of the mesh; a short search first is cheaper.
    const NearestPointIndex& nearest = nearest_ ? *nearest_ : nearestOnDemand_->get();
    NearestPoint found = nearest.find(place, 4 * tree_->spacingWorld(level));
    if (found.element < 0) found = nearest.find(place, std::numeric_limits<double>::infinity());
    for (std::size_t c = 0; c < values.size(); ++c) {
        const auto [field, component] = channelOf_[std::size_t(firstChannel) + c];
        values[c] = found.element < 0 ? std::numeric_limits<double>::quiet_NaN()
                                      : found.value(mesh_->fields[std::size_t(field)], component);
    }
    return false;
}

double Reconstruction::interpolate(std::size_t leaf, const Vec3d& index, int channel,
                                   int* coveredCorners) const {
    const BrickKey& key = tree_->leaves()[leaf];
    const Vec3i first = key.index * tree_->brickCells();
    const CellPlace place = locateInBrick(index - Vec3d(first), tree_->brickCells());
    double sum = 0;
    int count = 0;
    for (int c = 0; c < 8; ++c) {
        const double weight = cornerWeight(place.fraction, c);
        if (weight == 0) {
            ++count;
            continue;
        }
        double value = 0;
        if (resolve(key.level, first + place.cell + cornerOffset(c), channel, std::span(&value, 1))) ++count;
        sum += weight * value;
    }
    if (coveredCorners) *coveredCorners = count;
    return sum;
}

}  // namespace tessera
