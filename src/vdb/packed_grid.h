#pragma once

#include <openvdb/io/Compression.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <ostream>
#include <streambuf>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/check.h"
#include "vdb/openvdb_grids.h"

namespace tessera {

/// How the leaf nodes of all our files are compressed.
inline constexpr std::uint32_t kVdbCompression =
    openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK;

/// Keeps what is written to it.
class TextBuffer : public std::streambuf {
  public:
    const std::string& bytes() const { return bytes_; }

  protected:
    std::streamsize xsputn(const char* s, std::streamsize n) override {
        bytes_.append(s, std::size_t(n));
        return n;
    }
    int_type overflow(int_type c) override {
        if (!traits_type::eq_int_type(c, traits_type::eof())) bytes_ += traits_type::to_char_type(c);
        return traits_type::not_eof(c);
    }

  private:
    std::string bytes_;
};

/// A leaf node as it stands in the file: the mask of its active points, then its compressed values.
class PackedLeaf {
  public:
    PackedLeaf() = default;
    /// @param background the grid's.
    template <class Leaf>
    PackedLeaf(const Leaf& leaf, const typename Leaf::ValueType& background, bool toHalf) {
        TextBuffer buffer;
        std::ostream stream(&buffer);
        stream.exceptions(std::ios_base::badbit | std::ios_base::failbit);
        openvdb::io::setDataCompression(stream, kVdbCompression);
        openvdb::io::setGridBackgroundValuePtr(stream, &background);
        leaf.writeBuffers(stream, toHalf);
        size_ = buffer.bytes().size();
        bytes_ = std::make_unique<char[]>(size_);
        std::copy_n(buffer.bytes().data(), size_, bytes_.get());
    }
    void writeTo(std::ostream& stream) const { stream.write(bytes_.get(), std::streamsize(size_)); }

    /// What precedes the values tells which inactive values there are
    /// (openvdb::io::NO_MASK_OR_INACTIVE_VALS...).
    std::int8_t kind() const { return std::int8_t(bytes_[kMaskBytes]); }
    /// Bytes of the compressed values, their length included.
    template <class Value>
    std::int64_t valueBytes() const {
        using namespace openvdb::io;
        const bool two = kind() == MASK_AND_TWO_INACTIVE_VALS;
        const bool one = kind() == NO_MASK_AND_ONE_INACTIVE_VAL || kind() == MASK_AND_ONE_INACTIVE_VAL;
        const bool selects =
            kind() == MASK_AND_NO_INACTIVE_VALS || kind() == MASK_AND_ONE_INACTIVE_VAL || two;
        const std::size_t inactiveValues = two ? 2 : one ? 1 : 0;
        const std::size_t head = kMaskBytes + 1 + inactiveValues * sizeof(Value) + (selects ? kMaskBytes : 0);
        return std::int64_t(size_ - head);
    }

  private:
    static constexpr std::size_t kMaskBytes = 64;
    std::unique_ptr<char[]> bytes_;
    std::size_t size_ = 0;
};

/// A grid of compressed leaf nodes: its tree has their masks and no values. Written, it gives the same bytes
/// as OpenVDB's own grid, but each leaf node is compressed once, by the thread that made it, and memory is
/// that of the file.
template <class Grid>
class PackedGrid final : public Grid {
  public:
    using Leaf = typename Grid::TreeType::LeafNodeType;

    /// Through a tree: OpenVDB's shared library keeps its constructor from a background to itself.
    explicit PackedGrid(const typename Grid::ValueType& background)
        : Grid(std::make_shared<typename Grid::TreeType>(background)) {}

    /// Takes a leaf node that was made for this grid's background and precision.
    void add(std::unique_ptr<Leaf> maskOnly, PackedLeaf bytes) {
        maskOnly->setTransientData(openvdb::Index32(packed_.size()));
        packed_.push_back(std::move(bytes));
        this->tree().addLeaf(maskOnly.release());
    }

    /// Adds what OpenVDB stores beside a grid it writes: statistics, and where values lie for delayed
    /// loading.
    void describe() {
        this->addStatsMetadata();
        const auto bytes = this->template getMetadata<openvdb::Int64Metadata>(Grid::META_FILE_MEM_BYTES);
        if (bytes) bytes->value() += std::int64_t(packed_.size()) * bufferBytes();
        this->insertMeta(Grid::META_FILE_COMPRESSION,
                         openvdb::StringMetadata(openvdb::io::compressionToString(kVdbCompression)));
        if (bufferBytes() == 0) return;
        openvdb::io::DelayedLoadMetadata places;
        places.resizeMask(packed_.size());
        places.resizeCompressedSize(packed_.size());
        std::size_t i = 0;
        for (auto leaf = this->tree().cbeginLeaf(); leaf; ++leaf, ++i) {
            const PackedLeaf& packed = packed_[leaf->transientData()];
            places.setMask(i, packed.kind());
            places.setCompressedSize(i, packed.template valueBytes<typename Grid::ValueType>());
        }
        this->insertMeta(Grid::META_FILE_DELAYED_LOAD, places);
    }

    void writeBuffers(std::ostream& stream) const override {
        TESSERA_CHECK(openvdb::io::getDataCompression(stream) == kVdbCompression,
                      "the file is compressed as its leaf nodes are");
        for (auto leaf = this->tree().cbeginLeaf(); leaf; ++leaf)
            packed_[leaf->transientData()].writeTo(stream);
    }

  private:
    /// Bytes of a leaf node's values that its mask alone doesn't take.
    static std::int64_t bufferBytes() {
        return std::is_same_v<typename Grid::ValueType, bool>
                   ? 0
                   : std::int64_t(Leaf::SIZE * sizeof(typename Grid::ValueType));
    }
    std::vector<PackedLeaf> packed_;
};

}  // namespace tessera
