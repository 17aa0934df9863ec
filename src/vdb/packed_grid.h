#pragma once

#include <openvdb/io/Compression.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <ostream>
#include <span>
#include <streambuf>
#include <utility>
#include <vector>

#include "base/check.h"
#include "vdb/openvdb_grids.h"

namespace tessera {

/// How the leaf nodes of all our files are compressed.
inline constexpr std::uint32_t kVdbCompression =
    openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;

/// Compresses the values of one leaf node after another, as OpenVDB does.
class LeafPacker {
  public:
    LeafPacker() : stream_(&buffer_) { stream_.exceptions(std::ios_base::badbit | std::ios_base::failbit); }

    /// @param values of the active points, in the order of the leaf node.
    /// @return valid until the next call.
    template <class Value>
    std::span<const char> pack(std::span<const Value> values, bool toHalf) {
        static_assert(sizeof(Value) <= kMostValueBytes);
        buffer_.clear();
        const auto count = openvdb::Index(values.size());
        if (toHalf)
            openvdb::io::HalfWriter<openvdb::io::RealToHalf<Value>::isReal, Value>::write(
                stream_, values.data(), count, kVdbCompression);
        else
            openvdb::io::writeData(stream_, values.data(), count, kVdbCompression);
        return buffer_.written();
    }

  private:
    static constexpr std::size_t kMostValueBytes = 12;
    class Buffer : public std::streambuf {
      public:
        void clear() { setp(bytes_.data(), bytes_.data() + bytes_.size()); }
        std::span<const char> written() const { return {pbase(), pptr()}; }

      private:
        // Values that can't be compressed have a head.
        std::array<char, openvdb::FloatTree::LeafNodeType::SIZE * kMostValueBytes + 64> bytes_;
    };
    Buffer buffer_;
    std::ostream stream_;
};

/// The compressed values of a leaf node.
class PackedValues {
  public:
    PackedValues() = default;
    /// Copies them to memory that is given, or where that is too small to its own.
    PackedValues(std::span<const char> packed, std::span<char> room) : size_(packed.size()) {
        char* place = room.data();
        if (room.size() < packed.size()) {
            own_ = std::make_unique<char[]>(packed.size());
            place = own_.get();
        }
        std::copy(packed.begin(), packed.end(), place);
        bytes_ = place;
    }
    std::size_t size() const { return size_; }
    void writeTo(std::ostream& stream) const { stream.write(bytes_, std::streamsize(size_)); }

  private:
    const char* bytes_ = nullptr;
    std::size_t size_ = 0;
    std::unique_ptr<char[]> own_;
};

/// What OpenVDB stores beside a grid that it writes: statistics and the compression.
inline void describeStored(openvdb::GridBase& grid) {
    grid.addStatsMetadata();
    grid.insertMeta(openvdb::GridBase::META_FILE_COMPRESSION,
                    openvdb::StringMetadata(openvdb::io::compressionToString(kVdbCompression)));
}

/// A grid of compressed leaf nodes: its tree has their masks and no values. Written, it gives the same bytes
/// as OpenVDB's own grid whose inactive points have the background, but each leaf node is compressed once, by
/// the thread that made it.
template <class Grid>
class PackedGrid final : public Grid {
  public:
    using Leaf = typename Grid::TreeType::LeafNodeType;

    /// Through a tree: OpenVDB's shared library keeps its constructor from a background to itself.
    explicit PackedGrid(const typename Grid::ValueType& background)
        : Grid(std::make_shared<typename Grid::TreeType>(background)) {}

    /// Takes a leaf node without values, and the values of its active points.
    void add(std::unique_ptr<Leaf> maskOnly, PackedValues values) {
        maskOnly->setTransientData(openvdb::Index32(packed_.size()));
        packed_.push_back(std::move(values));
        this->tree().addLeaf(maskOnly.release());
    }

    /// Adds what OpenVDB stores beside a grid, and where values lie for delayed loading.
    void describe() {
        describeStored(*this);
        const auto bytes = this->template getMetadata<openvdb::Int64Metadata>(Grid::META_FILE_MEM_BYTES);
        if (bytes)
            bytes->value() +=
                std::int64_t(packed_.size()) * Leaf::SIZE * std::int64_t(sizeof(typename Grid::ValueType));
        openvdb::io::DelayedLoadMetadata places;
        places.resizeMask(packed_.size());
        places.resizeCompressedSize(packed_.size());
        std::size_t i = 0;
        for (auto leaf = this->tree().cbeginLeaf(); leaf; ++leaf, ++i) {
            places.setMask(i, kKind);
            places.setCompressedSize(i, std::int64_t(packed_[leaf->transientData()].size()));
        }
        this->insertMeta(Grid::META_FILE_DELAYED_LOAD, places);
    }

    void writeBuffers(std::ostream& stream) const override {
        TESSERA_CHECK(openvdb::io::getDataCompression(stream) == kVdbCompression,
                      "the file is compressed as its leaf nodes are");
        for (auto leaf = this->tree().cbeginLeaf(); leaf; ++leaf) {
            leaf->valueMask().save(stream);
            stream.put(kKind);
            packed_[leaf->transientData()].writeTo(stream);
        }
    }

  private:
    /// Stands before the values of a leaf node: inactive points have the background.
    static constexpr char kKind = openvdb::io::NO_MASK_OR_INACTIVE_VALS;
    std::vector<PackedValues> packed_;
};

}  // namespace tessera
