#include "brick/brick_store.h"

#include <algorithm>
#include <cstring>
#ifdef __SSE__
#include <xmmintrin.h>
#endif

#include "base/check.h"

namespace tessera {

namespace {

constexpr std::size_t kStreamedBytes = std::size_t(16) << 20;
constexpr std::uint64_t kRowCovered = 0x0101010101010101ull;  // eight coverage bytes, all 1

// Coverage of a tile as seen in a block: rows of eight bytes along x.
enum class TileCover { none, some, all };

TileCover readCoverage(const std::uint8_t* first, std::size_t rowStride, std::size_t layerStride,
                       std::array<std::uint64_t, 8>& bits) {
    std::uint64_t any = 0, all = kRowCovered;
    std::array<std::uint64_t, 64> rows;  // [y * 8 + z]
    for (std::size_t z = 0; z < 8; ++z)
        for (std::size_t y = 0; y < 8; ++y) {
            std::uint64_t row;
            std::memcpy(&row, first + z * layerStride + y * rowStride, 8);
            rows[y * 8 + z] = row;
            any |= row;
            all &= row;
        }
    if (any == 0) return TileCover::none;
    if (all == kRowCovered) {
        bits.fill(~std::uint64_t(0));
        return TileCover::all;
    }
    bits.fill(0);
    for (std::size_t yz = 0; yz < 64; ++yz)
        for (std::size_t x = 0; rows[yz] != 0 && x < 8; ++x) bits[x] |= ((rows[yz] >> (8 * x)) & 1) << yz;
    return TileCover::some;
}

using Four = float __attribute__((vector_size(16)));

Four load(const float* from) {
    Four four;
    std::memcpy(&four, from, sizeof four);
    return four;
}
template <bool kStreams>
void store(const Four& four, float* to) {
#ifdef __SSE__
    if constexpr (kStreams) return _mm_stream_ps(to, __m128(four));
#endif
    std::memcpy(to, &four, sizeof four);
}
// Other threads see what was streamed only after this.
void finishStreaming() {
#ifdef __SSE__
    _mm_sfence();
#endif
}

struct FourByFour {
    Four row[4];
};
// Row x holds the x-th numbers of four rows.
FourByFour loadTransposed(const float* from, std::size_t stride) {
    const Four a = load(from), b = load(from + stride), c = load(from + 2 * stride),
               d = load(from + 3 * stride);
    const Four low02 = __builtin_shufflevector(a, c, 0, 4, 1, 5),
               low13 = __builtin_shufflevector(b, d, 0, 4, 1, 5),
               high02 = __builtin_shufflevector(a, c, 2, 6, 3, 7),
               high13 = __builtin_shufflevector(b, d, 2, 6, 3, 7);
    return {{__builtin_shufflevector(low02, low13, 0, 4, 1, 5),
             __builtin_shufflevector(low02, low13, 2, 6, 3, 7),
             __builtin_shufflevector(high02, high13, 0, 4, 1, 5),
             __builtin_shufflevector(high02, high13, 2, 6, 3, 7)}};
}

// 8 x 8 transposes, one for every y: x is fastest in a block, z in a tile. A cache line of the tile at a
// time.
template <bool kStreams>
void copyValues(const float* first, std::size_t rowStride, std::size_t layerStride, float* tile) {
    for (std::size_t x = 0; x < 8; x += 4)
        for (std::size_t y = 0; y < 8; y += 2) {
            const float* const from = first + y * rowStride + x;
            const FourByFour parts[4] = {loadTransposed(from, layerStride),
                                         loadTransposed(from + 4 * layerStride, layerStride),
                                         loadTransposed(from + rowStride, layerStride),
                                         loadTransposed(from + rowStride + 4 * layerStride, layerStride)};
            for (std::size_t i = 0; i < 4; ++i)
                for (std::size_t part = 0; part < 4; ++part)
                    store<kStreams>(parts[part].row[i], tile + ((x + i) * 8 + y) * 8 + part * 4);
        }
}

void clearUncovered(const std::array<std::uint64_t, 8>& bits, float* tile) {
    for (std::size_t x = 0; x < 8; ++x)
        for (std::size_t yz = 0; yz < 64; ++yz)
            if (!((bits[x] >> yz) & 1)) tile[x * 64 + yz] = 0;
}

std::size_t tileOf(const Vec3i& local, int tilesPerEdge) {
    return (std::size_t(local.x >> 3) * std::size_t(tilesPerEdge) + std::size_t(local.y >> 3)) *
               std::size_t(tilesPerEdge) +
           std::size_t(local.z >> 3);
}

}  // namespace

BrickStore::BrickStore(const BrickStore& other)
    : channels_(other.channels_),
      tilesPerEdge_(other.tilesPerEdge_),
      tileCount_(other.tileCount_),
      leafCount_(other.leafCount_),
      tiles_(other.tiles_.size()) {
    const auto values = std::size_t(channels_) * kTilePoints;
    const auto copyOf = [&](const Tile& tile) {
        Tile copy{tile.coverage, std::make_unique_for_overwrite<float[]>(values)};
        std::copy_n(tile.values.get(), values, copy.values.get());
        return copy;
    };
    for (std::size_t t = 0; t < tiles_.size(); ++t)
        if (other.tiles_[t]) tiles_[t] = std::make_unique<Tile>(copyOf(*other.tiles_[t]));
    for (const auto& [key, tile] : other.extension_) extension_.emplace(key, copyOf(tile));
}

BrickStore::BrickStore(int brickCells, std::size_t leafCount, int channels)
    : channels_(channels),
      tilesPerEdge_(brickCells / kTileSize),
      tileCount_(tilesPerEdge_ * tilesPerEdge_ * tilesPerEdge_),
      leafCount_(leafCount),
      tiles_(leafCount * std::size_t(tileCount_)) {
    TESSERA_CHECK(brickCells > 0 && brickCells % kTileSize == 0, "a brick's size is a multiple of 8");
}

void BrickStore::put(std::size_t leaf, const BrickKey& key, const Block& block) {
    TESSERA_CHECK(leaf < leafCount_ && block.channels == channels_, "a block for this store");
    const int cells = tilesPerEdge_ * kTileSize;
    const Vec3i first = key.index * cells;
    TESSERA_CHECK(block.box.contains(first) && block.box.contains(first + (cells - 1)),
                  "the block holds the brick");
    const Vec3i size = block.box.size();
    const std::size_t rowStride = std::size_t(size.x);
    const std::size_t layerStride = rowStride * std::size_t(size.y);
    // What outgrows the caches goes past them.
    const bool streams =
        tiles_.size() * std::size_t(channels_) * kTilePoints * sizeof(float) >= kStreamedBytes;
    const auto copy = streams ? copyValues<true> : copyValues<false>;
    std::array<std::uint64_t, 8> bits;
    std::size_t t = leaf * std::size_t(tileCount_);
    for (int x = 0; x < cells; x += kTileSize)
        for (int y = 0; y < cells; y += kTileSize)
            for (int z = 0; z < cells; z += kTileSize, ++t) {
                const std::size_t at = block.offset(first + Vec3i(x, y, z));
                const TileCover cover =
                    readCoverage(block.coverage.data() + at, rowStride, layerStride, bits);
                if (cover == TileCover::none) continue;
                auto tile = std::make_unique<Tile>();
                tile->coverage = bits;
                tile->values = std::make_unique_for_overwrite<float[]>(std::size_t(channels_) * kTilePoints);
                for (int c = 0; c < channels_; ++c) {
                    float* values = tile->values.get() + std::size_t(c) * kTilePoints;
                    copy(block.values.data() + std::size_t(c) * block.count() + at, rowStride, layerStride,
                         values);
                    if (cover == TileCover::some) clearUncovered(bits, values);
                }
                tiles_[t] = std::move(tile);
            }
    if (streams) finishStreaming();
}

Tile& BrickStore::ensureTile(std::size_t leaf, int tile) {
    auto& slot = tiles_[leaf * std::size_t(tileCount_) + std::size_t(tile)];
    if (!slot) {
        slot = std::make_unique<Tile>();
        slot->values = std::make_unique<float[]>(std::size_t(channels_) * kTilePoints);
    }
    return *slot;
}

void BrickStore::moveLeaf(std::size_t leaf, BrickStore& from, std::size_t fromLeaf) {
    TESSERA_CHECK(from.tileCount_ == tileCount_ && from.channels_ == channels_, "stores of one shape");
    for (int t = 0; t < tileCount_; ++t)
        tiles_[leaf * std::size_t(tileCount_) + std::size_t(t)] =
            std::move(from.tiles_[fromLeaf * std::size_t(tileCount_) + std::size_t(t)]);
}

float BrickStore::value(std::size_t leaf, const Vec3i& local, int channel, bool& covered) const {
    const Tile* tile = tiles_[leaf * std::size_t(tileCount_) + tileOf(local, tilesPerEdge_)].get();
    const int offset = offsetInTile(local);
    covered = tile && tile->covered(offset);
    return covered ? tile->channel(channel)[offset] : 0.0f;
}

std::int64_t BrickStore::coveredPoints() const {
    std::int64_t count = 0;
    for (const auto& tile : tiles_)
        if (tile)
            for (const std::uint64_t word : tile->coverage) count += std::popcount(word);
    return count;
}

std::int64_t BrickStore::memoryBytes() const {
    std::int64_t tiles = std::int64_t(extension_.size());
    for (const auto& tile : tiles_) tiles += tile ? 1 : 0;
    return tiles * std::int64_t(sizeof(Tile) + std::size_t(channels_) * kTilePoints * sizeof(float)) +
           std::int64_t(tiles_.size() * sizeof(tiles_[0]));
}

}  // namespace tessera
