#include "io/flat_tiles.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>
#include <vector>

#include "base/error.h"

namespace tessera {
namespace {

constexpr std::size_t kBatchTiles = 4096;

void setBit(std::array<std::uint64_t, 8>& words, int offset) {
    words[std::size_t(offset >> 6)] |= std::uint64_t(1) << (offset & 63);
}
bool anyBit(const std::array<std::uint64_t, 8>& words) {
    return std::any_of(words.begin(), words.end(), [](std::uint64_t word) { return word != 0; });
}

const float* findExtension(const ExtensionPoints* extension, int channels, int level, const Vec3i& p) {
    if (!extension) return nullptr;
    const auto before = [](const ExtensionPoint& a, const ExtensionPoint& b) {
        if (a.level != b.level) return a.level < b.level;
        if (a.index.z != b.index.z) return a.index.z < b.index.z;
        if (a.index.y != b.index.y) return a.index.y < b.index.y;
        return a.index.x < b.index.x;
    };
    const ExtensionPoint wanted{p, level, 0};
    const auto found = std::lower_bound(extension->points.begin(), extension->points.end(), wanted, before);
    if (found == extension->points.end() || found->level != level || found->index != p) return nullptr;
    TESSERA_CHECK(std::size_t(found->firstValue) + std::size_t(channels) <= extension->values.size(),
                  "an extension point has its values");
    return extension->values.data() + found->firstValue;
}

// Borrowed from the store: nothing is copied.
OutputTile borrowTile(const Tile& tile, const Vec3i& origin) {
    OutputTile out;
    out.origin = origin;
    out.coverage = tile.coverage;
    out.active = tile.coverage;
    out.values = tile.values.get();
    return out;
}

struct TileOfLeaf {
    std::size_t leaf = 0;
    int tile = 0;
};

class FlatSampler {
  public:
    FlatSampler(const BrickTree& tree, BrickStore& store, const Reconstruction* reconstruction,
                const ExtensionPoints* extension, int level, const Execution& execution)
        : tree_(tree),
          store_(store),
          reconstruction_(reconstruction),
          extension_(extension),
          level_(level),
          execution_(execution) {}

    void run(const TileBatchSink& sink) {
        const std::span<const BrickKey> leaves = tree_.leaves();
        std::vector<std::size_t> finer, borders, equal, coarser;
        for (std::size_t leaf = 0; leaf < leaves.size(); ++leaf) {
            const BrickKey& key = leaves[leaf];
            if (key.level < level_) {
                finer.push_back(leaf);
            } else if (key.level > level_) {
                coarser.push_back(leaf);
            } else {
                (touchesCoarser(key) ? borders : equal).push_back(leaf);
            }
        }
        TESSERA_CHECK(reconstruction_ || equal.size() == leaves.size(),
                      "several levels need a reconstruction");
        // Everything that reads samples of other bricks comes first; after that tiles can go as soon as they
        // are written.
        sampleCoarser(coarser, sink);
        sampleFiner(finer, sink);
        sampleBorders(borders, sink);
        for (const auto* done : {&coarser, &finer, &borders}) {
            for (std::size_t leaf : *done) releaseLeaf(leaf);
        }
        passOn(equal, sink);
    }

  private:
    // Corner values of a coarse brick's closed box.
    struct Corners {
        std::vector<double> values;       // channel by channel
        std::vector<std::uint8_t> state;  // 0: no value, 1: covered, 2: extended
    };
    // One tile still to be sampled from a coarse brick.
    struct CoarseTile {
        std::size_t leaf;
        std::size_t corners;  // position in the batch
        Vec3i origin;
    };

    bool touchesCoarser(const BrickKey& key) const {
        for (int n = 0; n < 27; ++n) {
            const Vec3i step(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
            const std::int64_t leaf = tree_.findCovering({key.level, key.index + step});
            if (leaf >= 0 && tree_.leaves()[std::size_t(leaf)].level > key.level) return true;
        }
        return false;
    }

    void releaseLeaf(std::size_t leaf) {
        for (int t = 0; t < store_.tileCount(); ++t) store_.release(leaf, t);
    }

    OutputTile newTile(const Vec3i& origin) const {
        OutputTile tile;
        tile.origin = origin;
        tile.owned.reset(new float[std::size_t(store_.channels()) * kTilePoints]());
        tile.values = tile.owned.get();
        return tile;
    }

    void emit(std::vector<OutputTile>& tiles, const TileBatchSink& sink) const {
        std::erase_if(tiles, [](const OutputTile& tile) { return !anyBit(tile.active); });
        if (!tiles.empty()) sink(tiles);
    }

    Vec3i tileOrigin(const TileOfLeaf& t) const {
        const int n = store_.tilesPerEdge();
        const Vec3i local(t.tile / (n * n), t.tile / n % n, t.tile % n);
        return tree_.ownedPoints(tree_.leaves()[t.leaf]).min + local * kTileSize;
    }

    std::vector<TileOfLeaf> storedTiles(std::span<const std::size_t> leaves) const {
        std::vector<TileOfLeaf> tiles;
        for (std::size_t leaf : leaves) {
            for (int t = 0; t < store_.tileCount(); ++t) {
                if (store_.tile(leaf, t)) tiles.push_back({leaf, t});
            }
        }
        return tiles;
    }

  public:
    void passOn(std::span<const std::size_t> leaves, const TileBatchSink& sink) {
        const std::vector<TileOfLeaf> tiles = storedTiles(leaves);
        std::vector<OutputTile> batch;
        for (std::size_t begin = 0; begin < tiles.size(); begin += kBatchTiles) {
            execution_.throwIfCancelled();
            const std::size_t end = std::min(tiles.size(), begin + kBatchTiles);
            batch.clear();
            for (std::size_t i = begin; i < end; ++i)
                batch.push_back(borrowTile(*store_.tile(tiles[i].leaf, tiles[i].tile), tileOrigin(tiles[i])));
            sink(batch);
            for (std::size_t i = begin; i < end; ++i) store_.release(tiles[i].leaf, tiles[i].tile);
        }
    }

  private:
    // Bricks of the grid's level with a coarser neighbour: the points on the common border take the coarse
    // brick's interpolation.
    void sampleBorders(std::span<const std::size_t> leaves, const TileBatchSink& sink) {
        const std::vector<TileOfLeaf> tiles = storedTiles(leaves);
        for (std::size_t begin = 0; begin < tiles.size(); begin += kBatchTiles) {
            const std::size_t count = std::min(kBatchTiles, tiles.size() - begin);
            std::vector<OutputTile> batch(count);
            parallelFor(execution_, std::int64_t(count), [&](std::int64_t i) {
                batch[std::size_t(i)] = borderTile(tiles[begin + std::size_t(i)]);
            });
            emit(batch, sink);
        }
    }

    OutputTile borderTile(const TileOfLeaf& place) const {
        const Tile& stored = *store_.tile(place.leaf, place.tile);
        const Vec3i origin = tileOrigin(place);
        const Vec3i brickMin = tree_.ownedPoints(tree_.leaves()[place.leaf]).min;
        OutputTile tile = newTile(origin);
        tile.coverage = tile.active = stored.coverage;
        std::copy_n(stored.values.get(), std::size_t(store_.channels()) * kTilePoints, tile.owned.get());
        for (int offset = 0; offset < kTilePoints; ++offset) {
            const Vec3i p = origin + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            const bool onBorder = p.x == brickMin.x || p.y == brickMin.y || p.z == brickMin.z;
            if (!onBorder || !stored.covered(offset)) continue;
            for (int c = 0; c < store_.channels(); ++c)
                tile.owned[std::size_t(c * kTilePoints + offset)] =
                    float(reconstruction_->at(level_, p, c).value);
        }
        return tile;
    }

    void sampleCoarser(std::span<const std::size_t> leaves, const TileBatchSink& sink) {
        for (std::size_t begin = 0; begin < leaves.size();) {
            // Leaves are taken together until they fill a batch; a huge one is a batch of its own, given in
            // parts.
            std::size_t end = begin;
            std::vector<CoarseTile> tiles;
            while (end < leaves.size() && (end == begin || tiles.size() < kBatchTiles)) {
                listCoarseTiles(leaves[end], end - begin, tiles);
                ++end;
            }
            std::vector<Corners> corners(end - begin);
            parallelFor(execution_, std::int64_t(end - begin), [&](std::int64_t i) {
                corners[std::size_t(i)] = gatherCorners(leaves[begin + std::size_t(i)]);
            });
            for (std::size_t first = 0; first < tiles.size(); first += kBatchTiles) {
                const std::size_t count = std::min(kBatchTiles, tiles.size() - first);
                std::vector<OutputTile> batch(count);
                parallelFor(execution_, std::int64_t(count), [&](std::int64_t i) {
                    const CoarseTile& tile = tiles[first + std::size_t(i)];
                    batch[std::size_t(i)] = interpolateTile(tile, corners[tile.corners]);
                });
                emit(batch, sink);
            }
            begin = end;
        }
    }

    void listCoarseTiles(std::size_t leaf, std::size_t corners, std::vector<CoarseTile>& tiles) const {
        const BrickKey& key = tree_.leaves()[leaf];
        const int shift = key.level - level_;
        const Vec3i origin = tree_.ownedPoints(key).min * (1 << shift);
        const int edge = tree_.brickCells() << shift;
        for (int x = 0; x < edge; x += kTileSize)
            for (int y = 0; y < edge; y += kTileSize)
                for (int z = 0; z < edge; z += kTileSize)
                    tiles.push_back({leaf, corners, origin + Vec3i(x, y, z)});
    }

    Corners gatherCorners(std::size_t leaf) const {
        const BrickKey& key = tree_.leaves()[leaf];
        const Vec3i origin = tree_.ownedPoints(key).min;
        const int edge = tree_.brickCells() + 1;
        const std::size_t count = std::size_t(edge) * std::size_t(edge) * std::size_t(edge);
        Corners corners;
        corners.values.resize(count * std::size_t(store_.channels()));
        corners.state.resize(count);
        for (std::size_t i = 0; i < count; ++i) {
            const Vec3i local(int(i) / (edge * edge), int(i) / edge % edge, int(i) % edge);
            gatherCorner(leaf, origin + local, local, i, count, corners);
        }
        return corners;
    }

    void gatherCorner(std::size_t leaf, const Vec3i& p, const Vec3i& local, std::size_t i, std::size_t count,
                      Corners& corners) const {
        const int level = tree_.leaves()[leaf].level;
        const int cells = tree_.brickCells();
        if (const float* extended = findExtension(extension_, store_.channels(), level, p)) {
            corners.state[i] = 2;
            for (int c = 0; c < store_.channels(); ++c)
                corners.values[std::size_t(c) * count + i] = double(extended[c]);
            return;
        }
        // An owned point keeps its exact coverage, also where its value comes from a still coarser brick.
        bool covered = false;
        if (local.x < cells && local.y < cells && local.z < cells) {
            store_.value(leaf, local, 0, covered);
        } else {
            covered = reconstruction_->resolve(level, p, 0, {});
        }
        if (!covered) return;
        std::vector<double> values(std::size_t(store_.channels()));
        reconstruction_->resolve(level, p, 0, values);
        for (std::size_t c = 0; c < values.size(); ++c) corners.values[c * count + i] = values[c];
        corners.state[i] = 1;
    }

    OutputTile interpolateTile(const CoarseTile& place, const Corners& corners) const {
        const BrickKey& key = tree_.leaves()[place.leaf];
        const int shift = key.level - level_;
        const int mask = (1 << shift) - 1;
        const double step = std::ldexp(1.0, -shift);
        const int edge = tree_.brickCells() + 1;
        const std::size_t count = corners.state.size();
        const Vec3i first = place.origin - tree_.ownedPoints(key).min * (1 << shift);
        OutputTile tile = newTile(place.origin);
        for (int offset = 0; offset < kTilePoints; ++offset) {
            const Vec3i q = first + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            const Vec3i cell(q.x >> shift, q.y >> shift, q.z >> shift);
            const Vec3i part(q.x & mask, q.y & mask, q.z & mask);
            const std::size_t base =
                (std::size_t(cell.x) * std::size_t(edge) + std::size_t(cell.y)) * std::size_t(edge) +
                std::size_t(cell.z);
            // Along an axis without a fraction only the lower corner counts.
            const std::size_t dx = part.x ? std::size_t(edge) * std::size_t(edge) : 0,
                              dy = part.y ? std::size_t(edge) : 0, dz = part.z ? 1 : 0;
            const std::size_t at[8] = {base,      base + dz,      base + dy,      base + dy + dz,
                                       base + dx, base + dx + dz, base + dx + dy, base + dx + dy + dz};
            int covered = 0, missing = 0;
            for (std::size_t corner : at) {
                covered += corners.state[corner] == 1;
                missing += corners.state[corner] == 0;
            }
            if (missing > 0 || covered == 0) continue;
            setBit(tile.active, offset);
            if (covered == 8) setBit(tile.coverage, offset);
            const double fx = part.x * step, fy = part.y * step, fz = part.z * step;
            for (int c = 0; c < store_.channels(); ++c) {
                const double* v = corners.values.data() + std::size_t(c) * count;
                const auto mix = [](double a, double b, double f) { return f == 0 ? a : a + (b - a) * f; };
                const double low = mix(mix(v[at[0]], v[at[1]], fz), mix(v[at[2]], v[at[3]], fz), fy);
                const double high = mix(mix(v[at[4]], v[at[5]], fz), mix(v[at[6]], v[at[7]], fz), fy);
                tile.owned[std::size_t(c * kTilePoints + offset)] = float(mix(low, high, fx));
            }
        }
        return tile;
    }

    // Bricks finer than the grid (its size was capped): every point of the grid is one of theirs.
    void sampleFiner(std::span<const std::size_t> leaves, const TileBatchSink& sink) {
        std::vector<Vec3i> origins = finerTiles(leaves);
        for (std::size_t begin = 0; begin < origins.size(); begin += kBatchTiles) {
            const std::size_t count = std::min(kBatchTiles, origins.size() - begin);
            std::vector<OutputTile> batch(count);
            parallelFor(execution_, std::int64_t(count), [&](std::int64_t i) {
                batch[std::size_t(i)] = subsampleTile(origins[begin + std::size_t(i)]);
            });
            emit(batch, sink);
        }
    }

    std::vector<Vec3i> finerTiles(std::span<const std::size_t> leaves) const {
        std::vector<Vec3i> origins;
        for (std::size_t leaf : leaves) {
            const BrickKey& key = tree_.leaves()[leaf];
            const int shift = level_ - key.level;
            const IndexBox box = tree_.ownedPoints(key);
            const Vec3i low = floorDiv(box.min, kTileSize << shift),
                        high = floorDiv(box.max - Vec3i(1), kTileSize << shift);
            for (int x = low.x; x <= high.x; ++x)
                for (int y = low.y; y <= high.y; ++y)
                    for (int z = low.z; z <= high.z; ++z) origins.push_back(Vec3i(x, y, z) * kTileSize);
        }
        const auto before = [](const Vec3i& a, const Vec3i& b) {
            return std::array{a.x, a.y, a.z} < std::array{b.x, b.y, b.z};
        };
        std::sort(origins.begin(), origins.end(), before);
        origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
        return origins;
    }

    OutputTile subsampleTile(const Vec3i& origin) const {
        OutputTile tile = newTile(origin);
        for (int offset = 0; offset < kTilePoints; ++offset) {
            const Vec3i p = origin + Vec3i(offset >> 6, offset >> 3 & 7, offset & 7);
            const std::int64_t leaf = tree_.findLeafAt(Vec3d(p) * std::ldexp(1.0, level_));
            if (leaf < 0) continue;
            const BrickKey& key = tree_.leaves()[std::size_t(leaf)];
            if (key.level >= level_) continue;
            const Vec3i fine = p * (1 << (level_ - key.level));
            bool covered = false;
            store_.value(std::size_t(leaf), fine - tree_.ownedPoints(key).min, 0, covered);
            if (!covered) continue;
            setBit(tile.coverage, offset);
            for (int c = 0; c < store_.channels(); ++c)
                tile.owned[std::size_t(c * kTilePoints + offset)] =
                    float(reconstruction_->at(key.level, fine, c).value);
        }
        tile.active = tile.coverage;
        return tile;
    }

    const BrickTree& tree_;
    BrickStore& store_;
    const Reconstruction* reconstruction_;
    const ExtensionPoints* extension_;
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

void forEachFlatTile(const BrickTree& tree, BrickStore& store, const Reconstruction* reconstruction,
                     const ExtensionPoints* extension, int level, const Execution& execution,
                     const TileBatchSink& sink) {
    FlatSampler(tree, store, reconstruction, extension, level, execution).run(sink);
}

void forEachLevelTile(const BrickTree& tree, BrickStore& store, int level, const Execution& execution,
                      const TileBatchSink& sink) {
    std::vector<std::size_t> leaves;
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        if (tree.leaves()[leaf].level == level) leaves.push_back(leaf);
    }
    FlatSampler(tree, store, nullptr, nullptr, level, execution).passOn(leaves, sink);
}

}  // namespace tessera
