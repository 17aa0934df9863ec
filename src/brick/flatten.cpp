#include "brick/flatten.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "base/floor_div.h"
#include "base/parallel.h"
#include "brick/extend.h"
#include "brick/kept_points.h"
#include "brick/leaf_tiles.h"

namespace tessera {

namespace {

void sortOut(std::vector<BrickKey>& keys) {
    std::sort(keys.begin(), keys.end(), inStorageOrder);
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

// The bricks of a level that the leaves fill or lie in, as bricks of level 0.
std::vector<BrickKey> bricksOfLevel(const BrickTree& tree, int level, const IndexBox& kept) {
    const int b = tree.brickCells();
    std::vector<BrickKey> keys;
    for (const BrickKey& leaf : tree.leaves()) {
        const int up = level - leaf.level;
        Vec3i low = up >= 0 ? leaf.index >> up : leaf.index * (1 << -up);
        Vec3i high = up >= 0 ? low : low + ((1 << -up) - 1);
        low = glm::max(low, floorDiv(kept.min, b));
        high = glm::min(high, floorDiv(kept.max - 1, b));
        for (int z = low.z; z <= high.z; ++z)
            for (int y = low.y; y <= high.y; ++y)
                for (int x = low.x; x <= high.x; ++x) keys.push_back({0, {x, y, z}});
    }
    sortOut(keys);
    return keys;
}

// Values at the corners of the cells of a coarser level that some points lie in.
class CoarseCorners {
  public:
    CoarseCorners(const Reconstruction& reconstruction, int channels, int levelsUp, const IndexBox& points,
                  int coarseLevel)
        : reconstruction_(reconstruction),
          channels_(std::size_t(channels)),
          up_(levelsUp),
          level_(coarseLevel),
          first_(points.min >> levelsUp),
          size_(((points.max - 1) >> levelsUp) + 2 - first_),
          values_(std::size_t(size_.x) * std::size_t(size_.y) * std::size_t(size_.z) * channels_),
          known_(std::size_t(size_.x) * std::size_t(size_.y) * std::size_t(size_.z), 0) {}

    // Trilinear, one axis after the other; along an axis without a fraction only the lower corner counts.
    void interpolate(const Vec3i& p, std::span<double> result) {
        const Vec3i cell = p >> up_;
        const Vec3i part = p - cell * (1 << up_);
        const double step = std::ldexp(1.0, -up_);
        std::array<const double*, 8> v;
        for (int c = 0; c < 8; ++c) {
            const Vec3i o = cornerOffset(c) * Vec3i(part.x != 0, part.y != 0, part.z != 0);
            v[std::size_t(c)] = corner(cell + o);
        }
        const auto mix = [](double a, double b, double f) { return f == 0 ? a : a + (b - a) * f; };
        for (std::size_t k = 0; k < channels_; ++k) {
            std::array<double, 4> yx;
            for (std::size_t c = 0; c < 4; ++c) yx[c] = mix(v[c][k], v[c + 4][k], part.z * step);
            const double low = mix(yx[0], yx[2], part.y * step), high = mix(yx[1], yx[3], part.y * step);
            result[k] = mix(low, high, part.x * step);
        }
    }

  private:
    const double* corner(const Vec3i& p) {
        const Vec3i q = p - first_;
        const std::size_t i =
            (std::size_t(q.x) * std::size_t(size_.y) + std::size_t(q.y)) * std::size_t(size_.z) +
            std::size_t(q.z);
        double* values = values_.data() + i * channels_;
        if (!known_[i]) {
            known_[i] = 1;
            reconstruction_.resolve(level_, p, 0, std::span(values, channels_));
        }
        return values;
    }

    const Reconstruction& reconstruction_;
    std::size_t channels_;
    int up_, level_;
    Vec3i first_, size_;
    std::vector<double> values_;
    std::vector<std::uint8_t> known_;
};

class Flattener {
  public:
    Flattener(const BrickTree& tree, const BrickStore& store, const Reconstruction& reconstruction, int level,
              const Execution& execution)
        : tree_(tree), store_(store), reconstruction_(reconstruction), level_(level), execution_(execution) {}

    void run(const BrickTree& flatTree, BrickStore& flat, const CoverageSource& coverage) {
        std::vector<std::size_t> coarse, others;
        for (std::size_t i = 0; i < flatTree.leafCount(); ++i) {
            const std::int64_t leaf = tree_.findCovering({level_, flatTree.leaves()[i].index});
            const bool isCoarse = leaf >= 0 && tree_.leaves()[std::size_t(leaf)].level > level_;
            (isCoarse ? coarse : others).push_back(i);
        }
        std::atomic<std::int64_t> done{0};
        const std::int64_t total = std::int64_t(flatTree.leafCount());
        parallelFor(execution_, std::int64_t(others.size()), [&](std::int64_t i) {
            const std::size_t brick = others[std::size_t(i)];
            const Vec3i& index = flatTree.leaves()[brick].index;
            const std::int64_t leaf = tree_.findCovering({level_, index});
            if (leaf >= 0)
                copyLeaf(std::size_t(leaf), brick, flat);
            else
                takeFiner(flatTree.ownedPoints(flatTree.leaves()[brick]), brick, flat);
            execution_.report(Stage::extending, ++done, total);
        });
        if (coarse.empty()) return;
        std::vector<IndexBox> boxes;
        for (const std::size_t brick : coarse)
            boxes.push_back(flatTree.ownedPoints(flatTree.leaves()[brick]));
        coverage(tree_.lattice(level_), boxes, [&](std::size_t box, const Block& block) {
            interpolateBrick(block, coarse[box], flatTree.leaves()[coarse[box]], flat);
            execution_.report(Stage::extending, ++done, total);
        });
    }

  private:
    // A leaf of this level: its samples, but on its border to a coarser one.
    void copyLeaf(std::size_t leaf, std::size_t brick, BrickStore& flat) const {
        const bool coarserNear = hasCoarserNeighbour(tree_, leaf);
        const Vec3i first = tree_.ownedPoints(tree_.leaves()[leaf]).min;
        const int n = store_.tilesPerEdge();
        std::vector<double> values(std::size_t(store_.channels()));
        for (int t = 0; t < store_.tileCount(); ++t) {
            const Tile* from = store_.tile(leaf, t);
            if (!from) continue;
            Tile& to = flat.ensureTile(brick, t);
            to.coverage = from->coverage;
            std::copy_n(from->values.get(), std::size_t(store_.channels()) * kTilePoints, to.values.get());
            const Vec3i corner = Vec3i(t / (n * n), t / n % n, t % n) * kTileSize;
            for (int offset = 0; coarserNear && offset < kTilePoints; ++offset) {
                const Vec3i local = corner + pointInTile(offset);
                if (!to.covered(offset) || (local.x && local.y && local.z)) continue;
                reconstruction_.resolve(level_, first + local, 0, values);
                put(values, to, offset);
            }
        }
    }

    // A brick inside a coarser leaf.
    void interpolateBrick(const Block& block, std::size_t brick, const BrickKey& key,
                          BrickStore& flat) const {
        const std::int64_t leaf = tree_.findCovering({level_, key.index});
        const int level = tree_.leaves()[std::size_t(leaf)].level;
        std::optional<CoarseCorners> corners;
        std::vector<double> values(std::size_t(store_.channels()));
        const IndexBox box{key.index * tree_.brickCells(), (key.index + 1) * tree_.brickCells()};
        forEachTile(box, [&](int t, const Vec3i& origin) {
            Tile* tile = nullptr;
            for (int offset = 0; offset < kTilePoints; ++offset) {
                const Vec3i p = origin + pointInTile(offset);
                if (!block.covered(p)) continue;
                if (!corners) corners.emplace(reconstruction_, store_.channels(), level - level_, box, level);
                if (!tile) tile = &flat.ensureTile(brick, t);
                tile->cover(offset);
                corners->interpolate(p, values);
                put(values, *tile, offset);
            }
        });
    }

    // A brick that finer leaves lie in: every point is one of theirs.
    void takeFiner(const IndexBox& box, std::size_t brick, BrickStore& flat) const {
        std::vector<double> values(std::size_t(store_.channels()));
        forEachTile(box, [&](int t, const Vec3i& origin) {
            Tile* tile = nullptr;
            for (int offset = 0; offset < kTilePoints; ++offset) {
                const Vec3i p = origin + pointInTile(offset);
                const std::int64_t leaf = tree_.findLeafAt(level_, p);
                if (leaf < 0) continue;
                const BrickKey& key = tree_.leaves()[std::size_t(leaf)];
                bool covered = false;
                store_.value(std::size_t(leaf), p * (1 << (level_ - key.level)) - tree_.ownedPoints(key).min,
                             0, covered);
                if (!covered) continue;
                if (!tile) tile = &flat.ensureTile(brick, t);
                tile->cover(offset);
                reconstruction_.resolve(level_, p, 0, values);
                put(values, *tile, offset);
            }
        });
    }

    template <class Visit>
    void forEachTile(const IndexBox& box, const Visit& visit) const {
        const int n = store_.tilesPerEdge();
        for (int t = 0; t < store_.tileCount(); ++t)
            visit(t, box.min + Vec3i(t / (n * n), t / n % n, t % n) * kTileSize);
    }
    static void put(const std::vector<double>& values, Tile& tile, int offset) {
        for (std::size_t c = 0; c < values.size(); ++c)
            tile.values[c * kTilePoints + std::size_t(offset)] = float(values[c]);
    }

    const BrickTree& tree_;
    const BrickStore& store_;
    const Reconstruction& reconstruction_;
    int level_;
    const Execution& execution_;
};

}  // namespace

double flatPointCount(const BrickTree& tree, int level) {
    const double brickPoints = std::pow(double(tree.brickCells()), 3);
    double points = 0;
    for (const BrickKey& key : tree.leaves()) points += std::ldexp(brickPoints, 3 * (key.level - level));
    return points;
}

int chooseFlatLevel(const BrickTree& tree, std::int64_t maxPoints) {
    int level = 0;
    while (level < 30 && flatPointCount(tree, level) > double(maxPoints)) ++level;
    return level;
}

BrickTree treeOfPoints(const BrickTree& tree, const BrickStore& store) {
    std::vector<BrickKey> keys;
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf)
        for (int t = 0; t < store.tileCount(); ++t)
            if (store.tile(leaf, t)) {
                keys.push_back(tree.leaves()[leaf]);
                break;
            }
    const int tiles = store.tilesPerEdge();
    for (const auto& [key, tile] : store.extension()) keys.push_back({key.level, floorDiv(key.index, tiles)});
    sortOut(keys);
    return BrickTree(tree.originWorld(), tree.spacingWorld(), tree.brickCells(), std::move(keys));
}

FlatBricks flatten(const TetMesh& mesh, std::span<const int> fields, const BrickTree& tree, BrickStore& store,
                   const NearestOnDemand& nearest, const CoverageSource& coverage,
                   const FlattenOptions& options, const Execution& execution) {
    const int level = options.level, b = tree.brickCells();
    const double spacing = tree.spacingWorld(level);
    const KeptPoints kept(options.boundsWorld, tree.originWorld(), spacing, 1);
    FlatBricks flat;
    flat.tree = BrickTree(tree.originWorld(), spacing, b, bricksOfLevel(tree, level, kept.corners(0)));
    flat.store = BrickStore(b, flat.tree.leafCount(), store.channels());
    const bool isFlat = std::all_of(tree.leaves().begin(), tree.leaves().end(),
                                    [&](const BrickKey& key) { return key.level == level; });
    const Reconstruction source(mesh, fields, tree, store, nearest);
    if (isFlat) {
        for (std::size_t i = 0; i < flat.tree.leafCount(); ++i)
            flat.store.moveLeaf(i, store, std::size_t(tree.findLeaf({level, flat.tree.leaves()[i].index})));
    } else {
        Flattener(tree, store, source, level, execution).run(flat.tree, flat.store, coverage);
    }
    cropToKept(flat.tree, kept, flat.store);
    const Reconstruction own(mesh, fields, flat.tree, flat.store, nearest);
    const ExtensionValues values = [&](int, const Vec3i& p, std::span<double> result) {
        if (isFlat)
            own.nearestValues(0, p, 0, result);
        else
            source.resolve(level, p, 0, result);
    };
    extendOutside(mesh, flat.tree, flat.store, own, kept, options.layers, values, execution);
    FlatBricks result{treeOfPoints(flat.tree, flat.store), {}};
    result.store = BrickStore(b, result.tree.leafCount(), store.channels());
    for (std::size_t i = 0; i < flat.tree.leafCount(); ++i) {
        const std::int64_t to = result.tree.findLeaf(flat.tree.leaves()[i]);
        if (to >= 0) result.store.moveLeaf(std::size_t(to), flat.store, i);
    }
    result.store.extension() = std::move(flat.store.extension());
    return result;
}

}  // namespace tessera
