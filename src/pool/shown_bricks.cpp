#include "pool/shown_bricks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/check.h"
#include "base/floor_div.h"
#include "base/parallel.h"
#include "brick/surface_distance.h"

namespace tessera {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

template <class Visit>
void forEachPoint(const IndexBox& box, Visit&& visit) {
    Vec3i p;
    for (p.z = box.min.z; p.z < box.max.z; ++p.z)
        for (p.y = box.min.y; p.y < box.max.y; ++p.y)
            for (p.x = box.min.x; p.x < box.max.x; ++p.x) visit(p);
}

double finiteOrNone(float value) {
    return std::isfinite(value) ? double(value) : kNone;
}

void copySample(const Block& samples, const Vec3i& p, std::span<double> values) {
    const std::size_t offset = samples.offset(p);
    for (std::size_t c = 0; c < values.size(); ++c) values[c] = finiteOrNone(samples.channel(int(c))[offset]);
}

}  // namespace

// Nearest mesh points of places of which each is mostly near the one before: that bounds the search.
class ShownBricks::NearestWalk {
  public:
    explicit NearestWalk(const NearestOnDemand* nearest) : nearest_(nearest) {}

    NearestPoint find(const Vec3d& placeWorld) {
        constexpr double kRounding = 1 + 1e-9;
        const double most = (distance_ + glm::length(placeWorld - last_)) * kRounding;
        NearestPoint found = nearest_->get().find(placeWorld, most);
        if (found.element < 0)
            found = nearest_->get().find(placeWorld, std::numeric_limits<double>::infinity());
        last_ = placeWorld;
        if (found.element >= 0) distance_ = found.distanceWorld;
        return found;
    }

  private:
    const NearestOnDemand* nearest_;
    Vec3d last_{0};
    double distance_ = std::numeric_limits<double>::infinity();  // of the mesh from the last place
};

bool operator==(const PointValues& a, const PointValues& b) {
    return a.covered == b.covered && a.surface == b.surface && a.values.size() == b.values.size() &&
           std::memcmp(a.values.data(), b.values.data(), a.values.size() * sizeof(double)) == 0;
}

ShownBricks::ShownBricks(const TetMesh& mesh, std::span<const int> fields, int brickCells,
                         const NearestOnDemand& nearest)
    : ShownBricks(0, brickCells) {
    mesh_ = &mesh;
    nearest_ = &nearest;
    for (const int f : fields)
        for (int c = 0; c < mesh.fields[std::size_t(f)].components; ++c) channelOf_.emplace_back(f, c);
    channels_ = int(channelOf_.size());
}

ShownBricks::ShownBricks(int channels, int brickCells) : channels_(channels), cells_(brickCells) {
    TESSERA_CHECK(brickCells > 0 && brickCells % 2 == 0, "bricks have an even number of cells");
}

bool ShownBricks::isShown(const GrowingLeaf& leaf) const {
    return leaf.slot < leaves_.size() && leaves_[leaf.slot].samples && leaves_[leaf.slot].leaf == leaf;
}

void ShownBricks::apply(const Publication& publication, const Execution& execution) {
    for (const GrowingLeaf& leaf : publication.removed)
        TESSERA_CHECK(isShown(leaf), "a leaf that isn't shown is removed");
    for (const ShownBrick& brick : publication.added) {
        TESSERA_CHECK(brick.samples && brick.samples->channels == channels() &&
                          brick.samples->box == closedPoints(brick.leaf.key),
                      "samples of another brick, or of other channels");
    }
    // What can fail from outside is done first, so that nothing has changed then.
    std::vector<Leaf> added(publication.added.size());
    for (std::size_t i = 0; i < added.size(); ++i) {
        added[i].leaf = publication.added[i].leaf;
        added[i].samples = publication.added[i].samples;
        added[i].surface = publication.added[i].surface;
    }
    parallelFor(execution, std::int64_t(added.size()),
                [&](std::int64_t i) { findOutside(added[std::size_t(i)]); });

    for (const GrowingLeaf& leaf : publication.removed) {
        index_.remove(leaf.key);
        leaves_[leaf.slot] = {};
        --leafCount_;
    }
    std::vector<Vec3i> roots;
    for (const Leaf& leaf : added) roots.push_back(ancestorKey(leaf.leaf.key, Depth(0)).index);
    index_.cover(roots);
    for (Leaf& leaf : added) {
        const std::uint32_t number = leaf.leaf.slot;
        if (number >= leaves_.size()) leaves_.resize(std::size_t(number) + 1);
        TESSERA_CHECK(!leaves_[number].samples, "two leaves have one number");
        index_.put(leaf.leaf.key, number);
        leaves_[number] = std::move(leaf);
        ++leafCount_;
    }
}

bool ShownBricks::isOnBorder(const Vec3i& local) const {
    for (int a = 0; a < 3; ++a)
        if (local[a] == 0 || local[a] == cells_) return true;
    return false;
}

void ShownBricks::findOutside(Leaf& leaf) const {
    if (!mesh_) return;
    const Block& samples = *leaf.samples;
    auto surface = std::make_shared<const SurfacePoints>(
        measureSurface(*nearest_, samples.lattice, samples.box, samples.coverage));
    auto corner = surface->all().begin();
    std::vector<double> values(channelOf_.size());
    NearestWalk walk(nearest_);
    std::uint32_t offset = 0;
    forEachPoint(samples.box, [&](const Vec3i& p) {
        const bool isAtSurface = corner != surface->all().end() && corner->first == offset;
        if (isAtSurface) ++corner;
        const std::uint32_t here = offset++;
        if (samples.covered(p) || (!isAtSurface && !isOnBorder(p - samples.box.min))) return;
        nearestValues(leaf, p, walk, values);
        leaf.outside.push_back(here);
        leaf.outsideValues.insert(leaf.outsideValues.end(), values.begin(), values.end());
    });
    leaf.surface = std::move(surface);
}

// At a point outside the mesh, in the closed box of a leaf.
void ShownBricks::nearestValues(const Leaf& leaf, const Vec3i& p, NearestWalk& walk,
                                std::span<double> values) const {
    if (values.empty()) return;
    if (!mesh_) {
        copySample(*leaf.samples, p, values);
        return;
    }
    const auto offset = std::uint32_t(leaf.samples->offset(p));
    const auto known = std::lower_bound(leaf.outside.begin(), leaf.outside.end(), offset);
    if (known != leaf.outside.end() && *known == offset) {
        const auto at = std::size_t(known - leaf.outside.begin()) * values.size();
        std::copy_n(leaf.outsideValues.begin() + std::ptrdiff_t(at), values.size(), values.begin());
        return;
    }
    const Lattice& lattice = leaf.samples->lattice;
    const NearestPoint found = walk.find(lattice.worldFromIndex(Vec3d(p)));
    for (std::size_t c = 0; c < values.size(); ++c) {
        const auto [field, component] = channelOf_[c];
        const double value =
            found.element < 0 ? kNone : found.value(mesh_->fields[std::size_t(field)], component);
        values[c] = finiteOrNone(float(value));  // as samples are
    }
}

// At a point of the closed box of a leaf, in its voxels.
double ShownBricks::surfaceAt(const Leaf& leaf, const Vec3i& p, PointSource source, Unknown unknown) const {
    const bool isCovered = source == PointSource::covered;
    if (!leaf.surface) return isCovered ? 0.5 : -0.5;
    if (const float* known = leaf.surface->find(leaf.samples->offset(p))) return double(*known);
    if (!mesh_ || unknown == Unknown::far) return isCovered ? kFarFromSurface : -kFarFromSurface;
    const double distance = distanceFromSurface(*nearest_, leaf.samples->lattice, p);
    return isCovered ? distance : -distance;
}

const ShownBricks::Leaf* ShownBricks::findCovering(const DepthKey& key) const {
    const auto found = index_.findCovering(key);
    return found ? &leaves_[found->number] : nullptr;
}

PointSource ShownBricks::ownSample(const Leaf& leaf, const Vec3i& p, NearestWalk& walk,
                                   std::span<double> values) const {
    if (!leaf.samples->covered(p)) {
        nearestValues(leaf, p, walk, values);
        return PointSource::nearest;
    }
    copySample(*leaf.samples, p, values);
    return PointSource::covered;
}

// `asking` is a leaf of this depth whose closed box holds p. `near` gives the leaf that covers a brick.
template <class Near>
ShownBricks::Point ShownBricks::resolve(Depth depth, const Vec3i& p, const Leaf& asking, Unknown unknown,
                                        Near&& near, NearestWalk& walk, std::span<double> values) const {
    const Vec3i brick = floorDiv(p, cells_);
    const Vec3i rest = p - brick * cells_;
    // The bricks of this depth whose closed boxes hold p: the owner, and on each axis where p lies on a
    // border the one before it.
    const Leaf* coarsest = &asking;
    const Leaf* own = nullptr;
    const int mask = (rest.x == 0 ? 1 : 0) | (rest.y == 0 ? 2 : 0) | (rest.z == 0 ? 4 : 0);
    for (int side = 0; side < 8; ++side) {
        if (side & ~mask) continue;
        const Leaf* leaf = near(DepthKey{depth, brick - Vec3i(side & 1, (side >> 1) & 1, side >> 2)});
        if (side == 0) own = leaf;
        if (leaf && leaf->leaf.key.depth < coarsest->leaf.key.depth) coarsest = leaf;
    }
    if (coarsest != &asking) return fromCoarse(depth, p, *coarsest, unknown, walk, values);
    PointSource source = PointSource::nearest;
    if (own) {
        source = ownSample(*own, p, walk, values);
    } else if (const auto finer = index_.findOwner(depth, p, cells_)) {
        const int times = 1 << (finer->key.depth - depth);
        source = ownSample(leaves_[finer->number], p * times, walk, values);
    } else {
        nearestValues(asking, p, walk, values);
    }
    return {source, surfaceAt(asking, p, source, unknown)};
}

ShownBricks::Point ShownBricks::fromCoarse(Depth depth, const Vec3i& p, const Leaf& coarse, Unknown unknown,
                                           NearestWalk& walk, std::span<double> values) const {
    const Depth above = coarse.leaf.key.depth;
    const int step = 1 << (depth - above);
    const Vec3i cell = floorDiv(p, step);
    const Vec3d t = Vec3d(p - cell * step) / double(step);
    const auto near = [&](const DepthKey& key) { return findCovering(key); };
    const auto shown = [&](double surface) {
        return std::clamp(surface * step, -kFarFromSurface, kFarFromSurface);
    };
    if (t == Vec3d(0)) {
        const Point at = resolve(above, cell, coarse, unknown, near, walk, values);
        return {at.source, shown(at.surface)};
    }
    Point result;
    std::array<double, 16> few;
    std::vector<double> many;
    if (values.size() > few.size()) many.resize(values.size());
    const std::span<double> corner = many.empty() ? std::span(few).first(values.size()) : std::span(many);
    std::fill(values.begin(), values.end(), 0.0);
    for (int c = 0; c < 8; ++c) {
        const double weight = cornerWeight(t, c);
        if (weight == 0) continue;
        const Point at = resolve(above, cell + cornerOffset(c), coarse, unknown, near, walk, corner);
        result.source = std::min(result.source, at.source);
        result.surface += weight * at.surface;
        for (std::size_t v = 0; v < values.size(); ++v) values[v] += weight * corner[v];
    }
    result.surface = shown(result.surface);
    return result;
}

PointValues ShownBricks::valuesAt(const GrowingLeaf& asked, const IndexBox& points) const {
    TESSERA_CHECK(isShown(asked), "a leaf that isn't shown");
    const Leaf& leaf = leaves_[asked.slot];
    const DepthKey& key = asked.key;
    std::array<const Leaf*, 27> around{};
    for (int n = 0; n < 27; ++n)
        around[std::size_t(n)] =
            findCovering({key.depth, key.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)});
    const auto near = [&](const DepthKey& other) {
        const Vec3i by = other.index - key.index + 1;
        return around[std::size_t(by.x + 3 * by.y + 9 * by.z)];
    };
    NearestWalk walk(nearest_);
    PointValues result;
    const auto channels = std::size_t(channels_);
    result.values.resize(std::size_t(points.count()) * channels);
    result.covered.resize(std::size_t(points.count()));
    result.surface.resize(std::size_t(points.count()));
    std::size_t n = 0;
    forEachPoint(points, [&](const Vec3i& p) {
        const std::span<double> values(result.values.data() + n * channels, channels);
        Point at;
        if (isOnBorder(p - leaf.samples->box.min)) {
            const bool isAtSurface = leaf.surface && leaf.surface->find(leaf.samples->offset(p));
            at = resolve(key.depth, p, leaf, isAtSurface ? Unknown::measured : Unknown::far, near, walk,
                         values);
        } else {
            at.source = ownSample(leaf, p, walk, values);
            at.surface = surfaceAt(leaf, p, at.source, Unknown::far);
        }
        // Beside the surface a coarser neighbour's corners may lie outside where the point itself doesn't.
        result.covered[n] = at.source == PointSource::covered || leaf.samples->covered(p);
        result.surface[n++] = float(at.surface);
    });
    return result;
}

std::vector<IndexBox> ShownBricks::touchedPoints(const DepthKey& leaf,
                                                 std::span<const DepthKey> changed) const {
    const IndexBox closed = closedPoints(leaf);
    IndexBox touched;
    for (const DepthKey& key : changed) {
        const IndexBox shared = intersect(closed, pointsInside(key, leaf.depth));
        if (shared.empty()) continue;
        touched = touched.empty()
                      ? shared
                      : IndexBox{glm::min(touched.min, shared.min), glm::max(touched.max, shared.max)};
    }
    std::vector<IndexBox> parts;
    if (touched.empty()) return parts;
    // A point on the border to a coarser leaf depends on the corners of its cell there, one voxel away at
    // most, as two leaves that touch differ by one depth.
    touched = intersect(closed, {touched.min - 1, touched.max + 1});
    for (int axis = 0; axis < 3; ++axis)
        for (const int plane : {closed.min[axis], closed.max[axis] - 1}) {
            if (plane < touched.min[axis] || plane >= touched.max[axis]) continue;
            IndexBox& part = parts.emplace_back(touched);
            part.min[axis] = plane, part.max[axis] = plane + 1;
        }
    return parts;
}

// The points of a depth's lattice in the closed box of a brick of any depth, and those next to it where that
// lies between points.
IndexBox ShownBricks::pointsInside(const DepthKey& key, Depth depth) const {
    const Vec3i first = key.index * cells_, last = (key.index + 1) * cells_;
    if (key.depth <= depth) {
        const int times = 1 << (depth - key.depth);
        return {first * times, last * times + 1};
    }
    const int step = 1 << (key.depth - depth);
    return {floorDiv(first, step), floorDiv(last + (step - 1), step) + 1};
}

}  // namespace tessera
