#include "brick/seams.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/check.h"
#include "base/floor_div.h"

namespace tessera {

Reconstruction::Reconstruction(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                               const BrickStore& store, const NearestOnDemand& nearest, Outside outside)
    : mesh_(&mesh), tree_(&tree), store_(&store), nearest_(&nearest), outside_(outside) {
    for (const int f : fields)
        for (int c = 0; c < mesh.fields[std::size_t(f)].components; ++c) channelOf_.emplace_back(f, c);
    TESSERA_CHECK(std::int64_t(channelOf_.size()) == store.channels(), "the fields are the store's channels");
}

SeamValue Reconstruction::at(int level, const Vec3i& p, int channel) const {
    SeamValue result;
    result.covered = resolve(level, p, channel, std::span(&result.value, 1)) == PointSource::covered;
    return result;
}

Reconstruction::Owner Reconstruction::findOwner(int level, const Vec3i& p) const {
    const int b = tree_->brickCells();
    const Vec3i brick = floorDiv(p, b);
    const Vec3i rest = p - brick * b;
    // The bricks of this level whose closed boxes hold p: the owner, and on each axis where p lies on a
    // border the one before it.
    int coarsest = level;
    std::int64_t own = -1;
    const int mask = (rest.x == 0 ? 1 : 0) | (rest.y == 0 ? 2 : 0) | (rest.z == 0 ? 4 : 0);
    for (int side = 0; side < 8; ++side) {
        if (side & ~mask) continue;
        const BrickKey key{level, brick - Vec3i(side & 1, (side >> 1) & 1, side >> 2)};
        const std::int64_t leaf = tree_->findCovering(key);
        if (side == 0) own = leaf;
        if (leaf >= 0) coarsest = std::max(coarsest, tree_->leaves()[std::size_t(leaf)].level);
    }
    if (coarsest > level) return {-1, coarsest, p, true};
    if (own >= 0) return {own, level, p, false};
    const std::int64_t finer = tree_->findLeafAt(level, p);
    if (finer < 0) return {-1, level, p, false};
    const int finerLevel = tree_->leaves()[std::size_t(finer)].level;
    return {finer, finerLevel, p * (1 << (level - finerLevel)), false};
}

const Tile* Reconstruction::coveredTile(const Owner& owner) const {
    if (owner.leaf < 0) return nullptr;
    const int n = store_->tilesPerEdge();
    const Vec3i tile =
        (owner.point - tree_->leaves()[std::size_t(owner.leaf)].index * tree_->brickCells()) >> 3;
    const Tile* stored = store_->tile(std::size_t(owner.leaf), (tile.x * n + tile.y) * n + tile.z);
    return stored && stored->covered(offsetInTile(owner.point)) ? stored : nullptr;
}

PointSource Reconstruction::resolve(int level, const Vec3i& p, int firstChannel,
                                    std::span<double> values) const {
    const Owner owner = findOwner(level, p);
    if (owner.isInterpolated) return fromCoarse(level, p, owner.level, firstChannel, values);
    const Tile* tile = coveredTile(owner);
    if (!tile) return outside(owner.level, owner.point, firstChannel, values);
    const int offset = offsetInTile(owner.point);
    for (std::size_t c = 0; c < values.size(); ++c)
        values[c] = double(tile->channel(firstChannel + int(c))[offset]);
    return PointSource::covered;
}

namespace {

// Where a point lies in a coarser level's cell.
struct CoarseCell {
    Vec3i cell;
    Vec3d fraction;
};
CoarseCell coarseCell(const Vec3i& p, int levelsUp) {
    const int step = 1 << levelsUp;
    const Vec3i cell = floorDiv(p, step);
    return {cell, Vec3d(p - cell * step) / double(step)};
}

}  // namespace

PointSource Reconstruction::fromCoarse(int level, const Vec3i& p, int coarse, int firstChannel,
                                       std::span<double> values) const {
    const auto [cell, t] = coarseCell(p, coarse - level);
    if (t == Vec3d(0)) return resolve(coarse, cell, firstChannel, values);
    PointSource source = PointSource::covered;
    std::array<double, 16> few;
    std::vector<double> many;
    if (values.size() > few.size()) many.resize(values.size());
    const std::span<double> corner = many.empty() ? std::span(few).first(values.size()) : std::span(many);
    std::fill(values.begin(), values.end(), 0.0);
    for (int c = 0; c < 8; ++c) {
        const double weight = cornerWeight(t, c);
        if (weight == 0) continue;
        source = std::min(source, resolve(coarse, cell + cornerOffset(c), firstChannel, corner));
        for (std::size_t v = 0; v < values.size(); ++v) values[v] += weight * corner[v];
    }
    return source;
}

void Reconstruction::visitCorners(int level, const Vec3i& p, const VisitPoint& visit) const {
    const Owner owner = findOwner(level, p);
    if (!owner.isInterpolated) return visit(level, p);
    const auto [cell, t] = coarseCell(p, owner.level - level);
    for (int c = 0; c < 8; ++c)
        if (cornerWeight(t, c) > 0) visitCorners(owner.level, cell + cornerOffset(c), visit);
}

void Reconstruction::visitOutside(int level, const Vec3i& p, const VisitPoint& visit) const {
    visitCorners(level, p, [&](int cornerLevel, const Vec3i& corner) {
        const Owner owner = findOwner(cornerLevel, corner);
        if (!coveredTile(owner)) visit(owner.level, owner.point);
    });
}

void Reconstruction::nearestValues(int level, const Vec3i& p, int firstChannel,
                                   std::span<double> values) const {
    const Vec3d place = tree_->lattice(level).worldFromIndex(Vec3d(p));
    // Most callers ask within a voxel of the mesh; a short search first is cheaper.
    const NearestPointIndex& nearest = nearest_->get();
    NearestPoint found = nearest.find(place, 4 * tree_->spacingWorld(level));
    if (found.element < 0) found = nearest.find(place, std::numeric_limits<double>::infinity());
    for (std::size_t c = 0; c < values.size(); ++c) {
        const auto [field, component] = channelOf_[std::size_t(firstChannel) + c];
        constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
        values[c] = found.element < 0 ? kNone : found.value(mesh_->fields[std::size_t(field)], component);
        if (!std::isfinite(float(values[c]))) values[c] = kNone;  // as samples are
    }
}

PointSource Reconstruction::outside(int level, const Vec3i& p, int firstChannel,
                                    std::span<double> values) const {
    if (const Tile* tile = store_->extensionAt(level, p)) {
        for (std::size_t c = 0; c < values.size(); ++c)
            values[c] = double(tile->channel(firstChannel + int(c))[offsetInTile(p)]);
        return PointSource::extended;
    }
    if (outside_ == Outside::nearest) {
        if (!values.empty()) nearestValues(level, p, firstChannel, values);
        return PointSource::nearest;
    }
    std::fill(values.begin(), values.end(), std::numeric_limits<double>::quiet_NaN());
    return PointSource::missing;
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
        const PointSource source =
            resolve(key.level, first + place.cell + cornerOffset(c), channel, std::span(&value, 1));
        count += source == PointSource::covered ? 1 : 0;
        sum += weight * value;
    }
    if (coveredCorners) *coveredCorners = count;
    return sum;
}

}  // namespace tessera
