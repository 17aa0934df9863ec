#include "pool/stored_bricks.h"

#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "base/floor_div.h"
#include "base/parallel.h"

namespace tessera {

namespace {

/// Makes the blocks of leaves.
class StoredReader {
  public:
    StoredReader(const BrickTree& tree, const BrickStore& store) : tree_(tree), store_(store) {}

    /// Whether no point of a leaf can have a value: nothing is stored in it, nor next to it.
    bool isBare(std::size_t leaf) const {
        const BrickKey& key = tree_.leaves()[leaf];
        for (int n = 0; n < 27; ++n) {
            const std::int64_t near =
                tree_.findLeaf({key.level, key.index + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1)});
            for (int t = 0; near >= 0 && t < store_.tileCount(); ++t)
                if (store_.tile(std::size_t(near), t)) return false;
        }
        if (store_.extension().empty() && store_.surface().empty()) return true;
        const IndexBox box = tree_.closedPoints(key);
        const Vec3i first = floorDiv(box.min, kTileSize), last = floorDiv(box.max - 1, kTileSize);
        TileKey tile{key.level, first};
        for (tile.index.z = first.z; tile.index.z <= last.z; ++tile.index.z)
            for (tile.index.y = first.y; tile.index.y <= last.y; ++tile.index.y)
                for (tile.index.x = first.x; tile.index.x <= last.x; ++tile.index.x)
                    if (store_.extension().contains(tile) || store_.surface().contains(tile)) return false;
        return true;
    }
    std::shared_ptr<const Block> read(std::size_t leaf) {
        const BrickKey& key = tree_.leaves()[leaf];
        const IndexBox owned = tree_.ownedPoints(key);
        auto block = std::make_shared<Block>();
        block->lattice = tree_.lattice(key.level);
        block->box = tree_.closedPoints(key);
        block->channels = store_.channels();
        block->values.assign(std::size_t(block->channels) * block->count(), kNone);
        block->coverage.assign(block->count(), 0);
        Vec3i p;
        for (p.z = block->box.min.z; p.z < block->box.max.z; ++p.z)
            for (p.y = block->box.min.y; p.y < block->box.max.y; ++p.y)
                for (p.x = block->box.min.x; p.x < block->box.max.x; ++p.x) {
                    const bool isOwn = owned.contains(p);
                    if (isOwn && putSample(leaf, p, *block)) continue;
                    if (isOwn || tree_.findLeafAt(key.level, p) < 0) putOutside(key.level, p, *block);
                }
        return block;
    }
    /// Null where none is known.
    std::shared_ptr<const SurfacePoints> readSurface(std::size_t leaf) const {
        if (store_.surface().empty()) return nullptr;
        const BrickKey& key = tree_.leaves()[leaf];
        const IndexBox box = tree_.closedPoints(key);
        auto surface = std::make_shared<SurfacePoints>();
        std::uint32_t offset = 0;
        const Tile* tile = nullptr;
        Vec3i p, last(std::numeric_limits<int>::min());
        for (p.z = box.min.z; p.z < box.max.z; ++p.z)
            for (p.y = box.min.y; p.y < box.max.y; ++p.y)
                for (p.x = box.min.x; p.x < box.max.x; ++p.x, ++offset) {
                    const Vec3i at = floorDiv(p, kTileSize);
                    if (at != last) {
                        const auto found = store_.surface().find({key.level, at});
                        tile = found == store_.surface().end() ? nullptr : &found->second;
                        last = at;
                    }
                    if (tile && tile->covered(offsetInTile(p)))
                        surface->add(offset, double(tile->channel(0)[offsetInTile(p)]));
                }
        return surface;
    }
    std::int64_t estimated() const { return estimated_; }
    std::int64_t missing() const { return missing_; }

  private:
    static constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

    const Tile* coveredTile(std::size_t leaf, const Vec3i& p) const {
        const int n = store_.tilesPerEdge();
        const Vec3i tile = (p - tree_.ownedPoints(tree_.leaves()[leaf]).min) / kTileSize;
        const Tile* stored = store_.tile(leaf, (tile.x * n + tile.y) * n + tile.z);
        return stored && stored->covered(offsetInTile(p)) ? stored : nullptr;
    }
    static void put(const Tile& tile, const Vec3i& p, Block& block) {
        const std::size_t at = block.offset(p);
        for (int c = 0; c < block.channels; ++c)
            block.values[std::size_t(c) * block.count() + at] = tile.channel(c)[offsetInTile(p)];
    }
    bool putSample(std::size_t leaf, const Vec3i& p, Block& block) const {
        const Tile* tile = coveredTile(leaf, p);
        if (!tile) return false;
        put(*tile, p, block);
        block.coverage[block.offset(p)] = 1;
        return true;
    }
    void putOutside(int level, const Vec3i& p, Block& block) {
        if (const Tile* tile = store_.extensionAt(level, p))
            put(*tile, p, block);
        else
            ++(store_.extension().empty() && putMean(level, p, block) ? estimated_ : missing_);
    }
    /// Depends on the point alone, so that bricks that share it agree. False without a sample next to it.
    bool putMean(int level, const Vec3i& p, Block& block) const {
        std::vector<const Tile*> tiles;
        std::vector<int> offsets;
        for (int n = 0; n < 27; ++n) {
            const Vec3i near = p + Vec3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
            const std::int64_t leaf = tree_.findLeaf({level, floorDiv(near, tree_.brickCells())});
            const Tile* tile = leaf < 0 ? nullptr : coveredTile(std::size_t(leaf), near);
            if (!tile) continue;
            tiles.push_back(tile);
            offsets.push_back(offsetInTile(near));
        }
        for (int c = 0; c < block.channels; ++c) {
            double sum = 0;
            int count = 0;
            for (std::size_t i = 0; i < tiles.size(); ++i) {
                const float value = tiles[i]->channel(c)[offsets[i]];
                if (!std::isfinite(value)) continue;
                sum += double(value);
                ++count;
            }
            if (count > 0)
                block.values[std::size_t(c) * block.count() + block.offset(p)] = float(sum / count);
        }
        return !tiles.empty();
    }

    const BrickTree& tree_;
    const BrickStore& store_;
    std::atomic<std::int64_t> estimated_{0}, missing_{0};
};

void addNotes(const StoredTraits& traits, StoredBricks& stored) {
    if (traits.layers == 0 && stored.estimatedPoints + stored.missingPoints > 0)
        stored.notes.push_back(
            "the file has no values outside the mesh nor its surface (--extend 1 stores them), so both are "
            "approximate within a voxel of it: " +
            std::to_string(stored.estimatedPoints) +
            " points take the mean of the samples next to them, and " + std::to_string(stored.missingPoints) +
            " have no value");
    if (traits.layers > 0 && stored.missingPoints > 0)
        stored.notes.push_back(
            std::to_string(stored.missingPoints) +
            " points outside the mesh have no value, as they lie beyond the file's layers of "
            "extension or the field isn't finite there; reading inside the mesh needs no others");
    if (traits.isHalf) stored.notes.emplace_back("values were rounded to half floats");
    if (!traits.hasStatistics)
        stored.notes.emplace_back(
            "the file doesn't say how far single bricks are from the field (--brick-statistics stores it): "
            "only "
            "the error of the whole is known, and ranges and histograms follow from samples");
}

}  // namespace

StoredBricks showStored(const BrickTree& tree, const BrickStore& store, const StoredTraits& traits,
                        const Execution& execution) {
    StoredBricks stored;
    stored.bricks.resize(tree.leafCount());
    StoredReader reader(tree, store);
    parallelFor(execution, std::int64_t(tree.leafCount()), [&](std::int64_t i) {
        const auto leaf = std::size_t(i);
        if (reader.isBare(leaf)) return;
        const BrickKey& key = tree.leaves()[leaf];
        const Depth depth(tree.levelCount() - 1 - key.level);
        stored.bricks[leaf] = {
            {{depth, key.index}, std::uint32_t(leaf)}, reader.read(leaf), reader.readSurface(leaf)};
    });
    std::erase_if(stored.bricks, [](const ShownBrick& brick) { return !brick.samples; });
    stored.estimatedPoints = reader.estimated();
    stored.missingPoints = reader.missing();
    addNotes(traits, stored);
    return stored;
}

}  // namespace tessera
