#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <unordered_set>

#include "base/error.h"
#include "brick/seams.h"

namespace tessera {

namespace {

bool ascending(const BrickKey& a, const BrickKey& b) {
    return std::tie(a.level, a.index.z, a.index.y, a.index.x) <
           std::tie(b.level, b.index.z, b.index.y, b.index.x);
}

// Bricks that new points may lie in: the leaves, and what lies next to a leaf of the level and isn't a
// coarser leaf's.
std::vector<BrickKey> targetBricks(const BrickTree& tree) {
    std::unordered_set<BrickKey, BrickKeyHash> keys;
    for (const BrickKey& leaf : tree.leaves())
        for (int n = 0; n < 27; ++n) {
            const BrickKey near{leaf.level, leaf.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)};
            const std::int64_t covering = tree.findCovering(near);
            if (covering >= 0 && tree.leaves()[std::size_t(covering)].level != leaf.level) continue;
            keys.insert(near);
        }
    std::vector<BrickKey> sorted(keys.begin(), keys.end());
    std::sort(sorted.begin(), sorted.end(), ascending);
    return sorted;
}

// Coverage of one brick and a border around it, one byte a point, x fastest.
class CoverageWindow {
  public:
    CoverageWindow(const BrickTree& tree, const BrickStore& store, const BrickKey& key, int layers)
        : layers_(layers),
          edge_(tree.brickCells() + 2 * layers),
          marks_(std::size_t(edge_) * std::size_t(edge_) * std::size_t(edge_), 0) {
        for (int n = 0; n < 27; ++n) {
            const Vec3i step(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
            const std::int64_t leaf = tree.findLeaf({key.level, key.index + step});
            if (leaf >= 0) copy(store, std::size_t(leaf), step * tree.brickCells(), tree.brickCells());
        }
    }
    bool empty() const { return !any_; }
    bool covered(const Vec3i& local) const { return marks_[at(local + layers_)] != 0; }
    /// Marks every point within `layers` steps (26 neighbours) of a marked one: three passes, one an axis.
    void grow() {
        for (int axis = 0; axis < 3; ++axis) {
            const std::vector<std::uint8_t> before = marks_;
            Vec3i step(0);
            step[axis] = 1;
            for (int z = 0; z < edge_; ++z)
                for (int y = 0; y < edge_; ++y)
                    for (int x = 0; x < edge_; ++x) {
                        const Vec3i p(x, y, z);
                        if (!before[at(p)]) continue;
                        for (int d = -layers_; d <= layers_; ++d)
                            if (p[axis] + d >= 0 && p[axis] + d < edge_) marks_[at(p + step * d)] = 1;
                    }
        }
    }

  private:
    std::size_t at(const Vec3i& p) const {
        return (std::size_t(p.z) * std::size_t(edge_) + std::size_t(p.y)) * std::size_t(edge_) +
               std::size_t(p.x);
    }
    void copy(const BrickStore& store, std::size_t leaf, const Vec3i& offset, int brickCells) {
        const Vec3i low = glm::max(Vec3i(0), -offset - layers_);
        const Vec3i high = glm::min(Vec3i(brickCells), brickCells + layers_ - offset);
        const int n = store.tilesPerEdge();
        for (int z = low.z; z < high.z; ++z)
            for (int y = low.y; y < high.y; ++y)
                for (int x = low.x; x < high.x; ++x) {
                    const Tile* tile = store.tile(leaf, ((x >> 3) * n + (y >> 3)) * n + (z >> 3));
                    if (!tile || !tile->covered(((x & 7) * 8 + (y & 7)) * 8 + (z & 7))) continue;
                    marks_[at(Vec3i(x, y, z) + offset + layers_)] = 1;
                    any_ = true;
                }
    }

    int layers_;
    int edge_;
    std::vector<std::uint8_t> marks_;
    bool any_ = false;
};

bool fullyCovered(const BrickStore& store, std::size_t leaf) {
    for (int t = 0; t < store.tileCount(); ++t) {
        const Tile* tile = store.tile(leaf, t);
        if (!tile) return false;
        for (const std::uint64_t word : tile->coverage)
            if (word != ~std::uint64_t(0)) return false;
    }
    return true;
}

// New points of one brick, in order.
std::vector<Vec3i> newPoints(const BrickTree& tree, const BrickStore& store, const BrickKey& key,
                             int layers) {
    std::vector<Vec3i> points;
    const std::int64_t leaf = tree.findLeaf(key);
    if (leaf >= 0 && fullyCovered(store, std::size_t(leaf))) return points;
    CoverageWindow window(tree, store, key, layers);
    if (window.empty()) return points;
    CoverageWindow grown = window;
    grown.grow();
    const bool shared = tree.isRefined(key);
    const int b = tree.brickCells();
    for (int z = 0; z < b; ++z)
        for (int y = 0; y < b; ++y)
            for (int x = 0; x < b; ++x) {
                const Vec3i local(x, y, z);
                if (!grown.covered(local) || window.covered(local)) continue;
                const Vec3i p = key.index * b + local;
                if (shared && tree.findLeafAt(key.level, p) >= 0) continue;  // a finer leaf's own
                points.push_back(p);
            }
    return points;
}

}  // namespace

ExtensionPoints extendOutside(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree,
                              const BrickStore& store, const NearestPointIndex& nearest, int layers,
                              const Execution& execution) {
    if (layers < 0 || layers > tree.brickCells())
        throw InputError("the number of layers outside the mesh must be 0 to the brick size, not " +
                         std::to_string(layers));
    ExtensionPoints result;
    if (layers == 0) return result;
    const std::vector<BrickKey> targets = targetBricks(tree);
    std::vector<std::vector<Vec3i>> points(targets.size());
    parallelFor(execution, std::int64_t(targets.size()), [&](std::int64_t t) {
        points[std::size_t(t)] = newPoints(tree, store, targets[std::size_t(t)], layers);
    });
    for (std::size_t t = 0; t < targets.size(); ++t)
        for (const Vec3i& p : points[t]) result.points.push_back({p, targets[t].level, 0});
    std::sort(result.points.begin(), result.points.end(),
              [](const ExtensionPoint& a, const ExtensionPoint& b) {
                  return ascending({a.level, a.index}, {b.level, b.index});
              });

    const std::size_t channels = std::size_t(store.channels());
    TESSERA_CHECK(result.points.size() * channels < (std::size_t(1) << 32),
                  "extension values are counted in 32 bits");
    result.values.resize(result.points.size() * channels);
    parallelForChunks(
        execution, std::int64_t(result.points.size()), 256, [&](std::int64_t begin, std::int64_t end) {
            for (std::int64_t i = begin; i < end; ++i) {
                ExtensionPoint& point = result.points[std::size_t(i)];
                const double h = tree.spacingWorld(point.level);
                const Vec3d place = tree.lattice(point.level).worldFromIndex(Vec3d(point.index));
                // Within `layers` steps along every axis of a covered point: a diagonal at most, and room for
                // rounding.
                const NearestPoint found = nearest.find(place, 2.0 * (layers + 1) * h);
                std::size_t at = std::size_t(i) * channels;
                point.firstValue = std::uint32_t(at);
                for (const int f : fields) {
                    const Field& field = mesh.fields[std::size_t(f)];
                    for (int c = 0; c < field.components; ++c)
                        result.values[at++] = found.element < 0 ? 0.0f : float(found.value(field, c));
                }
            }
        });
    return result;
}

}  // namespace tessera
