#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "base/floor_div.h"
#include "brick/brick_tree.h"
#include "tessera/lattice.h"

namespace tessera {

inline constexpr int kTileSize = 8;                                    ///< points along a tile's edge
inline constexpr int kTilePoints = kTileSize * kTileSize * kTileSize;  ///< 512

/// Position of a point in its tile, by its lattice index.
inline int offsetInTile(const Vec3i& p) {
    return ((p.x & 7) * 8 + (p.y & 7)) * 8 + (p.z & 7);
}
/// The point at a position in a tile, counted from the tile's first.
inline Vec3i pointInTile(int offset) {
    return {offset >> 6, offset >> 3 & 7, offset & 7};
}

/// Samples of 8^3 lattice points aligned to multiples of 8, in the order of an OpenVDB leaf node: point (x,
/// y, z) of the tile has offset (x * 8 + y) * 8 + z.
struct Tile {
    std::array<std::uint64_t, 8> coverage{};  ///< bit `offset` (word offset / 64): the point lies in the mesh
    std::unique_ptr<float[]> values;          ///< channels x 512, channel by channel; 0 where not covered

    bool covered(int offset) const { return (coverage[std::size_t(offset >> 6)] >> (offset & 63)) & 1; }
    void cover(int offset) { coverage[std::size_t(offset >> 6)] |= std::uint64_t(1) << (offset & 63); }
    bool empty() const {
        std::uint64_t any = 0;
        for (const std::uint64_t word : coverage) any |= word;
        return any == 0;
    }
    const float* channel(int c) const { return values.get() + std::size_t(c) * kTilePoints; }
};

/// Where a tile lies: a level, and the lattice index of its first point over 8.
using TileKey = BrickKey;
using TileMap = std::unordered_map<TileKey, Tile, BrickKeyHash>;

/// The stored samples of a tree: exact samples at the points each leaf brick owns. A tile without a covered
/// point is absent, so memory is that of the output. Bricks may be put from several threads at once, each
/// brick once. Beside them it holds the extension: values at points outside the mesh, which may lie outside
/// all bricks too, and the distances of points from the mesh's surface.
class BrickStore {
  public:
    BrickStore() = default;
    BrickStore(int brickCells, std::size_t leafCount, int channels);
    /// Copies all samples, which takes their memory once more: never by chance.
    explicit BrickStore(const BrickStore& other);
    BrickStore(BrickStore&&) = default;
    BrickStore& operator=(BrickStore&&) = default;

    int channels() const { return channels_; }
    int tilesPerEdge() const { return tilesPerEdge_; }
    std::size_t leafCount() const { return leafCount_; }

    /// Copies the points that brick `key` owns out of a block whose box contains them.
    void put(std::size_t leaf, const BrickKey& key, const Block& block);
    /// Null when no point of the tile is covered. @param tile (tx * n + ty) * n + tz with n = tilesPerEdge().
    const Tile* tile(std::size_t leaf, int tile) const {
        return tiles_[leaf * std::size_t(tileCount_) + std::size_t(tile)].get();
    }
    Tile* tile(std::size_t leaf, int tile) {
        return tiles_[leaf * std::size_t(tileCount_) + std::size_t(tile)].get();
    }
    int tileCount() const { return tileCount_; }
    /// Creates the tile (no coverage, values 0) when it is absent. For readers that fill a store from a file.
    Tile& ensureTile(std::size_t leaf, int tile);
    /// Moves all tiles of leaf `fromLeaf` of a store of the same shape here.
    void moveLeaf(std::size_t leaf, BrickStore& from, std::size_t fromLeaf);
    /// Takes the coverage away where `keeps(local)` is false, local index in [0, B)^3.
    template <class Keeps>
    void crop(std::size_t leaf, const Keeps& keeps);
    /// Frees one tile; writers call it as soon as the file doesn't need it any more.
    void release(std::size_t leaf, int tile) {
        tiles_[leaf * std::size_t(tileCount_) + std::size_t(tile)].reset();
    }

    /// Value at a point of the leaf, local index in [0, B)^3; `covered` tells whether it is in the mesh.
    float value(std::size_t leaf, const Vec3i& local, int channel, bool& covered) const;

    /// Tiles of the extension; their coverage says which points have a value.
    const TileMap& extension() const { return extension_; }
    TileMap& extension() { return extension_; }
    /// The tile of the extension that has a value at a lattice point of a level, or null.
    const Tile* extensionAt(int level, const Vec3i& p) const {
        if (extension_.empty()) return nullptr;
        const auto found = extension_.find({level, floorDiv(p, kTileSize)});
        return found != extension_.end() && found->second.covered(offsetInTile(p)) ? &found->second : nullptr;
    }

    /// Tiles of one channel that say how far points at the mesh's surface are from it (SurfacePoints): those
    /// of their coverage. Empty where nobody has measured.
    const TileMap& surface() const { return surface_; }
    TileMap& surface() { return surface_; }

    std::int64_t coveredPoints() const;
    std::int64_t memoryBytes() const;

  private:
    int channels_ = 0;
    int tilesPerEdge_ = 0;
    int tileCount_ = 0;
    std::size_t leafCount_ = 0;
    std::vector<std::unique_ptr<Tile>> tiles_;
    TileMap extension_, surface_;
};

template <class Keeps>
void BrickStore::crop(std::size_t leaf, const Keeps& keeps) {
    for (int t = 0; t < tileCount_; ++t) {
        Tile* stored = tile(leaf, t);
        if (!stored) continue;
        const int n = tilesPerEdge_;
        const Vec3i first = Vec3i(t / (n * n), t / n % n, t % n) * kTileSize;
        for (int offset = 0; offset < kTilePoints; ++offset) {
            if (!stored->covered(offset) || keeps(first + pointInTile(offset))) continue;
            stored->coverage[std::size_t(offset >> 6)] &= ~(std::uint64_t(1) << (offset & 63));
            for (int c = 0; c < channels_; ++c)
                stored->values[std::size_t(c) * kTilePoints + std::size_t(offset)] = 0;
        }
        if (stored->empty()) release(leaf, t);
    }
}

}  // namespace tessera
