#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "brick/brick_tree.h"
#include "lattice/block.h"

namespace tessera {

inline constexpr int kTileSize = 8;                                    ///< points along a tile's edge
inline constexpr int kTilePoints = kTileSize * kTileSize * kTileSize;  ///< 512

/// Samples of 8^3 lattice points aligned to multiples of 8, in the order of an OpenVDB leaf node: point (x,
/// y, z) of the tile has offset (x * 8 + y) * 8 + z.
struct Tile {
    std::array<std::uint64_t, 8> coverage{};  ///< bit `offset` (word offset / 64): the point lies in the mesh
    std::unique_ptr<float[]> values;          ///< channels x 512, channel by channel; 0 where not covered

    bool covered(int offset) const { return (coverage[std::size_t(offset >> 6)] >> (offset & 63)) & 1; }
    const float* channel(int c) const { return values.get() + std::size_t(c) * kTilePoints; }
};

/// The stored samples of a tree: exact samples at the points each leaf brick owns. A tile without a covered
/// point is absent, so memory is that of the output. Bricks may be put from several threads at once, each
/// brick once.
class BrickStore {
  public:
    BrickStore() = default;
    BrickStore(int brickCells, std::size_t leafCount, int channels);

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
    /// Frees one tile; writers call it as soon as the tile is in the file's tree.
    void release(std::size_t leaf, int tile) {
        tiles_[leaf * std::size_t(tileCount_) + std::size_t(tile)].reset();
    }

    /// Value at a point of the leaf, local index in [0, B)^3; `covered` tells whether it is in the mesh.
    float value(std::size_t leaf, const Vec3i& local, int channel, bool& covered) const;

    std::int64_t coveredPoints() const;
    std::int64_t memoryBytes() const;

  private:
    int channels_ = 0;
    int tilesPerEdge_ = 0;
    int tileCount_ = 0;
    std::size_t leafCount_ = 0;
    std::vector<std::unique_ptr<Tile>> tiles_;
};

}  // namespace tessera
