#include <openvdb/io/Archive.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <ostream>
#include <tuple>
#include <utility>

#include "base/check.h"
#include "base/floor_div.h"
#include "base/parallel.h"
#include "base/text.h"
#include "brick/surface_distance.h"
#include "files/atomic_file.h"
#include "files/file_digest.h"
#include "refine/brick_result.h"
#include "tessera/error.h"
#include "vdb/openvdb_grids.h"
#include "vdb/packed_grid.h"
#include "vdb/vdb_metadata.h"
#include "vdb/vdb_write.h"

namespace tessera {
namespace {

using FloatLeaf = openvdb::FloatTree::LeafNodeType;
using Vec3fLeaf = openvdb::Vec3STree::LeafNodeType;
using BoolLeaf = openvdb::BoolTree::LeafNodeType;
static_assert(FloatLeaf::DIM == kTileSize && FloatLeaf::SIZE == kTilePoints,
              "tiles are laid out as OpenVDB's leaf nodes");

constexpr double kLost =
    std::numeric_limits<double>::infinity();  // of an error in voxels: one voxel falls on another

openvdb::Coord coord(const Vec3i& p) {
    return openvdb::Coord(p.x, p.y, p.z);
}

// Where a grid's transform places voxel (0, 0, 0), in the mesh's axes and unit.
Vec3d gridOriginWorld(const BrickTree& tree, int level, double voxelShift) {
    if (voxelShift == 0) return tree.originWorld();  // keeps the sign of a zero
    return tree.originWorld() + Vec3d(voxelShift * tree.spacingWorld(level));
}

openvdb::math::Transform::Ptr makeTransform(const BrickTree& tree, int level, double unitScale,
                                            const VdbWriteOptions& options) {
    namespace math = openvdb::math;
    const Vec3d origin = gridOriginWorld(tree, level, options.voxelShift) * unitScale;
    const double spacing = tree.spacingWorld(level) * unitScale;
    const UpAxis upAxis = options.upAxis;
    if (upAxis == UpAxis::keep) {
        const math::MapBase::Ptr map(
            new math::UniformScaleTranslateMap(spacing, {origin.x, origin.y, origin.z}));
        return math::Transform::Ptr(new math::Transform(map));
    }
    // Rows: where an index step along x, y, z leads in the file, then the place of index (0, 0, 0).
    const auto rows = [&](double yz, double zy, double y, double z) {
        return math::Mat4d(spacing, 0.0, 0.0, 0.0, 0.0, 0.0, yz, 0.0, 0.0, zy, 0.0, 0.0, origin.x, y, z, 1.0);
    };
    const math::Mat4d matrix = upAxis == UpAxis::y ? rows(-spacing, spacing, origin.z, -origin.y)
                                                   : rows(spacing, -spacing, -origin.z, origin.y);
    return math::Transform::Ptr(new math::Transform(math::MapBase::Ptr(new math::AffineMap(matrix))));
}

// 8^3 points of a grid: samples, points outside the mesh that carry a value, distances from the surface.
struct GridTile {
    Vec3i origin{0};
    const Tile* samples = nullptr;
    const Tile* extension = nullptr;
    const Tile* surface = nullptr;
};

// Bits of a tile where all given channels are finite.
std::array<std::uint64_t, 8> finiteMask(const Tile& tile, int firstChannel, int components) {
    std::array<std::uint64_t, 8> mask = tile.coverage;
    for (int c = firstChannel; c < firstChannel + components; ++c) {
        const float* values = tile.channel(c);
        for (std::size_t w = 0; w < 8; ++w) {
            std::uint64_t finite = 0;
            for (std::size_t b = 0; b < 64; ++b)
                finite |= std::uint64_t(std::isfinite(values[w * 64 + b])) << b;
            mask[w] &= finite;
        }
    }
    return mask;
}

template <class Leaf>
void setMask(Leaf& leaf, const std::array<std::uint64_t, 8>& words) {
    for (openvdb::Index w = 0; w < 8; ++w)
        leaf.getValueMask().template getWord<openvdb::Index64>(w) |= words[w];
}

// What becomes of the leaf nodes made: the bytes of a file, or a tree in memory.
enum class LeafForm { packed, plain };

// The grid of one plan at one level, or the coverage mask.
class GridBuilder {
  public:
    virtual ~GridBuilder() = default;
    virtual void reserve(std::size_t tiles) = 0;
    // Makes the leaf node of a tile of a batch; may be called for several at once.
    virtual void makeLeaf(std::size_t position, const GridTile& tile) = 0;
    // Puts the leaf nodes made since into the tree.
    virtual void addLeaves() = 0;
    virtual openvdb::GridBase::Ptr grid() const = 0;
    // Adds what depends on all leaf nodes. Once, when they are complete.
    virtual void describe() = 0;
};

template <class Grid>
class BuilderOf : public GridBuilder {
  public:
    using Leaf = typename Grid::TreeType::LeafNodeType;
    BuilderOf(LeafForm form, const typename Grid::ValueType& background, bool toHalf)
        : form_(form), grid_(std::make_shared<PackedGrid<Grid>>(background)) {
        grid_->setSaveFloatAsHalf(toHalf);
    }

    void reserve(std::size_t tiles) override { made_.resize(tiles); }
    void makeLeaf(std::size_t position, const GridTile& tile) override {
        Leaf leaf(coord(tile.origin), grid_->background());
        for (const Tile* part : partsOf(tile))
            if (part) fill(leaf, *part);
        if (leaf.isEmpty()) return;
        if (form_ == LeafForm::plain) {
            made_[position] = {std::make_unique<Leaf>(leaf), PackedLeaf()};
            return;
        }
        auto maskOnly = std::make_unique<Leaf>(openvdb::PartialCreate(), leaf.origin(), grid_->background());
        maskOnly->setValueMask(leaf.getValueMask());
        made_[position] = {std::move(maskOnly),
                           PackedLeaf(leaf, grid_->background(), grid_->saveFloatAsHalf())};
    }
    void addLeaves() override {
        for (auto& [leaf, bytes] : made_) {
            if (leaf && form_ == LeafForm::plain) grid_->tree().addLeaf(leaf.release());
            if (leaf) grid_->add(std::move(leaf), std::move(bytes));
        }
    }
    openvdb::GridBase::Ptr grid() const override { return grid_; }
    void describe() override {
        if (form_ == LeafForm::packed) grid_->describe();
    }

  protected:
    virtual void fill(Leaf& leaf, const Tile& tile) const = 0;
    /// Null: none.
    virtual std::array<const Tile*, 2> partsOf(const GridTile& tile) const {
        return {tile.samples, tile.extension};
    }

  private:
    LeafForm form_;
    std::shared_ptr<PackedGrid<Grid>> grid_;
    std::vector<std::pair<std::unique_ptr<Leaf>, PackedLeaf>> made_;
};

class ScalarBuilder final : public BuilderOf<openvdb::FloatGrid> {
  public:
    ScalarBuilder(LeafForm form, int channel, float background, bool toHalf)
        : BuilderOf(form, background, toHalf), channel_(channel) {}

  private:
    void fill(FloatLeaf& leaf, const Tile& tile) const override {
        const std::array<std::uint64_t, 8> mask = finiteMask(tile, channel_, 1);
        float* values = leaf.buffer().data();
        const float* from = tile.channel(channel_);
        for (std::size_t i = 0; i < kTilePoints; ++i)
            if (mask[i >> 6] >> (i & 63) & 1) values[i] = from[i];
        setMask(leaf, mask);
    }

    int channel_;
};

class VectorBuilder final : public BuilderOf<openvdb::Vec3SGrid> {
  public:
    VectorBuilder(LeafForm form, int channel, float background, bool toHalf, UpAxis upAxis)
        : BuilderOf(form, openvdb::Vec3f(background), toHalf), channel_(channel), upAxis_(upAxis) {}

  private:
    void fill(Vec3fLeaf& leaf, const Tile& tile) const override {
        const std::array<std::uint64_t, 8> mask = finiteMask(tile, channel_, 3);
        openvdb::Vec3f* values = leaf.buffer().data();
        const float *x = tile.channel(channel_), *y = tile.channel(channel_ + 1),
                    *z = tile.channel(channel_ + 2);
        for (std::size_t i = 0; i < kTilePoints; ++i)
            if (mask[i >> 6] >> (i & 63) & 1) values[i] = turned(openvdb::Vec3f(x[i], y[i], z[i]), upAxis_);
        setMask(leaf, mask);
    }

    int channel_;
    UpAxis upAxis_;
};

class CoverageBuilder final : public BuilderOf<openvdb::BoolGrid> {
  public:
    explicit CoverageBuilder(LeafForm form) : BuilderOf(form, false, false) {}

  private:
    void fill(BoolLeaf& leaf, const Tile& tile) const override {
        setMask(leaf, tile.coverage);
        leaf.buffer() = BoolLeaf::Buffer(leaf.getValueMask());
    }
    std::array<const Tile*, 2> partsOf(const GridTile& tile) const override {
        return {tile.samples, nullptr};
    }
};

class SurfaceBuilder final : public BuilderOf<openvdb::FloatGrid> {
  public:
    explicit SurfaceBuilder(LeafForm form, double voxel)
        : BuilderOf(form, float(kFarFromSurface * voxel), false), voxel_(voxel) {}

  private:
    void fill(FloatLeaf& leaf, const Tile& tile) const override {
        float* values = leaf.buffer().data();
        for (int i = 0; i < kTilePoints; ++i)
            if (tile.covered(i)) values[i] = float(-voxel_ * double(tile.channel(0)[i]));
        setMask(leaf, tile.coverage);
    }
    std::array<const Tile*, 2> partsOf(const GridTile& tile) const override {
        return {tile.surface, nullptr};
    }

    double voxel_;  // in the file's unit
};

// All grids of one level.
struct LevelGrids {
    int level = 0;
    std::vector<std::unique_ptr<GridBuilder>> builders;  // one a plan, the coverage, and the surface
};

LevelGrids makeBuilders(const std::vector<GridPlan>& plans, const std::vector<bool>& toHalf, LeafForm form,
                        int level, const VdbWriteOptions& options, double surfaceVoxel) {
    LevelGrids grids;
    grids.level = level;
    for (std::size_t p = 0; p < plans.size(); ++p) {
        if (plans[p].components == 3) {
            grids.builders.push_back(std::make_unique<VectorBuilder>(
                form, plans[p].firstChannel, options.background, toHalf[p], options.upAxis));
        } else {
            grids.builders.push_back(
                std::make_unique<ScalarBuilder>(form, plans[p].firstChannel, options.background, toHalf[p]));
        }
    }
    grids.builders.push_back(std::make_unique<CoverageBuilder>(form));
    if (surfaceVoxel > 0) grids.builders.push_back(std::make_unique<SurfaceBuilder>(form, surfaceVoxel));
    return grids;
}

void addTiles(LevelGrids& grids, std::span<const GridTile> tiles, const Execution& execution) {
    execution.throwIfCancelled();
    for (auto& builder : grids.builders) builder->reserve(tiles.size());
    parallelForChunks(execution, std::int64_t(tiles.size()), 64, [&](std::int64_t begin, std::int64_t end) {
        for (std::size_t i = std::size_t(begin); i < std::size_t(end); ++i) {
            for (auto& builder : grids.builders) builder->makeLeaf(i, tiles[i]);
        }
    });
    parallelFor(execution, std::int64_t(grids.builders.size()),
                [&](std::int64_t b) { grids.builders[std::size_t(b)]->addLeaves(); });
}

const Tile* partAt(const TileMap& tiles, const TileKey& key) {
    const auto found = tiles.find(key);
    return found == tiles.end() ? nullptr : &found->second;
}

// The tiles of one level in batches; frees them on the way.
void addLevel(LevelGrids& grids, int level, const BrickTree& tree, BrickStore& store,
              const Execution& execution) {
    constexpr std::size_t kBatchTiles = 4096;
    struct Place {
        std::size_t leaf;
        int tile;
        GridTile grid;
    };
    const int n = store.tilesPerEdge();
    std::vector<Place> places;
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        if (tree.leaves()[leaf].level != level) continue;
        const Vec3i first = tree.ownedPoints(tree.leaves()[leaf]).min;
        for (int t = 0; t < store.tileCount(); ++t) {
            const Tile* tile = store.tile(leaf, t);
            if (!tile) continue;
            const Vec3i origin = first + Vec3i(t / (n * n), t / n % n, t % n) * kTileSize;
            const TileKey key{level, floorDiv(origin, kTileSize)};
            places.push_back(
                {leaf, t, {origin, tile, partAt(store.extension(), key), partAt(store.surface(), key)}});
        }
    }
    // Tiles without samples.
    const auto hasSamples = [&](const Vec3i& tile) {
        const Vec3i brick = floorDiv(tile, n), local = tile - brick * n;
        const std::int64_t leaf = tree.findLeaf({level, brick});
        return leaf >= 0 && store.tile(std::size_t(leaf), (local.x * n + local.y) * n + local.z);
    };
    const std::size_t withSamples = places.size();
    for (const auto& [key, tile] : store.extension())
        if (key.level == level && !hasSamples(key.index))
            places.push_back({0, -1, {key.index * kTileSize, nullptr, &tile, partAt(store.surface(), key)}});
    for (const auto& [key, tile] : store.surface())
        if (key.level == level && !hasSamples(key.index) && !partAt(store.extension(), key))
            places.push_back({0, -1, {key.index * kTileSize, nullptr, nullptr, &tile}});
    std::sort(places.begin() + std::ptrdiff_t(withSamples), places.end(), [](const Place& a, const Place& b) {
        const Vec3i &p = a.grid.origin, &q = b.grid.origin;
        return std::tie(p.z, p.y, p.x) < std::tie(q.z, q.y, q.x);
    });
    for (std::size_t begin = 0; begin < places.size(); begin += kBatchTiles) {
        const std::size_t end = std::min(places.size(), begin + kBatchTiles);
        execution.report(Stage::writing, std::int64_t(begin), std::int64_t(places.size()));
        std::vector<GridTile> batch;
        for (std::size_t i = begin; i < end; ++i) batch.push_back(places[i].grid);
        addTiles(grids, batch, execution);
        for (std::size_t i = begin; i < end; ++i)
            if (places[i].tile >= 0) store.release(places[i].leaf, places[i].tile);
    }
}

std::vector<LevelGrids> buildGrids(const std::vector<GridPlan>& plans, const std::vector<bool>& toHalf,
                                   LeafForm form, BrickResult& result, const VdbWriteOptions& options,
                                   double unitScale, const Execution& execution) {
    const bool hasSurface = !result.store.surface().empty();
    std::vector<bool> present(std::size_t(result.tree.levelCount()), false);
    for (const BrickKey& key : result.tree.leaves()) present[std::size_t(key.level)] = true;
    for (const auto& [key, tile] : result.store.extension()) present.at(std::size_t(key.level)) = true;
    for (const auto& [key, tile] : result.store.surface()) present.at(std::size_t(key.level)) = true;
    std::vector<LevelGrids> all;
    for (int level = 0; level < result.tree.levelCount(); ++level) {
        if (!present[std::size_t(level)]) continue;
        const double voxel = hasSurface ? result.tree.spacingWorld(level) * unitScale : 0;
        LevelGrids& grids = all.emplace_back(makeBuilders(plans, toHalf, form, level, options, voxel));
        addLevel(grids, level, result.tree, result.store, execution);
    }
    if (all.empty()) all.push_back(makeBuilders(plans, toHalf, form, 0, options, 0));
    return all;
}

// The largest magnitude of a plan's values, in the mesh and beside it. As in the grid, a vector that isn't
// finite as a whole doesn't count.
float largestMagnitude(const BrickStore& store, const GridPlan& plan) {
    float largest = 0;
    const auto take = [&](const Tile& tile) {
        const std::array<std::uint64_t, 8> mask = finiteMask(tile, plan.firstChannel, plan.components);
        for (int c = plan.firstChannel; c < plan.firstChannel + plan.components; ++c)
            for (std::size_t i = 0; i < kTilePoints; ++i)
                if (mask[i >> 6] >> (i & 63) & 1) largest = std::max(largest, std::abs(tile.channel(c)[i]));
    };
    for (std::size_t leaf = 0; leaf < store.leafCount(); ++leaf)
        for (int t = 0; t < store.tileCount(); ++t)
            if (const Tile* tile = store.tile(leaf, t)) take(*tile);
    for (const auto& [key, tile] : store.extension()) take(tile);
    return largest;
}

// Half floats end at 65504 and lose digits below 6.1e-5. Both ends are half floats, so that rounding a value
// doesn't move it across.
bool fitsHalf(float largest) {
    return largest == 0 || (largest <= 65504.0f && largest >= 0x1.04p-14f);
}

// Which plans are written in half floats: those asked for that fit.
std::vector<bool> choosePrecision(const std::vector<OutputField>& fields, const BrickStore& store,
                                  const VdbWriteOptions& options, VdbWriteResult& result) {
    const std::vector<GridPlan> plans = planGrids(fields);
    if (!options.halfFloat) return std::vector<bool>(plans.size(), false);
    const std::vector<bool> toHalf = gridsInHalf(fields, store);
    for (std::size_t p = 0; p < plans.size(); ++p) {
        if (toHalf[p]) continue;
        result.notes.push_back("grid " + plans[p].name +
                               " is written in full floats: its largest magnitude " +
                               exactText(double(largestMagnitude(store, plans[p]))) +
                               " is outside what half floats hold (6.2e-05 to 65504)");
    }
    return toHalf;
}

void describeGrid(openvdb::GridBase& grid, const std::string& name, const BrickTree& tree, int level,
                  double unitScale, const VdbWriteOptions& options) {
    grid.setName(name);
    grid.setTransform(makeTransform(tree, level, unitScale, options));
    grid.insertMeta("tessera_spacing", openvdb::StringMetadata(exactText(tree.spacingWorld(level))));
    grid.insertMeta("tessera_unit_scale", openvdb::StringMetadata(exactText(unitScale)));
}

// Grids in the order of the file: field by field, each with its finest level first, the coverage, the
// surface. `flatLevel` is what the level is called of the bricks that a flat grid was made of.
openvdb::GridPtrVec finishGrids(const std::vector<LevelGrids>& levels, const std::vector<GridPlan>& plans,
                                const BrickTree& tree, const VdbWriteOptions& options, double unitScale,
                                int flatLevel) {
    openvdb::GridPtrVec ordered;
    for (std::size_t p = 0; p < levels.front().builders.size(); ++p) {
        const bool isField = p < plans.size();
        for (const LevelGrids& grids : levels) {
            openvdb::GridBase& grid = *grids.builders[p]->grid();
            const std::string base = isField ? plans[p].name : p == plans.size() ? "coverage" : "surface";
            describeGrid(grid, gridName(base, options.layout, grids.level), tree, grids.level, unitScale,
                         options);
            grid.insertMeta("tessera_level", openvdb::Int32Metadata(grids.level + flatLevel));
            grid.insertMeta("tessera_field", openvdb::StringMetadata(isField ? plans[p].field : ""));
            if (isField)
                grid.setGridClass(plans[p].components == 1 ? openvdb::GRID_FOG_VOLUME
                                                           : openvdb::GRID_UNKNOWN);
            if (isField && plans[p].components == 3) grid.setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
            grids.builders[p]->describe();
            ordered.push_back(grids.builders[p]->grid());
        }
    }
    return ordered;
}

// OpenVDB's File hides failed writes, and its Archive compresses all leaf nodes to learn their sizes before
// it compresses them to be written. This one writes to a stream of ours what grids bring.
class StreamArchive : public openvdb::io::Archive {
  public:
    StreamArchive() { setCompression(kVdbCompression); }
    void writeTo(std::ostream& stream, const openvdb::GridPtrVec& grids,
                 const openvdb::MetaMap& metadata) const {
        writeHeader(stream, true);
        metadata.writeMeta(stream);
        const auto count = openvdb::Int32(grids.size());
        stream.write(reinterpret_cast<const char*>(&count), sizeof count);
        for (const openvdb::GridBase::Ptr& grid : grids) writeGrid(stream, *grid);
    }

  private:
    void writeGrid(std::ostream& stream, const openvdb::GridBase& grid) const {
        openvdb::io::GridDescriptor place(grid.getName(), grid.type(), grid.saveFloatAsHalf());
        place.writeHeader(stream);
        const std::streampos placesAt = stream.tellp();
        place.writeStreamPos(stream);
        place.setGridPos(stream.tellp());
        setGridCompression(stream, grid);
        grid.writeMeta(stream);
        grid.writeTransform(stream);
        grid.writeTopology(stream);
        place.setBlockPos(stream.tellp());
        grid.writeBuffers(stream);
        place.setEndPos(stream.tellp());
        stream.seekp(placesAt);
        place.writeStreamPos(stream);
        place.seekToEnd(stream);
    }
};

// OpenVDB draws a random UUID for every file. Ours is the digest of all other bytes: equal content gives
// equal files, and a reader can tell whether a file is damaged before it trusts it.
void stampDigest(AtomicFile& file, const Execution& execution) {
    std::array<char, kUuidBytes> blank;
    blank.fill('0');
    file.writeAt(kUuidOffset, blank.data(), blank.size());
    FileDigest digest;
    std::vector<char> bytes(std::size_t(1) << 20);
    for (std::int64_t offset = 0; offset < file.size();) {
        execution.throwIfCancelled();
        const std::size_t got = file.readAt(offset, bytes.data(), bytes.size());
        if (got == 0) throw IoError("can't read " + file.temporaryPath() + " back: it ends early");
        digest.update(bytes.data(), got);
        offset += std::int64_t(got);
    }
    const std::string uuid = digest.uuid();
    file.writeAt(kUuidOffset, uuid.data(), uuid.size());
}

void writeFile(AtomicFile& file, const openvdb::GridPtrVec& grids,
               const std::map<std::string, std::string>& entries, const Execution& execution) {
    openvdb::MetaMap metadata;
    for (const auto& [key, value] : entries) metadata.insertMeta(key, openvdb::StringMetadata(value));
    metadata.insertMeta("creator", openvdb::StringMetadata("Tessera " + entries.at("tessera_version")));
    AtomicFileBuffer buffer(file, execution);
    std::ostream stream(&buffer);
    stream.exceptions(std::ios_base::badbit | std::ios_base::failbit);
    try {
        StreamArchive().writeTo(stream, grids, metadata);
        stream.flush();
    } catch (const openvdb::Exception& error) {
        throw IoError("can't write " + file.path() + ": " + error.what());
    }
    stampDigest(file, execution);
}

/// How far the file's transform puts the furthest sample from its place, in finest voxels. OpenVDB takes the
/// spacing of a transform that isn't turned as a difference of places, which far from the origin is rounded.
double placeErrorVoxels(const BrickTree& tree, const VdbWriteOptions& options, double unitScale) {
    if (options.upAxis != UpAxis::keep) return 0;
    const double spacing = tree.spacingWorld(0) * unitScale;
    double worst = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double origin = gridOriginWorld(tree, 0, options.voxelShift)[axis] * unitScale;
        double furthest = 1;
        for (const BrickKey& leaf : tree.leaves())
            furthest = std::max(furthest,
                                std::ldexp(std::abs(leaf.index[axis]) + 1.0, leaf.level) * tree.brickCells());
        const double error = std::abs((origin + spacing) - origin - spacing) / spacing;
        worst = std::max(worst, error >= 0.5 ? kLost : error * furthest);
    }
    return worst;
}

void checkPlace(const BrickTree& tree, const VdbWriteOptions& options, VdbWriteResult& result) {
    const double error = placeErrorVoxels(tree, options, result.unitScale);
    const std::string far = "voxels of " + exactText(tree.spacingWorld(0)) + " units are so small beside " +
                            "the distance from the origin that ";
    if (error == kLost) throw InputError(far + "OpenVDB can't tell one from the next: move the mesh");
    if (error > 0.01)
        result.notes.push_back(far + "the file's transforms are off by up to " +
                               exactText(std::round(100 * error) / 100) +
                               " voxels; tessera_bricks in a .vdb file is exact");
}

void chooseUnit(const BrickTree& tree, const VdbWriteOptions& options, VdbWriteResult& result) {
    result.unitScale = chooseUnitScale(tree.spacingWorld(0), options.unitScale);
    if (options.unitScale == 0 && result.unitScale != 1) {
        result.notes.push_back("the finest voxel, " + exactText(tree.spacingWorld(0)) +
                               " units, is smaller than OpenVDB takes: the file's unit is 1/" +
                               exactText(result.unitScale) +
                               " of the mesh's (tessera_unit_scale in a .vdb file)");
    }
    checkPlace(tree, options, result);
}

// Of the samples as the file will have them; none unless they are asked for.
std::optional<BrickStatistics> statisticsOf(const std::vector<OutputField>& fields, BrickResult& result,
                                            const VdbWriteOptions& options, const Execution& execution) {
    if (!options.brickStatistics) return std::nullopt;
    TESSERA_CHECK(options.layout == VdbLayout::levels, "a flat grid's bricks aren't those of the file");
    if (options.halfFloat) roundToHalf(fields, gridsInHalf(fields, result.store), result.store, execution);
    BrickStatistics statistics = measureStatistics(fields, result.store, execution);
    for (std::size_t leaf = 0; leaf < result.leafErrors.size(); ++leaf)
        statistics.errors[leaf] = float(result.leafErrors[leaf]);
    return statistics;
}

// The grids of a file, in its order; frees the store's tiles.
openvdb::GridPtrVec makeGrids(const std::vector<OutputField>& fields, LeafForm form, BrickResult& result,
                              const VdbWriteOptions& options, VdbWriteResult& written,
                              const Execution& execution) {
    checkOutputFields(fields, !result.store.surface().empty());
    TESSERA_CHECK((options.layout == VdbLayout::flat) == result.bricks.has_value(),
                  "a flat grid is made by flatten");
    chooseUnit(result.tree, options, written);
    openvdb::initialize();
    const std::vector<GridPlan> plans = planGrids(fields);
    for (const GridPlan& plan : plans)
        TESSERA_CHECK(plan.firstChannel + plan.components <= result.store.channels(),
                      "a field's channels are in the store");
    const std::vector<bool> toHalf = choosePrecision(fields, result.store, options, written);
    const std::vector<LevelGrids> levels =
        buildGrids(plans, toHalf, form, result, options, written.unitScale, execution);
    return finishGrids(levels, plans, result.tree, options, written.unitScale, result.flatLevel);
}

}  // namespace

std::vector<bool> gridsInHalf(const std::vector<OutputField>& fields, const BrickStore& store) {
    std::vector<bool> toHalf;
    for (const GridPlan& plan : planGrids(fields)) toHalf.push_back(fitsHalf(largestMagnitude(store, plan)));
    return toHalf;
}

void roundToHalf(const std::vector<OutputField>& fields, const std::vector<bool>& toHalf, BrickStore& store,
                 const Execution& execution) {
    const std::vector<GridPlan> plans = planGrids(fields);
    std::vector<int> channels;
    for (std::size_t p = 0; p < plans.size(); ++p)
        for (int c = 0; toHalf[p] && c < plans[p].components; ++c)
            channels.push_back(plans[p].firstChannel + c);
    const auto round = [&](Tile& tile) {
        for (const int c : channels) {
            float* values = tile.values.get() + std::size_t(c) * kTilePoints;
            for (std::size_t i = 0; i < kTilePoints; ++i)
                values[i] = openvdb::io::RealToHalf<float>::convert(values[i]);
        }
    };
    parallelFor(execution, std::int64_t(store.leafCount()), [&](std::int64_t leaf) {
        for (int t = 0; t < store.tileCount(); ++t)
            if (Tile* tile = store.tile(std::size_t(leaf), t)) round(*tile);
    });
    for (auto& [key, tile] : store.extension()) round(tile);
}

VdbWriteResult writeVdb(const std::string& path, const std::vector<OutputField>& fields, BrickResult& result,
                        const VdbWriteOptions& options, const Execution& execution) {
    VdbWriteResult written;
    AtomicFile file(path);
    // Making the grids frees the samples.
    std::optional<BrickStatistics> statistics = statisticsOf(fields, result, options, execution);
    const openvdb::GridPtrVec grids =
        makeGrids(fields, LeafForm::packed, result, options, written, execution);
    for (const openvdb::GridBase::Ptr& grid : grids)
        written.activeVoxels += std::int64_t(grid->activeVoxelCount());
    VdbMetadata metadata = describeFile(fields, result, options, written.unitScale);
    metadata.statistics = std::move(statistics);
    writeFile(file, grids, encodeMetadata(metadata), execution);
    written.fileBytes = file.size();
    file.commit(execution);
    return written;
}

openvdb::GridPtrVec buildVdbGrids(const std::vector<OutputField>& fields, BrickResult& result,
                                  const VdbWriteOptions& options, VdbWriteResult& written,
                                  const Execution& execution) {
    return makeGrids(fields, LeafForm::plain, result, options, written, execution);
}

}  // namespace tessera
