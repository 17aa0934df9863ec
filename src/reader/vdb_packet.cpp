#include "reader/vdb_packet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <new>
#include <utility>

#include "base/parallel.h"
#include "brick/surface_distance.h"
#include "tessera/error.h"
#include "vdb/vdb_metadata.h"

namespace tessera {

namespace {

constexpr int kFurthestIndex = 1 << 30;  // of a lattice point
constexpr std::int64_t kTileGrain = 64;
constexpr int kMostChannels = 1 << 16;

using Words = std::array<std::uint64_t, 8>;

struct TilePlace {
    std::uint32_t leaf = 0;
    std::uint32_t tile = 0;  ///< in the leaf
    friend auto operator<=>(const TilePlace&, const TilePlace&) = default;
};

int channelsOf(const std::vector<OutputField>& fields) {
    int channels = 0;
    for (const OutputField& field : fields) channels += field.components;
    return channels;
}

/// The tiles that there are: the leaves', those of the extension, and the surface's of one channel, each in
/// one order.
struct TileList {
    std::vector<TilePlace> places;
    std::vector<TileKey> extension, surface;
    std::vector<Tile*> tiles, surfaceTiles;
};

void listTiles(TileMap& map, std::vector<TileKey>& keys, std::vector<Tile*>& tiles) {
    for (const auto& [key, tile] : map) keys.push_back(key);
    std::sort(keys.begin(), keys.end(), inStorageOrder);
    for (const TileKey& key : keys) tiles.push_back(&map.at(key));
}

TileList listTiles(BrickStore& store) {
    TileList list;
    for (std::size_t leaf = 0; leaf < store.leafCount(); ++leaf)
        for (int t = 0; t < store.tileCount(); ++t)
            if (Tile* tile = store.tile(leaf, t)) {
                list.places.push_back({std::uint32_t(leaf), std::uint32_t(t)});
                list.tiles.push_back(tile);
            }
    listTiles(store.extension(), list.extension, list.tiles);
    listTiles(store.surface(), list.surface, list.surfaceTiles);
    return list;
}

/// What a store's table takes, whatever its bricks hold.
std::int64_t tableBytes(std::size_t leafCount, int tileCount) {
    return std::int64_t(leafCount) * tileCount * std::int64_t(sizeof(Tile*));
}

template <class Item>
void give(const std::vector<Item>& items, const PacketSink& sink) {
    static_assert(std::is_trivially_copyable_v<Item> && sizeof(Item) % 8 == 0);
    if (!items.empty()) sink(items.data(), items.size() * sizeof(Item));
}

bool isEmpty(const Words& words) {
    return words == Words{};
}

bool isWithin(const Vec3i& index, int pointsPerStep) {
    const int limit = kFurthestIndex / pointsPerStep;
    return std::min({index.x, index.y, index.z}) >= -limit && std::max({index.x, index.y, index.z}) < limit;
}

VdbFile decode(const std::vector<std::string>& entries) {
    if (entries.size() % 2 != 0) throw DamagedPacket("its metadata isn't made of pairs");
    std::map<std::string, std::string> pairs;
    for (std::size_t i = 0; i < entries.size(); i += 2) pairs[entries[i]] = entries[i + 1];
    try {
        return decodeMetadata(pairs);
    } catch (const InputError& error) {
        throw DamagedPacket(error.what());
    }
}

BrickTree flatTree(const VdbFile& file, std::span<const BrickKey> keys) {
    for (const BrickKey& key : keys)
        if (key.level != 0 || !isWithin(key.index, file.tree.brickCells()))
            throw DamagedPacket("a brick is out of range");
    try {
        return {file.tree.originWorld(),
                file.tree.spacingWorld(file.flatLevel),
                file.tree.brickCells(),
                {keys.begin(), keys.end()}};
    } catch (const InternalError& error) {
        throw DamagedPacket(error.what());
    }
}

}  // namespace

Packet packVdb(VdbFile file, VdbContents contents, std::int64_t mostBytes) {
    auto store = std::make_shared<BrickStore>(std::move(file.store));
    if (contents == VdbContents::withoutValues) store->surface().clear();
    auto list = std::make_shared<TileList>(listTiles(*store));
    const int channels = contents == VdbContents::all ? store->channels() : 0;
    std::vector<BrickKey> flat;
    if (file.bricks) {
        flat.assign(file.tree.leaves().begin(), file.tree.leaves().end());
        std::swap(file.tree, *file.bricks);
    }
    std::vector<std::string> entries;
    for (auto& [key, text] : encodeMetadata(file)) {
        entries.push_back(key);
        entries.push_back(std::move(text));
    }
    HeadWriter head;
    head.put(entries);
    head.put(file.gridNames);
    for (const std::int64_t voxels : file.gridVoxels) head.put(voxels);
    head.put(file.strayValues);
    head.put(file.gridProblems);
    head.put(std::int64_t(channels));
    head.put(std::int64_t(flat.size()));
    head.put(std::int64_t(list->places.size()));
    head.put(std::int64_t(list->extension.size()));
    head.put(std::int64_t(list->surface.size()));
    Packet packet;
    packet.head = head.take();
    packet.arrayBytes = std::int64_t(
        flat.size() * sizeof(BrickKey) + list->places.size() * sizeof(TilePlace) +
        (list->extension.size() + list->surface.size()) * sizeof(TileKey) +
        (list->tiles.size() + list->surface.size()) * sizeof(Words) +
        (list->tiles.size() * std::size_t(channels) + list->surface.size()) * kTilePoints * sizeof(float));
    if (packet.bytes() + tableBytes(store->leafCount(), store->tileCount()) > mostBytes)
        throw std::bad_alloc();
    packet.writeArrays = [store, list, channels, flat = std::move(flat)](const PacketSink& sink) {
        give(flat, sink);
        give(list->places, sink);
        give(list->extension, sink);
        give(list->surface, sink);
        for (const std::vector<Tile*>* tiles : {&list->tiles, &list->surfaceTiles}) {
            std::vector<Words> coverage;
            for (const Tile* tile : *tiles) coverage.push_back(tile->coverage);
            give(coverage, sink);
        }
        const auto giveValues = [&](Tile& tile, int count) {
            sink(tile.values.get(), std::size_t(count) * kTilePoints * sizeof(float));
            tile.values.reset();
        };
        if (channels > 0)
            for (Tile* tile : list->tiles) giveValues(*tile, channels);
        for (Tile* tile : list->surfaceTiles) giveValues(*tile, 1);
    };
    return packet;
}

VdbFile unpackVdb(std::span<const std::byte> bytes, std::int64_t mostBytes, const Execution& execution) {
    static_assert(sizeof(VdbFile) == 1296,
                  "a new member of VdbFile that isn't in its metadata needs its place in the packet");
    ReceivedPacket packet(bytes);
    HeadReader head = packet.head();
    VdbFile file = decode(head.getTexts());
    file.gridNames = head.getTexts();
    for (std::size_t g = 0; g < file.gridNames.size(); ++g)
        file.gridVoxels.push_back(head.get<std::int64_t>());
    file.strayValues = head.get<std::int64_t>();
    file.gridProblems = head.getTexts();
    const int all = channelsOf(file.fields);
    if (all > kMostChannels) throw DamagedPacket("it has too many fields");
    const auto channels = int(head.getCount(all, "channels"));
    if (channels != 0 && channels != all) throw DamagedPacket("it has some of its channels");
    const std::int64_t most = std::int64_t(bytes.size());
    const std::int64_t flatBricks = head.getCount(most, "bricks");
    const std::int64_t leafTiles = head.getCount(most, "tiles");
    const std::int64_t moreTiles = head.getCount(most, "tiles outside the mesh");
    const std::int64_t surfaceTiles = head.getCount(most, "tiles at the surface");
    head.expectEnd();

    const auto flat = packet.array<BrickKey>(flatBricks, "bricks");
    if (file.layout == VdbLayout::flat) {
        BrickTree grid = flatTree(file, flat);
        file.bricks = std::exchange(file.tree, std::move(grid));
    } else if (!flat.empty()) {
        throw DamagedPacket("it has bricks of a grid");
    }
    const int tileCount = BrickStore(file.tree.brickCells(), 0, channels).tileCount();
    if (std::int64_t(bytes.size()) + tableBytes(file.tree.leafCount(), tileCount) > mostBytes)
        throw DamagedPacket("it has more bricks than there is memory for");
    file.store = BrickStore(file.tree.brickCells(), file.tree.leafCount(), channels);
    const auto places = packet.array<TilePlace>(leafTiles, "tiles");
    const auto extension = packet.array<TileKey>(moreTiles, "tiles");
    const auto surface = packet.array<TileKey>(surfaceTiles, "tiles");
    const auto coverage = packet.array<Words>(leafTiles + moreTiles, "coverage");
    const auto surfaceCoverage = packet.array<Words>(surfaceTiles, "coverage");
    const std::size_t valuesPerTile = std::size_t(channels) * kTilePoints;
    const auto values = packet.array<float>((leafTiles + moreTiles) * std::int64_t(valuesPerTile), "values");
    const auto distances = packet.array<float>(surfaceTiles * kTilePoints, "distances");
    packet.expectEnd();
    if (std::any_of(coverage.begin(), coverage.end(), isEmpty) ||
        std::any_of(surfaceCoverage.begin(), surfaceCoverage.end(), isEmpty))
        throw DamagedPacket("a tile is empty");
    for (std::size_t i = 0; i < places.size(); ++i)
        if (places[i].leaf >= file.store.leafCount() ||
            places[i].tile >= std::uint32_t(file.store.tileCount()) || (i > 0 && places[i] <= places[i - 1]))
            throw DamagedPacket("a tile is out of place");
    const auto fill = [](Tile& tile, const Words& words, std::span<const float> of) {
        tile.coverage = words;
        tile.values = std::make_unique_for_overwrite<float[]>(of.size());
        std::copy(of.begin(), of.end(), tile.values.get());
    };
    parallelForChunks(execution, leafTiles, kTileGrain, [&](std::int64_t begin, std::int64_t end) {
        for (auto i = std::size_t(begin); i < std::size_t(end); ++i)
            fill(file.store.ensureTile(places[i].leaf, int(places[i].tile)), coverage[i],
                 values.subspan(i * valuesPerTile, valuesPerTile));
    });
    const auto place = [&](TileMap& map, const TileKey& key) -> Tile& {
        if (key.level < 0 || key.level >= std::max(file.tree.levelCount(), 1) ||
            !isWithin(key.index, kTileSize))
            throw DamagedPacket("a tile outside the bricks is out of range");
        const auto [at, isNew] = map.try_emplace(key);
        if (!isNew) throw DamagedPacket("two tiles lie in one place");
        return at->second;
    };
    for (std::size_t i = 0; i < extension.size(); ++i)
        fill(place(file.store.extension(), extension[i]), coverage[places.size() + i],
             values.subspan((places.size() + i) * valuesPerTile, valuesPerTile));
    for (std::size_t i = 0; i < surface.size(); ++i) {
        const auto of = distances.subspan(i * kTilePoints, kTilePoints);
        Tile& tile = place(file.store.surface(), surface[i]);
        fill(tile, surfaceCoverage[i], of);
        for (int p = 0; p < kTilePoints; ++p)
            if (tile.covered(p) && !(std::abs(of[std::size_t(p)]) <= kFarFromSurface * (1 + 1e-5)))
                throw DamagedPacket("a distance from the surface is out of range");
    }
    return file;
}

}  // namespace tessera
