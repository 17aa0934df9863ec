#include "verify/check_voxels.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <memory>

#include "base/check.h"
#include "base/floor_div.h"
#include "base/parallel.h"
#include "brick/extend.h"
#include "brick/flatten.h"
#include "brick/kept_points.h"
#include "brick/surface_distance.h"
#include "mesh/field_range.h"
#include "tessera/lattice.h"

namespace tessera {

namespace {

constexpr double kFloatRounding = 0x1p-22;  // of the largest value: a few units in the last place
constexpr double kHalfRounding = 0x1p-10;   // of the corners, and of what is interpolated from them

/// The samples of one leaf as a block.
Block blockOf(const BrickTree& tree, const BrickStore& store, std::size_t leaf) {
    const BrickKey& key = tree.leaves()[leaf];
    Block block;
    block.lattice = tree.lattice(key.level);
    block.box = tree.ownedPoints(key);
    block.channels = store.channels();
    block.values.assign(std::size_t(block.channels) * block.count(), 0.0f);
    block.coverage.assign(block.count(), 0);
    const int n = store.tilesPerEdge();
    for (int t = 0; t < store.tileCount(); ++t) {
        const Tile* tile = store.tile(leaf, t);
        if (!tile) continue;
        const Vec3i first = block.box.min + Vec3i(t / (n * n), t / n % n, t % n) * kTileSize;
        for (int offset = 0; offset < kTilePoints; ++offset) {
            if (!tile->covered(offset)) continue;
            const std::size_t at = block.offset(first + pointInTile(offset));
            block.coverage[at] = 1;
            for (int c = 0; c < block.channels; ++c)
                block.values[std::size_t(c) * block.count() + at] = tile->channel(c)[offset];
        }
    }
    return block;
}

class VoxelChecker {
  public:
    VoxelChecker(const TetMesh& mesh, std::span<const int> fields, const StoredVoxels& stored,
                 const Resampler& resampler, const BindOptions& bind, const Execution& execution)
        : mesh_(mesh),
          fields_(fields),
          stored_(stored),
          tree_(*stored.tree),
          store_(*stored.store),
          resampler_(resampler),
          bind_(bind),
          nearest_(mesh, execution.threads),
          kept_(stored.boundsWorld, tree_.originWorld(), tree_.spacingWorld(), tree_.levelCount()),
          execution_(execution) {
        for (const int f : fields) {
            const Field& field = mesh.fields[std::size_t(f)];
            for (int c = 0; c < field.components; ++c) {
                const ValueRange range = finiteFloatRange(field, c);
                largest_.push_back(range.empty() ? 0 : std::max(std::abs(range.min), std::abs(range.max)));
            }
            // A grid each: a vector's components go together.
            const int apart = field.components == 3 ? 1 : field.components;
            for (int g = 0; g < apart; ++g) grids_.push_back(field.components / apart);
        }
    }

    VoxelCheck run() {
        for (int level = 0; level < tree_.levelCount(); ++level) checkSamples(level);
        if (stored_.bricks)
            compareFlat();
        else
            compareExtension();
        if (result_.firstProblem.empty()) result_.firstProblem = result_.samples.firstProblem;
        return std::move(result_);
    }

  private:
    void checkSamples(int level) {
        std::vector<std::size_t> leaves;
        for (std::size_t leaf = 0; leaf < tree_.leafCount(); ++leaf)
            if (tree_.leaves()[leaf].level == level) leaves.push_back(leaf);
        if (leaves.empty()) return;
        const VoxelMesh voxels(mesh_, tree_.lattice(level), execution_.threads);
        const PointChecker checker(mesh_, voxels, fields_, 0);
        std::vector<PointCheck> checks(leaves.size());
        std::atomic<std::int64_t> done{0};
        Execution one = execution_;  // the leaves are what is shared out
        one.threads = 1;
        one.progress = nullptr;
        parallelFor(execution_, std::int64_t(leaves.size()), [&](std::int64_t i) {
            const Block block = blockOf(tree_, store_, leaves[std::size_t(i)]);
            const std::vector<PointRule> rules = rulesOf(level, block.box);
            std::vector<float> thinnest;
            checker.check(std::span(&block, 1), std::span(&stored_.bounds, 1),
                          std::span(&checks[std::size_t(i)], 1), thinnest, one, rules);
            execution_.report(Stage::comparing, ++done, std::int64_t(leaves.size()));
        });
        for (PointCheck& check : checks) {
            if (!check.firstProblem.empty())
                check.firstProblem =
                    "level " + std::to_string(level + stored_.flatLevel) + ", " + check.firstProblem;
            result_.samples += check;
        }
    }

    std::vector<PointRule> rulesOf(int level, const IndexBox& box) const {
        if (kept_.all() && !stored_.bricks) return {};
        std::vector<PointRule> rules;
        rules.reserve(std::size_t(box.count()));
        Vec3i p;
        for (p.z = box.min.z; p.z < box.max.z; ++p.z)
            for (p.y = box.min.y; p.y < box.max.y; ++p.y)
                for (p.x = box.min.x; p.x < box.max.x; ++p.x)
                    rules.push_back(!kept_.keeps(level, p)           ? PointRule::absent
                                    : stored_.bricks && !isSample(p) ? PointRule::coverage
                                                                     : PointRule::sample);
        return rules;
    }

    /// Whether a point of a flat grid lies on the lattice of the coarsest brick whose closed box holds it.
    bool isSample(const Vec3i& p) const {
        const int coarsest = coarsestLevel(p);
        if (coarsest <= stored_.flatLevel) return true;
        const int mask = (1 << (coarsest - stored_.flatLevel)) - 1;
        return ((p.x | p.y | p.z) & mask) == 0;
    }
    int coarsestLevel(const Vec3i& p) const {
        const int b = stored_.bricks->brickCells();
        const Vec3i brick = floorDiv(p, b), rest = p - brick * b;
        int coarsest = 0;
        for (int side = 0; side < 8; ++side) {
            const Vec3i step = cornerOffset(side);
            if ((step.x && rest.x) || (step.y && rest.y) || (step.z && rest.z)) continue;
            const std::int64_t leaf = stored_.bricks->findCovering({stored_.flatLevel, brick - step});
            if (leaf >= 0) coarsest = std::max(coarsest, stored_.bricks->leaves()[std::size_t(leaf)].level);
        }
        return coarsest;
    }

    void compareExtension() {
        TileMap found = std::move(store_.extension());
        store_.extension().clear();
        const Reconstruction reconstruction(mesh_, fields_, tree_, store_, nearest_);
        extendOutside(
            mesh_, tree_, store_, reconstruction, kept_, stored_.layers,
            [&](int level, const Vec3i& p, std::span<double> values) {
                reconstruction.nearestValues(level, p, 0, values);
            },
            execution_);
        compareTiles(store_.extension(), found);
        store_.extension() = std::move(found);
        compareSurface(reconstruction);
    }

    // Files with an extension need have no distances.
    void compareSurface(const Reconstruction& reconstruction) {
        if (store_.surface().empty()) return;
        TileMap found = std::move(store_.surface());
        measureSurface(tree_, store_, reconstruction, nearest_, kept_, execution_);
        comparePoints(
            store_.surface(), found,
            [&](int level, const Vec3i& p, const Tile& expected, const Tile& other, int offset) {
                ++result_.derived;
                constexpr double kRounding = 1e-5;  // of places and distances as floats, in voxels
                if (!(std::abs(double(expected.channel(0)[offset]) - double(other.channel(0)[offset])) <=
                      kRounding * kFarFromSurface))
                    note(result_.wrongDerived, level, p, "is at another distance from the mesh's surface");
            },
            [&](int level, const Vec3i& p, const Tile&, int) {
                note(result_.missingDerived, level, p, "has no distance from the mesh's surface");
            },
            [&](int level, const Vec3i& p) {
                note(result_.unexpected, level, p,
                     "has a distance from the mesh's surface and isn't near it");
            });
        store_.surface() = std::move(found);
    }

    void compareFlat() {
        BrickStore samples = samplesOfBricks();
        const CoverageSource coverage = [&](const Lattice&, std::span<const IndexBox> boxes,
                                            const BlockSink& sink) {
            parallelFor(execution_, std::int64_t(boxes.size()), [&](std::int64_t i) {
                const Vec3i brick = floorDiv(boxes[std::size_t(i)].min, tree_.brickCells());
                const std::int64_t leaf = tree_.findLeaf({0, brick});
                if (leaf >= 0) sink(std::size_t(i), blockOf(tree_, store_, std::size_t(leaf)));
            });
        };
        const FlatBricks again =
            flatten(mesh_, fields_, *stored_.bricks, samples, nearest_, coverage,
                    {stored_.flatLevel, stored_.boundsWorld, stored_.layers}, execution_);
        for (std::size_t leaf = 0; leaf < again.tree.leafCount(); ++leaf) {
            const BrickKey& key = again.tree.leaves()[leaf];
            const std::int64_t own = tree_.findLeaf(key);
            for (int t = 0; t < store_.tileCount(); ++t) {
                const Tile* expected = again.store.tile(leaf, t);
                const Tile* found = own >= 0 ? store_.tile(std::size_t(own), t) : nullptr;
                if (expected && found) compareTile(key, t, *expected, *found);
            }
        }
        compareTiles(again.store.extension(), store_.extension());
    }

    /// The bricks' samples that the flat grid holds, and those beyond the bounds that it was interpolated
    /// from.
    BrickStore samplesOfBricks() {
        const BrickTree& bricks = *stored_.bricks;
        BrickStore samples(bricks.brickCells(), bricks.leafCount(), store_.channels());
        std::vector<std::vector<std::size_t>> beyond(std::size_t(bricks.levelCount()));
        for (std::size_t leaf = 0; leaf < bricks.leafCount(); ++leaf) {
            const BrickKey& key = bricks.leaves()[leaf];
            takeSamples(leaf, key, samples);
            if (!kept_.all() && sticksOut(key)) beyond[std::size_t(key.level)].push_back(leaf);
        }
        for (int level = 0; level < bricks.levelCount(); ++level) {
            if (beyond[std::size_t(level)].empty()) continue;
            std::vector<IndexBox> boxes;
            for (const std::size_t leaf : beyond[std::size_t(level)])
                boxes.push_back(bricks.ownedPoints(bricks.leaves()[leaf]));
            resampler_.bind(mesh_, fields_, bind_)
                ->resample(
                    bricks.lattice(level), boxes,
                    [&](std::size_t box, const Block& block) {
                        const std::size_t leaf = beyond[std::size_t(level)][box];
                        takeBeyond(block, bricks.leaves()[leaf], leaf, samples);
                    },
                    execution_);
        }
        return samples;
    }

    bool sticksOut(const BrickKey& key) const {
        bool out = false;
        forEachGridPoint(key, [&](const Vec3i&, const Vec3i& p) { out = out || !kept_.keeps(0, p); });
        return out;
    }

    /// @param visit called with the local point and its point of the grid, for those that are one.
    template <class Visit>
    void forEachGridPoint(const BrickKey& key, const Visit& visit) const {
        const int b = stored_.bricks->brickCells(), up = key.level - stored_.flatLevel;
        const Vec3i first = key.index * b;
        for (int x = 0; x < b; ++x)
            for (int y = 0; y < b; ++y)
                for (int z = 0; z < b; ++z) {
                    const Vec3i local(x, y, z), p = first + local;
                    if (up >= 0) {
                        visit(local, p * (1 << up));
                        continue;
                    }
                    const int mask = (1 << -up) - 1;
                    if (((p.x | p.y | p.z) & mask) == 0) visit(local, p >> -up);
                }
    }

    void takeSamples(std::size_t leaf, const BrickKey& key, BrickStore& samples) const {
        forEachGridPoint(key, [&](const Vec3i& local, const Vec3i& p) {
            const std::int64_t own = tree_.findLeafAt(0, p);
            if (own < 0) return;
            const Vec3i at = p - tree_.ownedPoints(tree_.leaves()[std::size_t(own)]).min;
            bool covered = false;
            store_.value(std::size_t(own), at, 0, covered);
            if (!covered) return;
            const int n = samples.tilesPerEdge();
            Tile& tile = samples.ensureTile(leaf, ((local.x >> 3) * n + (local.y >> 3)) * n + (local.z >> 3));
            const int offset = offsetInTile(local);
            tile.cover(offset);
            for (int c = 0; c < samples.channels(); ++c)
                tile.values[std::size_t(c * kTilePoints + offset)] =
                    store_.value(std::size_t(own), at, c, covered);
        });
    }

    void takeBeyond(const Block& block, const BrickKey& key, std::size_t leaf, BrickStore& samples) const {
        const int n = samples.tilesPerEdge();
        forEachGridPoint(key, [&](const Vec3i& local, const Vec3i& p) {
            const Vec3i at = block.box.min + local;
            if (kept_.keeps(0, p) || !block.covered(at)) return;
            Tile& tile = samples.ensureTile(leaf, ((local.x >> 3) * n + (local.y >> 3)) * n + (local.z >> 3));
            tile.cover(offsetInTile(local));
            for (int c = 0; c < block.channels; ++c)
                tile.values[std::size_t(c * kTilePoints + offsetInTile(local))] = block.value(c, at);
        });
    }

    bool agrees(int channel, float expected, float found) const {
        if (!std::isfinite(found)) return false;
        const double largest = largest_[std::size_t(channel)];
        double allowed = kFloatRounding * std::max(std::abs(double(expected)), 0.25 * largest);
        const auto& isHalf = stored_.bounds.isHalf;
        if (!isHalf.empty() && isHalf[std::size_t(channel)]) allowed += kHalfRounding * largest + 0x1p-24;
        return std::abs(double(expected) - double(found)) <= allowed;
    }

    void note(std::int64_t& counter, int level, const Vec3i& p, const char* what) {
        ++counter;
        if (!result_.firstProblem.empty()) return;
        char text[160];
        std::snprintf(text, sizeof text, "level %d, lattice point (%d, %d, %d) %s", level + stored_.flatLevel,
                      p.x, p.y, p.z, what);
        result_.firstProblem = text;
    }

    void compareAt(int level, const Vec3i& p, const Tile& expected, const Tile& found, int offset) {
        ++result_.derived;
        int first = 0;
        for (const int components : grids_) {
            if (!gridAgrees(first, components, expected, found, offset))
                return note(result_.wrongDerived, level, p, "differs from the reconstruction");
            first += components;
        }
    }
    bool gridAgrees(int first, int components, const Tile& expected, const Tile& found, int offset) const {
        bool isFinite = true, agree = true;
        for (int c = first; c < first + components; ++c) {
            isFinite = isFinite && std::isfinite(expected.channel(c)[offset]);
            agree = agree && agrees(c, expected.channel(c)[offset], found.channel(c)[offset]);
        }
        return isFinite ? agree : !std::isfinite(found.channel(first)[offset]);
    }

    void compareTile(const BrickKey& key, int t, const Tile& expected, const Tile& found) {
        const int n = store_.tilesPerEdge();
        const Vec3i first = tree_.ownedPoints(key).min + Vec3i(t / (n * n), t / n % n, t % n) * kTileSize;
        for (int offset = 0; offset < kTilePoints; ++offset)
            if (expected.covered(offset) && found.covered(offset))
                compareAt(key.level, first + pointInTile(offset), expected, found, offset);
    }

    void compareTiles(const TileMap& expected, const TileMap& found) {
        comparePoints(
            expected, found,
            [&](int level, const Vec3i& p, const Tile& tile, const Tile& other, int offset) {
                compareAt(level, p, tile, other, offset);
            },
            [&](int level, const Vec3i& p, const Tile& tile, int offset) {
                if (isActive(tile, offset))
                    note(result_.missingDerived, level, p, "has no value, though the mesh needs one there");
            },
            [&](int level, const Vec3i& p) {
                note(result_.unexpected, level, p,
                     "is active and neither in the mesh nor part of its extension");
            });
    }
    template <class Both, class Missing, class Unexpected>
    static void comparePoints(const TileMap& expected, const TileMap& found, const Both& both,
                              const Missing& missing, const Unexpected& unexpected) {
        for (const auto& [key, tile] : expected) {
            const auto other = found.find(key);
            for (int offset = 0; offset < kTilePoints; ++offset) {
                if (!tile.covered(offset)) continue;
                const Vec3i p = key.index * kTileSize + pointInTile(offset);
                if (other != found.end() && other->second.covered(offset))
                    both(key.level, p, tile, other->second, offset);
                else
                    missing(key.level, p, tile, offset);
            }
        }
        for (const auto& [key, tile] : found) {
            const auto other = expected.find(key);
            for (int offset = 0; offset < kTilePoints; ++offset)
                if (tile.covered(offset) && (other == expected.end() || !other->second.covered(offset)))
                    unexpected(key.level, key.index * kTileSize + pointInTile(offset));
        }
    }
    /// Whether any grid has a finite value there.
    bool isActive(const Tile& tile, int offset) const {
        int first = 0;
        for (const int components : grids_) {
            bool isFinite = true;
            for (int c = first; c < first + components; ++c)
                isFinite = isFinite && std::isfinite(tile.channel(c)[offset]);
            if (isFinite) return true;
            first += components;
        }
        return false;
    }

    const TetMesh& mesh_;
    std::span<const int> fields_;
    const StoredVoxels& stored_;
    const BrickTree& tree_;
    BrickStore& store_;
    const Resampler& resampler_;
    const BindOptions& bind_;
    NearestOnDemand nearest_;
    KeptPoints kept_;
    const Execution& execution_;
    std::vector<double> largest_;  // by channel
    std::vector<int> grids_;       // components of each
    VoxelCheck result_;
};

}  // namespace

VoxelCheck checkVoxels(const TetMesh& mesh, std::span<const int> fields, const StoredVoxels& stored,
                       const Resampler& resampler, const BindOptions& bind, const Execution& execution) {
    TESSERA_CHECK(stored.tree && stored.store, "there are voxels to check");
    return VoxelChecker(mesh, fields, stored, resampler, bind, execution).run();
}

}  // namespace tessera
