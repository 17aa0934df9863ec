#include "vdb/vdb_read.h"

#include <openvdb/io/File.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <new>
#include <string_view>
#include <unordered_set>
#include <utility>

#include "base/floor_div.h"
#include "base/text.h"
#include "brick/surface_distance.h"
#include "files/file_digest.h"
#include "files/input_file.h"
#include "refine/refine_options.h"
#include "tessera/error.h"
#include "vdb/openvdb_grids.h"
#include "vdb/vdb_metadata.h"

namespace tessera {
namespace {

constexpr std::size_t kHeaderBytes = kUuidOffset + kUuidBytes;
constexpr std::array<char, 8> kMagic{' ', 'B', 'D', 'V', 0, 0, 0, 0};

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
    throw InputError(path + ": " + why);
}

// Throws when the bytes claim to be those that a Tessera wrote but aren't: that tells damage, and says
// nothing of whether they are safe to read.
void checkBytes(const std::string& path) {
    InputFile file(path);
    std::string head(file.bytesFrom(0, kHeaderBytes).substr(0, kHeaderBytes));
    if (head.starts_with("NanoVDB")) refuse(path, "is a NanoVDB file; tessera reads .vdb files");
    if (head.size() < kHeaderBytes || std::memcmp(head.data(), kMagic.data(), kMagic.size()) != 0)
        refuse(path, "not a VDB file");
    const std::string uuid = head.substr(kUuidOffset);
    if (!isDigestUuid(uuid)) return;
    head.replace(kUuidOffset, kUuidBytes, kUuidBytes, '0');
    FileDigest digest;
    digest.update(head.data(), head.size());
    for (std::size_t at = head.size(); at < file.size();) {
        const std::string_view piece = file.bytesFrom(at);
        digest.update(piece.data(), piece.size());
        at += piece.size();
    }
    if (digest.uuid() != uuid)
        refuse(path, "the file is damaged or incomplete: its bytes don't match its digest");
}

template <class Read>
auto guarded(const std::string& path, const Read& read) {
    try {
        checkBytes(path);
        return read();
    } catch (const openvdb::Exception& error) {
        refuse(path, std::string("OpenVDB can't read it: ") + error.what());
    } catch (const InputError&) {
        throw;
    } catch (const IoError&) {
        throw;
    } catch (const InternalError&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& error) {
        refuse(path, std::string("the file is damaged: ") + error.what());
    }
}

std::map<std::string, std::string> textEntries(const openvdb::MetaMap& metadata) {
    std::map<std::string, std::string> entries;
    for (auto it = metadata.beginMeta(); it != metadata.endMeta(); ++it) {
        if (it->second && it->second->typeName() == openvdb::StringMetadata::staticTypeName())
            entries[it->first] = it->second->str();
    }
    return entries;
}

template <class Grid>
typename Grid::Ptr readTypedGrid(openvdb::io::File& file, const std::string& name) {
    if (!file.hasGrid(name)) throw InputError("there is no grid " + name);
    const typename Grid::Ptr grid = openvdb::gridPtrCast<Grid>(file.readGrid(name));
    if (!grid)
        throw InputError("grid " + name + " holds other values than its name and the file's description say");
    return grid;
}

// Calls visit(leaf, tile position in the leaf, lattice index of its first point) for every tile of one level.
template <class Visit>
void forEachTilePlace(const BrickTree& tree, int tilesPerEdge, int level, const Visit& visit) {
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        const BrickKey& key = tree.leaves()[leaf];
        if (key.level != level) continue;
        const Vec3i first = tree.ownedPoints(key).min;
        int tile = 0;
        for (int x = 0; x < tilesPerEdge; ++x)
            for (int y = 0; y < tilesPerEdge; ++y)
                for (int z = 0; z < tilesPerEdge; ++z, ++tile)
                    visit(leaf, tile, first + Vec3i(x, y, z) * kTileSize);
    }
}

openvdb::Coord pointOf(const Vec3i& origin, int offset) {
    return {origin.x + (offset >> 6), origin.y + (offset >> 3 & 7), origin.z + (offset & 7)};
}

using Words = std::array<std::uint64_t, 8>;

template <class Node>
Words activeWords(const Node& node) {
    Words words;
    for (openvdb::Index w = 0; w < 8; ++w)
        words[w] = node.getValueMask().template getWord<openvdb::Index64>(w);
    return words;
}

// The active points among 8^3.
template <class Accessor>
Words activeWords(Accessor& accessor, const Vec3i& origin) {
    const openvdb::Coord first = pointOf(origin, 0);
    if (const auto* node = accessor.probeConstLeaf(first)) return activeWords(*node);
    Words words{};
    // Another program merged the leaf node into a tile of its parent.
    if (accessor.isValueOn(first)) words.fill(~std::uint64_t(0));
    return words;
}

void readCoverage(const openvdb::BoolGrid& grid, int level, VdbFile& file) {
    openvdb::BoolGrid::ConstAccessor accessor = grid.getConstAccessor();
    std::uint64_t found = 0;
    forEachTilePlace(file.tree, file.store.tilesPerEdge(), level,
                     [&](std::size_t leaf, int tile, const Vec3i& origin) {
                         const Words words = activeWords(accessor, origin);
                         std::uint64_t count = 0;
                         for (std::uint64_t word : words) count += std::uint64_t(std::popcount(word));
                         if (count > 0) file.store.ensureTile(leaf, tile).coverage = words;
                         found += count;
                     });
    if (found != grid.activeVoxelCount())
        throw InputError("grid " + grid.getName() + " covers points outside the bricks of its level");
}

template <class Grid, class Put>
void readValues(const Grid& grid, int level, VdbFile& file, const Put& put) {
    typename Grid::ConstAccessor accessor = grid.getConstAccessor();
    forEachTilePlace(file.tree, file.store.tilesPerEdge(), level,
                     [&](std::size_t leaf, int tile, const Vec3i& origin) {
                         Tile* stored = file.store.tile(leaf, tile);
                         if (!stored) return;
                         for (int offset = 0; offset < kTilePoints; ++offset) {
                             if (!stored->covered(offset)) continue;
                             typename Grid::ValueType value;
                             const bool valid = accessor.probeValue(pointOf(origin, offset), value);
                             put(*stored, offset, valid, value);
                         }
                     });
}

// Active points of a value grid that lie outside the mesh, in the bricks and beside them.
template <class Grid, class Put>
void readExtension(const Grid& grid, int level, VdbFile& file, const Put& put) {
    typename Grid::ConstAccessor accessor = grid.getConstAccessor();
    const int n = file.store.tilesPerEdge();
    constexpr float kInvalid = std::numeric_limits<float>::quiet_NaN();
    const std::size_t values = std::size_t(file.store.channels()) * kTilePoints;
    const auto take = [&](const Vec3i& origin, Words words, const Tile* covered) {
        for (std::size_t w = 0; covered && w < 8; ++w) words[w] &= ~covered->coverage[w];
        if (words == Words{}) return;
        Tile& tile = file.store.extension()[{level, floorDiv(origin, kTileSize)}];
        if (!tile.values) {
            tile.values = std::make_unique<float[]>(values);
            std::fill_n(tile.values.get(), values, kInvalid);
        }
        for (int offset = 0; offset < kTilePoints; ++offset) {
            if (!((words[std::size_t(offset >> 6)] >> (offset & 63)) & 1)) continue;
            tile.cover(offset);
            put(tile, offset, true, accessor.getValue(pointOf(origin, offset)));
        }
    };
    forEachTilePlace(file.tree, n, level, [&](std::size_t leaf, int t, const Vec3i& origin) {
        take(origin, activeWords(accessor, origin), file.store.tile(leaf, t));
    });
    for (auto node = grid.tree().cbeginLeaf(); node; ++node) {
        const openvdb::Coord& o = node->origin();
        const Vec3i origin(o.x(), o.y(), o.z());
        if (file.tree.findLeaf({level, floorDiv(origin, file.tree.brickCells())}) < 0)
            take(origin, activeWords(*node), nullptr);
        for (auto off = node->cbeginValueOff(); off; ++off) file.strayValues += *off != grid.background();
    }
}

// Notes a grid that stands elsewhere than the description says, or has another background.
void checkFrame(const openvdb::GridBase& grid, int level, VdbFile& file) {
    const double h = file.tree.spacingWorld(level) * file.unitScale;
    const Vec3d origin = file.tree.originWorld() * file.unitScale + file.voxelShift * h;
    const double far = std::max({std::abs(origin.x), std::abs(origin.y), std::abs(origin.z)});
    // Steps are differences of places, so they carry the rounding of the origin.
    const double slack = 1e-9 * h + 1e-15 * (far + h);
    const openvdb::Vec3d first = grid.transform().indexToWorld(openvdb::Vec3d(0.0));
    bool fits = (first - turned(openvdb::Vec3d(origin.x, origin.y, origin.z), file.upAxis)).length() <= slack;
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d index(0.0);
        index[axis] = 1;
        const openvdb::Vec3d found = grid.transform().indexToWorld(index) - first;
        fits = fits && (found - turned(index * h, file.upAxis)).length() <= slack;
    }
    if (!fits)
        file.gridProblems.push_back("grid " + grid.getName() +
                                    " stands elsewhere than the file's description says");
}

void checkBackground(double found, const openvdb::GridBase& grid, VdbFile& file) {
    const double expected = double(file.background);
    const double rounding = grid.saveFloatAsHalf() ? 0x1p-10 * std::abs(expected) + 0x1p-24 : 0;
    if (!(std::abs(found - expected) <= rounding))
        file.gridProblems.push_back("grid " + grid.getName() + " has another background than the file says");
}

void readSurface(openvdb::io::File& source, int level, VdbFile& file) {
    const std::string name = gridName("surface", file.layout, level);
    if (!source.hasGrid(name)) return;
    const auto grid = readTypedGrid<openvdb::FloatGrid>(source, name);
    checkFrame(*grid, level, file);
    const double voxel = file.tree.spacingWorld(level) * file.unitScale;
    for (auto node = grid->tree().cbeginLeaf(); node; ++node) {
        const openvdb::Coord& o = node->origin();
        Tile& tile = file.store.surface()[{level, floorDiv(Vec3i(o.x(), o.y(), o.z()), kTileSize)}];
        tile.coverage = activeWords(*node);
        tile.values = std::make_unique<float[]>(kTilePoints);
        for (int i = 0; i < kTilePoints; ++i) {
            if (!tile.covered(i)) continue;
            const double distance = -double(node->getValue(openvdb::Index(i))) / voxel;
            if (!(std::abs(distance) <= kFarFromSurface * (1 + 1e-6)))
                throw InputError("grid " + name + " has a distance of more than " +
                                 exactText(kFarFromSurface) + " voxels");
            tile.values[std::size_t(i)] = float(distance);
        }
    }
}

void readLevelGrids(openvdb::io::File& source, int level, VdbFile& file) {
    const auto coverage = readTypedGrid<openvdb::BoolGrid>(source, gridName("coverage", file.layout, level));
    checkFrame(*coverage, level, file);
    readCoverage(*coverage, level, file);
    constexpr float kInvalid = std::numeric_limits<float>::quiet_NaN();
    for (const GridPlan& plan : planGrids(file.fields)) {
        const std::string name = gridName(plan.name, file.layout, level);
        const auto at = [&](Tile& tile, int c, int offset) -> float& {
            return tile.values[std::size_t(plan.firstChannel + c) * kTilePoints + std::size_t(offset)];
        };
        if (plan.components == 3) {
            const auto grid = readTypedGrid<openvdb::Vec3SGrid>(source, name);
            checkFrame(*grid, level, file);
            for (int c = 0; c < 3; ++c) checkBackground(double(grid->background()[c]), *grid, file);
            const auto put = [&](Tile& tile, int offset, bool valid, const openvdb::Vec3f& stored) {
                const openvdb::Vec3f value = turnedBack(stored, file.upAxis);
                for (int c = 0; c < 3; ++c) at(tile, c, offset) = valid ? value[c] : kInvalid;
            };
            readValues(*grid, level, file, put);
            readExtension(*grid, level, file, put);
        } else {
            const auto grid = readTypedGrid<openvdb::FloatGrid>(source, name);
            checkFrame(*grid, level, file);
            checkBackground(double(grid->background()), *grid, file);
            const auto put = [&](Tile& tile, int offset, bool valid, float value) {
                at(tile, 0, offset) = valid ? value : kInvalid;
            };
            readValues(*grid, level, file, put);
            readExtension(*grid, level, file, put);
        }
    }
    if (file.layout == VdbLayout::levels && file.layers > 0) readSurface(source, level, file);
}

// Adds the bricks that hold an active point of a grid.
template <class Grid>
void listBricks(const Grid& grid, int brickCells, std::unordered_set<BrickKey, BrickKeyHash>& keys) {
    const auto brickOf = [&](const openvdb::Coord& c) {
        return floorDiv(Vec3i(c.x(), c.y(), c.z()), brickCells);
    };
    for (auto node = grid.tree().cbeginLeaf(); node; ++node)
        if (!node->isEmpty()) keys.insert({0, brickOf(node->origin())});
    auto tile = grid.cbeginValueOn();
    tile.setMaxDepth(tile.getLeafDepth() - 1);
    for (; tile; ++tile) {
        const openvdb::CoordBBox box = tile.getBoundingBox();
        if (box.dim().x() > 128)
            throw InputError("grid " + grid.getName() + " has active tiles of " +
                             std::to_string(box.dim().x()) +
                             " voxels along an edge, which Tessera doesn't write");
        const Vec3i low = brickOf(box.min()), high = brickOf(box.max());
        for (int z = low.z; z <= high.z; ++z)
            for (int y = low.y; y <= high.y; ++y)
                for (int x = low.x; x <= high.x; ++x) keys.insert({0, {x, y, z}});
    }
}

// The grid of a flat file as bricks of one level.
BrickTree flatTree(openvdb::io::File& source, const VdbFile& file) {
    std::unordered_set<BrickKey, BrickKeyHash> keys;
    const int b = file.tree.brickCells();
    listBricks(*readTypedGrid<openvdb::BoolGrid>(source, "coverage"), b, keys);
    for (const GridPlan& plan : planGrids(file.fields)) {
        if (plan.components == 3)
            listBricks(*readTypedGrid<openvdb::Vec3SGrid>(source, plan.name), b, keys);
        else
            listBricks(*readTypedGrid<openvdb::FloatGrid>(source, plan.name), b, keys);
    }
    return BrickTree(file.tree.originWorld(), file.tree.spacingWorld(file.flatLevel), b,
                     {keys.begin(), keys.end()});
}

void listGrids(openvdb::io::File& source, VdbFile& file) {
    const openvdb::GridPtrVecPtr grids = source.readAllGridMetadata();
    for (const openvdb::GridBase::Ptr& grid : *grids) {
        file.gridNames.push_back(grid->getName());
        const auto count =
            grid->getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT);
        file.gridVoxels.push_back(count ? count->value()
                                        : std::int64_t(source.readGrid(grid->getName())->activeVoxelCount()));
    }
}

VdbFile readWhole(const std::string& path) {
    openvdb::io::File source(path);
    source.open(/*delayLoad=*/false);
    VdbFile file;
    try {
        file = decodeMetadata(textEntries(*source.getMetadata()));
        listGrids(source, file);
        if (file.layout == VdbLayout::flat) {
            BrickTree grid = flatTree(source, file);
            file.bricks = std::exchange(file.tree, std::move(grid));
        }
        int channels = 0;
        for (const OutputField& field : file.fields) channels += field.components;
        file.store = BrickStore(file.tree.brickCells(), file.tree.leafCount(), channels);
        std::vector<bool> present(std::size_t(file.tree.levelCount()), false);
        for (const BrickKey& key : file.tree.leaves()) present[std::size_t(key.level)] = true;
        for (int level = 0; level < file.tree.levelCount(); ++level) {
            if (present[std::size_t(level)]) readLevelGrids(source, level, file);
        }
    } catch (const InputError& error) {
        refuse(path, error.what());
    }
    return file;
}

FixedFrame frameOfGrid(const std::string& path, const openvdb::GridBase& grid) {
    const openvdb::math::Transform& transform = grid.transform();
    const std::string name = "grid " + grid.getName();
    if (!transform.isLinear()) refuse(path, name + " has a perspective transform, not a lattice of cubes");
    const openvdb::Vec3d origin = transform.indexToWorld(openvdb::Vec3d(0, 0, 0));
    openvdb::Mat3d steps;
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d unit(0, 0, 0);
        unit[axis] = 1;
        steps.setCol(axis, transform.indexToWorld(unit) - origin);
    }
    const double spacing = transform.voxelSize().x();
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            const double expected = row == column ? spacing : 0.0;
            // The steps are differences of places, so they carry the rounding of the origin.
            const double slack = 1e-9 * spacing + 4e-16 * (std::abs(origin[row]) + spacing);
            if (!(std::abs(steps(row, column) - expected) <= slack))
                refuse(
                    path,
                    name + " is turned or its voxels aren't cubes, so no lattice of bricks can be like it");
        }
    }
    return {{origin.x(), origin.y(), origin.z()}, spacing};
}

FixedFrame readFrame(const std::string& path) {
    openvdb::io::File source(path);
    source.open(/*delayLoad=*/false);
    const auto entries = textEntries(*source.getMetadata());
    if (entries.count("tessera_format")) {
        try {
            const VdbMetadata metadata = decodeMetadata(entries);
            return {metadata.tree.originWorld(), metadata.tree.spacingWorld(0)};
        } catch (const InputError& error) {
            refuse(path, error.what());
        }
    }
    const openvdb::GridPtrVecPtr grids = source.readAllGridMetadata();
    if (grids->empty()) refuse(path, "it holds no grid");
    return frameOfGrid(path, *grids->front());
}

}  // namespace

VdbFile readVdb(const std::string& path) {
    openvdb::initialize();
    return guarded(path, [&] { return readWhole(path); });
}

FixedFrame readVdbLattice(const std::string& path) {
    openvdb::initialize();
    return guarded(path, [&] { return readFrame(path); });
}

}  // namespace tessera
