#include <openvdb/io/Archive.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <future>
#include <limits>
#include <map>
#include <ostream>
#include <set>
#include <span>
#include <sstream>
#include <streambuf>
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
    Tile* samples = nullptr;
    Tile* extension = nullptr;
    Tile* surface = nullptr;
};

bool areFinite(const float* values) {
    constexpr std::uint32_t kExponent = 0x7f800000;  // all ones: infinite or no number
    std::uint32_t other = 0;
    for (std::size_t i = 0; i < kTilePoints; ++i)
        other |= std::uint32_t((std::bit_cast<std::uint32_t>(values[i]) & kExponent) == kExponent);
    return other == 0;
}

using TileMask = std::array<std::uint64_t, 8>;

// Bits of a tile where all given channels are finite.
TileMask finiteMask(const Tile& tile, int firstChannel, int components) {
    TileMask mask = tile.coverage;
    for (int c = firstChannel; c < firstChannel + components; ++c) {
        const float* values = tile.channel(c);
        if (areFinite(values)) continue;
        for (std::size_t w = 0; w < 8; ++w) {
            std::uint64_t finite = 0;
            for (std::size_t b = 0; b < 64; ++b)
                finite |= std::uint64_t(std::isfinite(values[w * 64 + b])) << b;
            mask[w] &= finite;
        }
    }
    return mask;
}

bool isFull(const TileMask& mask) {
    return std::all_of(mask.begin(), mask.end(), [](std::uint64_t word) { return ~word == 0; });
}

template <class Visit>
void forEachIn(const TileMask& mask, const Visit& visit) {
    if (isFull(mask)) {
        for (std::size_t i = 0; i < kTilePoints; ++i) visit(i);
        return;
    }
    for (std::size_t w = 0; w < 8; ++w)
        for (std::uint64_t bits = mask[w]; bits != 0; bits &= bits - 1)
            visit(w * 64 + std::size_t(std::countr_zero(bits)));
}

template <class Leaf>
void setMask(Leaf& leaf, const TileMask& words) {
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
    // Makes the leaf node of a tile of a batch; may be called for several at once. Packed values may take the
    // place of the tile's own.
    virtual void makeLeaf(std::size_t position, const GridTile& tile, LeafPacker& packer) = 0;
    // Puts the leaf nodes made since into the tree.
    virtual void addLeaves() = 0;
    virtual openvdb::GridBase::Ptr grid() const = 0;
    // Adds what depends on all leaf nodes. Once, when they are complete.
    virtual void describe() = 0;
};

template <class Grid>
class ValueBuilder : public GridBuilder {
  public:
    using Leaf = typename Grid::TreeType::LeafNodeType;
    using Value = typename Grid::ValueType;
    ValueBuilder(LeafForm form, const Value& background, bool toHalf)
        : form_(form), toHalf_(toHalf), grid_(std::make_shared<PackedGrid<Grid>>(background)) {
        grid_->setSaveFloatAsHalf(toHalf);
    }

    void reserve(std::size_t tiles) override { made_.resize(tiles); }
    void makeLeaf(std::size_t position, const GridTile& tile, LeafPacker& packer) override {
        std::array<Value, kTilePoints> values;
        TileMask mask{};
        std::span<char> room;
        for (Tile* part : partsOf(tile)) {
            if (!part) continue;
            const TileMask filled = fill(values, *part);
            for (std::size_t w = 0; w < 8; ++w) mask[w] |= filled[w];
            if (room.empty()) room = roomIn(*part);
        }
        if (mask == TileMask{}) return;
        if (form_ == LeafForm::plain) {
            auto leaf = std::make_unique<Leaf>(coord(tile.origin), grid_->background());
            Value* stored = leaf->buffer().data();
            forEachIn(mask, [&](std::size_t i) { stored[i] = values[i]; });
            setMask(*leaf, mask);
            made_[position] = {std::move(leaf), PackedValues()};
            return;
        }
        auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), coord(tile.origin), grid_->background());
        setMask(*leaf, mask);
        std::size_t active = kTilePoints;
        if (!isFull(mask)) {
            active = 0;
            forEachIn(mask, [&](std::size_t i) { values[active++] = values[i]; });
        }
        made_[position] = {
            std::move(leaf),
            PackedValues(packer.pack(std::span<const Value>(values.data(), active), toHalf_), room)};
    }
    void addLeaves() override {
        for (auto& [leaf, values] : made_) {
            if (leaf && form_ == LeafForm::plain) grid_->tree().addLeaf(leaf.release());
            if (leaf) grid_->add(std::move(leaf), std::move(values));
        }
    }
    openvdb::GridBase::Ptr grid() const override { return grid_; }
    void describe() override {
        if (form_ == LeafForm::packed) grid_->describe();
    }

  protected:
    // Values of the tile at points of its leaf node; returns which.
    virtual TileMask fill(std::array<Value, kTilePoints>& values, const Tile& tile) const = 0;
    // Where in a tile the values stand that nothing else needs once they are packed.
    virtual std::span<char> roomIn(Tile& tile) const = 0;
    // Null: none.
    virtual std::array<Tile*, 2> partsOf(const GridTile& tile) const {
        return {tile.samples, tile.extension};
    }

  private:
    LeafForm form_;
    bool toHalf_;
    std::shared_ptr<PackedGrid<Grid>> grid_;
    std::vector<std::pair<std::unique_ptr<Leaf>, PackedValues>> made_;
};

std::span<char> roomOfChannels(Tile& tile, int firstChannel, int components) {
    float* values = tile.values.get() + std::size_t(firstChannel) * kTilePoints;
    return {reinterpret_cast<char*>(values), std::size_t(components) * kTilePoints * sizeof(float)};
}

class ScalarBuilder final : public ValueBuilder<openvdb::FloatGrid> {
  public:
    ScalarBuilder(LeafForm form, int channel, float background, bool toHalf)
        : ValueBuilder(form, background, toHalf), channel_(channel) {}

  private:
    TileMask fill(std::array<float, kTilePoints>& values, const Tile& tile) const override {
        const TileMask mask = finiteMask(tile, channel_, 1);
        const float* from = tile.channel(channel_);
        forEachIn(mask, [&](std::size_t i) { values[i] = from[i]; });
        return mask;
    }
    std::span<char> roomIn(Tile& tile) const override { return roomOfChannels(tile, channel_, 1); }

    int channel_;
};

class VectorBuilder final : public ValueBuilder<openvdb::Vec3SGrid> {
  public:
    VectorBuilder(LeafForm form, int channel, float background, bool toHalf, UpAxis upAxis)
        : ValueBuilder(form, openvdb::Vec3f(background), toHalf), channel_(channel), upAxis_(upAxis) {}

  private:
    TileMask fill(std::array<openvdb::Vec3f, kTilePoints>& values, const Tile& tile) const override {
        const TileMask mask = finiteMask(tile, channel_, 3);
        const float *x = tile.channel(channel_), *y = tile.channel(channel_ + 1),
                    *z = tile.channel(channel_ + 2);
        forEachIn(mask,
                  [&](std::size_t i) { values[i] = turned(openvdb::Vec3f(x[i], y[i], z[i]), upAxis_); });
        return mask;
    }
    std::span<char> roomIn(Tile& tile) const override { return roomOfChannels(tile, channel_, 3); }

    int channel_;
    UpAxis upAxis_;
};

class SurfaceBuilder final : public ValueBuilder<openvdb::FloatGrid> {
  public:
    explicit SurfaceBuilder(LeafForm form, double voxel)
        : ValueBuilder(form, float(kFarFromSurface * voxel), false), voxel_(voxel) {}

  private:
    TileMask fill(std::array<float, kTilePoints>& values, const Tile& tile) const override {
        const float* voxels = tile.channel(0);
        forEachIn(tile.coverage, [&](std::size_t i) { values[i] = float(-voxel_ * double(voxels[i])); });
        return tile.coverage;
    }
    std::span<char> roomIn(Tile& tile) const override { return roomOfChannels(tile, 0, 1); }
    std::array<Tile*, 2> partsOf(const GridTile& tile) const override { return {tile.surface, nullptr}; }

    double voxel_;  // in the file's unit
};

// Its leaf nodes are masks alone, in files too.
class CoverageBuilder final : public GridBuilder {
  public:
    explicit CoverageBuilder(LeafForm form)
        : form_(form),
          grid_(std::make_shared<openvdb::BoolGrid>(std::make_shared<openvdb::BoolTree>(false))) {
        grid_->setSaveFloatAsHalf(false);
    }

    void reserve(std::size_t tiles) override { made_.resize(tiles); }
    void makeLeaf(std::size_t position, const GridTile& tile, LeafPacker&) override {
        if (!tile.samples || tile.samples->empty()) return;
        made_[position] = std::make_unique<BoolLeaf>(coord(tile.origin), false);
        setMask(*made_[position], tile.samples->coverage);
        made_[position]->buffer() = BoolLeaf::Buffer(made_[position]->getValueMask());
    }
    void addLeaves() override {
        for (std::unique_ptr<BoolLeaf>& leaf : made_)
            if (leaf) grid_->tree().addLeaf(leaf.release());
    }
    openvdb::GridBase::Ptr grid() const override { return grid_; }
    void describe() override {
        if (form_ == LeafForm::packed) describeStored(*grid_);
    }

  private:
    LeafForm form_;
    std::shared_ptr<openvdb::BoolGrid> grid_;
    std::vector<std::unique_ptr<BoolLeaf>> made_;
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
        LeafPacker packer;
        for (std::size_t i = std::size_t(begin); i < std::size_t(end); ++i)
            for (auto& builder : grids.builders) builder->makeLeaf(i, tiles[i], packer);
    });
    parallelFor(execution, std::int64_t(grids.builders.size()),
                [&](std::int64_t b) { grids.builders[std::size_t(b)]->addLeaves(); });
}

Tile* partAt(TileMap& tiles, const TileKey& key) {
    const auto found = tiles.find(key);
    return found == tiles.end() ? nullptr : &found->second;
}

// The tiles of one level in batches. Packed leaf nodes may lie in them, plain ones leave nothing to keep.
void addLevel(LevelGrids& grids, LeafForm form, const BrickTree& tree, BrickStore& store,
              const Execution& execution) {
    constexpr std::size_t kBatchTiles = 4096;
    const int n = store.tilesPerEdge(), level = grids.level;
    std::vector<GridTile> tiles;
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        if (tree.leaves()[leaf].level != level) continue;
        const Vec3i first = tree.ownedPoints(tree.leaves()[leaf]).min;
        for (int t = 0; t < store.tileCount(); ++t) {
            Tile* tile = store.tile(leaf, t);
            if (!tile) continue;
            const Vec3i origin = first + Vec3i(t / (n * n), t / n % n, t % n) * kTileSize;
            const TileKey key{level, floorDiv(origin, kTileSize)};
            tiles.push_back({origin, tile, partAt(store.extension(), key), partAt(store.surface(), key)});
        }
    }
    // Tiles without samples.
    const auto hasSamples = [&](const Vec3i& tile) {
        const Vec3i brick = floorDiv(tile, n), local = tile - brick * n;
        const std::int64_t leaf = tree.findLeaf({level, brick});
        return leaf >= 0 && store.tile(std::size_t(leaf), (local.x * n + local.y) * n + local.z);
    };
    const std::size_t withSamples = tiles.size();
    for (auto& [key, tile] : store.extension())
        if (key.level == level && !hasSamples(key.index))
            tiles.push_back({key.index * kTileSize, nullptr, &tile, partAt(store.surface(), key)});
    for (auto& [key, tile] : store.surface())
        if (key.level == level && !hasSamples(key.index) && !partAt(store.extension(), key))
            tiles.push_back({key.index * kTileSize, nullptr, nullptr, &tile});
    std::sort(tiles.begin() + std::ptrdiff_t(withSamples), tiles.end(),
              [](const GridTile& a, const GridTile& b) {
                  const Vec3i &p = a.origin, &q = b.origin;
                  return std::tie(p.z, p.y, p.x) < std::tie(q.z, q.y, q.x);
              });
    for (std::size_t begin = 0; begin < tiles.size(); begin += kBatchTiles) {
        const std::size_t end = std::min(tiles.size(), begin + kBatchTiles);
        execution.report(Stage::writing, std::int64_t(begin), std::int64_t(tiles.size()));
        addTiles(grids, std::span(tiles).subspan(begin, end - begin), execution);
        for (std::size_t i = begin; i < end && form == LeafForm::plain; ++i)
            if (tiles[i].samples) *tiles[i].samples = Tile();
    }
}

// The levels that have grids, ascending: one at least.
std::vector<int> levelsOf(BrickResult& result) {
    std::set<int> levels;
    for (const BrickKey& key : result.tree.leaves()) levels.insert(key.level);
    for (const auto& [key, tile] : result.store.extension()) levels.insert(key.level);
    for (const auto& [key, tile] : result.store.surface()) levels.insert(key.level);
    if (levels.empty()) levels.insert(0);
    return {levels.begin(), levels.end()};
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

// Gives the grids of one level all that a file says of them. `flatLevel` is what the level is called of the
// bricks that a flat grid was made of.
void describeLevel(const LevelGrids& grids, const std::vector<GridPlan>& plans, const BrickTree& tree,
                   const VdbWriteOptions& options, double unitScale, int flatLevel) {
    for (std::size_t p = 0; p < grids.builders.size(); ++p) {
        const bool isField = p < plans.size();
        openvdb::GridBase& grid = *grids.builders[p]->grid();
        const std::string base = isField ? plans[p].name : p == plans.size() ? "coverage" : "surface";
        describeGrid(grid, gridName(base, options.layout, grids.level), tree, grids.level, unitScale,
                     options);
        grid.insertMeta("tessera_level", openvdb::Int32Metadata(grids.level + flatLevel));
        grid.insertMeta("tessera_field", openvdb::StringMetadata(isField ? plans[p].field : ""));
        if (isField)
            grid.setGridClass(plans[p].components == 1 ? openvdb::GRID_FOG_VOLUME : openvdb::GRID_UNKNOWN);
        if (isField && plans[p].components == 3) grid.setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
        grids.builders[p]->describe();
    }
}

// Counts what is written to it.
class CountingBuffer : public std::streambuf {
  public:
    std::int64_t count() const { return count_; }

  protected:
    std::streamsize xsputn(const char*, std::streamsize n) override {
        count_ += n;
        return n;
    }
    int_type overflow(int_type c) override {
        ++count_;
        return traits_type::not_eof(c);
    }
    pos_type seekoff(off_type, std::ios_base::seekdir, std::ios_base::openmode) override { return count_; }

  private:
    std::int64_t count_ = 0;
};

// OpenVDB's File hides failed writes, and its Archive compresses all leaf nodes to learn their sizes before
// it compresses them to be written. This one writes to a stream of ours what grids bring, from the first byte
// to the last.
class StreamArchive : public openvdb::io::Archive {
  public:
    StreamArchive() { setCompression(kVdbCompression); }
    void writeHead(std::ostream& stream, const openvdb::MetaMap& metadata, std::size_t gridCount) const {
        stream << headWithoutUuid();
        metadata.writeMeta(stream);
        const auto count = openvdb::Int32(gridCount);
        stream.write(reinterpret_cast<const char*>(&count), sizeof count);
    }
    void writeGrid(std::ostream& stream, const openvdb::GridBase& grid) const {
        const GridSizes sizes = measure(grid);
        openvdb::io::GridDescriptor place(grid.getName(), grid.type(), grid.saveFloatAsHalf());
        place.writeHeader(stream);
        const std::int64_t begin = std::int64_t(stream.tellp()) + 3 * std::int64_t(sizeof(std::int64_t));
        place.setGridPos(begin);
        place.setBlockPos(begin + sizes.topology);
        place.setEndPos(begin + sizes.topology + sizes.buffers);
        place.writeStreamPos(stream);
        writeTopology(stream, grid);
        grid.writeBuffers(stream);
        TESSERA_CHECK(std::int64_t(stream.tellp()) == place.getEndPos(), "a grid is as long as was counted");
    }

  private:
    // Bytes of a grid's parts in the file.
    struct GridSizes {
        std::int64_t topology = 0;  // and what precedes it
        std::int64_t buffers = 0;
    };

    // OpenVDB draws a random UUID for every file.
    std::string headWithoutUuid() const {
        std::ostringstream stream;
        writeHeader(stream, true);
        return stream.str().replace(kUuidOffset, kUuidBytes, kUuidBytes, '0');
    }

    void writeTopology(std::ostream& stream, const openvdb::GridBase& grid) const {
        setGridCompression(stream, grid);
        grid.writeMeta(stream);
        grid.writeTransform(stream);
        grid.writeTopology(stream);
    }

    GridSizes measure(const openvdb::GridBase& grid) const {
        CountingBuffer counter;
        std::ostream stream(&counter);
        writeTopology(stream, grid);
        const std::int64_t topology = counter.count();
        grid.writeBuffers(stream);
        return {topology, counter.count() - topology};
    }
};

// A file that is written grid by grid, while the next ones are made.
class GridStream {
  public:
    GridStream(AtomicFile& file, const std::map<std::string, std::string>& entries, std::size_t gridCount,
               const Execution& execution)
        : file_(file),
          policy_(AtomicFileBuffer::policyOf(execution)),
          buffer_(file, execution,
                  [this](std::span<const char> bytes) { digest_.update(bytes.data(), bytes.size()); }),
          stream_(&buffer_) {
        stream_.exceptions(std::ios_base::badbit | std::ios_base::failbit);
        openvdb::MetaMap metadata;
        for (const auto& [key, value] : entries) metadata.insertMeta(key, openvdb::StringMetadata(value));
        metadata.insertMeta("creator", openvdb::StringMetadata("Tessera " + entries.at("tessera_version")));
        archive_.writeHead(stream_, metadata, gridCount);
    }

    // Returns at once; the grid stays as it is until `finish`.
    void write(const openvdb::GridBase::Ptr& grid) {
        await();
        const auto writeGrid = [this, grid] { archive_.writeGrid(stream_, *grid); };
        writing_ = std::async(policy_, writeGrid);
    }

    // The file's UUID is the digest of all other bytes: equal content gives equal files, and a reader can
    // tell whether a file is damaged before it trusts it.
    void finish() {
        await();
        stream_.flush();
        const std::string uuid = digest_.uuid();
        file_.writeAt(kUuidOffset, uuid.data(), uuid.size());
    }

  private:
    void await() {
        if (!writing_.valid()) return;
        try {
            writing_.get();
        } catch (const openvdb::Exception& error) {
            throw IoError("can't write " + file_.path() + ": " + error.what());
        }
    }

    AtomicFile& file_;
    std::launch policy_;
    FileDigest digest_;
    AtomicFileBuffer buffer_;
    std::ostream stream_;
    StreamArchive archive_;
    std::future<void> writing_;
};

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

// How the grids of a file are made of samples.
struct GridsPlan {
    std::vector<GridPlan> plans;
    std::vector<bool> toHalf;
    std::vector<int> levels;
    bool hasSurface = false;

    std::size_t gridCount() const { return levels.size() * (plans.size() + 1 + hasSurface); }
};

// Checks what is to be written and chooses its unit.
GridsPlan planFile(const std::vector<OutputField>& fields, BrickResult& result,
                   const VdbWriteOptions& options, VdbWriteResult& written) {
    checkOutputFields(fields, !result.store.surface().empty());
    TESSERA_CHECK((options.layout == VdbLayout::flat) == result.bricks.has_value(),
                  "a flat grid is made by flatten");
    chooseUnit(result.tree, options, written);
    openvdb::initialize();
    const std::vector<GridPlan> plans = planGrids(fields);
    for (const GridPlan& plan : plans)
        TESSERA_CHECK(plan.firstChannel + plan.components <= result.store.channels(),
                      "a field's channels are in the store");
    return {plans, choosePrecision(fields, result.store, options, written), levelsOf(result),
            !result.store.surface().empty()};
}

// The grids in the order of the file: field by field, each with its finest level first, the coverage, the
// surface. Packed ones lie in the store's tiles; plain ones free them. `takeFirst` gets those of the first
// kind as soon as they are made.
openvdb::GridPtrVec makeGrids(const GridsPlan& plan, LeafForm form, BrickResult& result,
                              const VdbWriteOptions& options, double unitScale, const Execution& execution,
                              const std::function<void(const openvdb::GridBase::Ptr&)>& takeFirst) {
    std::vector<LevelGrids> levels;
    for (const int level : plan.levels) {
        const double voxel = plan.hasSurface ? result.tree.spacingWorld(level) * unitScale : 0;
        LevelGrids& grids =
            levels.emplace_back(makeBuilders(plan.plans, plan.toHalf, form, level, options, voxel));
        addLevel(grids, form, result.tree, result.store, execution);
        describeLevel(grids, plan.plans, result.tree, options, unitScale, result.flatLevel);
        takeFirst(grids.builders.front()->grid());
    }
    openvdb::GridPtrVec ordered;
    for (std::size_t p = 0; p < levels.front().builders.size(); ++p)
        for (const LevelGrids& grids : levels) ordered.push_back(grids.builders[p]->grid());
    return ordered;
}

void freeTiles(BrickStore& store, const Execution& execution) {
    parallelForChunks(execution, std::int64_t(store.leafCount()), 64,
                      [&](std::int64_t begin, std::int64_t end) {
                          for (auto leaf = std::size_t(begin); leaf < std::size_t(end); ++leaf)
                              for (int t = 0; t < store.tileCount(); ++t) store.release(leaf, t);
                      });
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
    // Making the grids destroys the samples.
    std::optional<BrickStatistics> statistics = statisticsOf(fields, result, options, execution);
    const GridsPlan plan = planFile(fields, result, options, written);
    VdbMetadata metadata = describeFile(fields, result, options, written.unitScale);
    metadata.statistics = std::move(statistics);
    GridStream stream(file, encodeMetadata(metadata), plan.gridCount(), execution);
    const openvdb::GridPtrVec grids =
        makeGrids(plan, LeafForm::packed, result, options, written.unitScale, execution,
                  [&](const openvdb::GridBase::Ptr& grid) { stream.write(grid); });
    for (std::size_t g = plan.levels.size(); g < grids.size(); ++g) stream.write(grids[g]);
    stream.finish();
    for (const openvdb::GridBase::Ptr& grid : grids)
        written.activeVoxels +=
            std::int64_t(grid->metaValue<openvdb::Int64>(openvdb::GridBase::META_FILE_VOXEL_COUNT));
    written.fileBytes = file.size();
    freeTiles(result.store, execution);
    file.commit(execution);  // the last step: nothing after it may be cancelled
    return written;
}

openvdb::GridPtrVec buildVdbGrids(const std::vector<OutputField>& fields, BrickResult& result,
                                  const VdbWriteOptions& options, VdbWriteResult& written,
                                  const Execution& execution) {
    const GridsPlan plan = planFile(fields, result, options, written);
    return makeGrids(plan, LeafForm::plain, result, options, written.unitScale, execution,
                     [](const openvdb::GridBase::Ptr&) {});
}

}  // namespace tessera
