#include "mesh_files/read_vtu.h"

#include <libdeflate.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <span>
#include <utility>

#include "base/large_pages.h"
#include "base/parallel.h"
#include "files/input_file.h"
#include "mesh_files/vtu_markup.h"

namespace tessera {

namespace {

constexpr char kTetrahedron = 10;               // a cell's type in VTK
constexpr std::size_t kPieceBytes = 512 << 10;  // unpacked, that a thread takes at once
constexpr std::size_t kRawBlockBytes = 64 << 10;
constexpr std::size_t kLargestBlockBytes = 16 << 20;

/// An array's values in the file: packed blocks one behind the other.
struct PackedBlocks {
    std::vector<std::size_t> begin;  ///< byte of every block in the file, and of the end
    std::size_t blockBytes = 0;      ///< of each but the last, unpacked
    std::size_t bytes = 0;           ///< of all, unpacked
};

std::uint64_t littleWord(const char* bytes, std::size_t count) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes, count);
    return word;
}

/// Nothing unless the array holds exactly `bytes`, in blocks of whole items.
std::optional<PackedBlocks> blocksOf(const InputFile& file, const VtuMarkup& markup, std::size_t offset,
                                     std::size_t bytes, std::size_t itemBytes) {
    const std::size_t word = markup.headerBytes;
    if (offset > markup.appendedEnd - markup.appendedAt) return std::nullopt;
    const std::size_t at = markup.appendedAt + offset, room = markup.appendedEnd - at;
    std::array<char, 24> head{};
    if (room < 3 * word) return std::nullopt;
    file.read(at, std::span(head).first(3 * word));
    PackedBlocks blocks{{}, kRawBlockBytes / itemBytes * itemBytes, bytes};
    const std::uint64_t first = littleWord(head.data(), word);
    if (!markup.compressed) {
        if (first != bytes || bytes > room - word) return std::nullopt;
        for (std::size_t b = 0; b < bytes; b += blocks.blockBytes) blocks.begin.push_back(at + word + b);
        blocks.begin.push_back(at + word + bytes);
        return blocks;
    }
    const std::uint64_t last = littleWord(head.data() + 2 * word, word);
    blocks.blockBytes = littleWord(head.data() + word, word);
    if (first == 0 || first > room / word - 3 || blocks.blockBytes == 0 ||
        blocks.blockBytes > kLargestBlockBytes || blocks.blockBytes % itemBytes != 0 ||
        last >= blocks.blockBytes || (first - (last > 0)) * blocks.blockBytes + last != bytes)
        return std::nullopt;
    std::vector<char> sizes(std::size_t(first) * word);
    file.read(at + 3 * word, sizes);
    std::size_t place = at + 3 * word + sizes.size();
    for (std::size_t b = 0; b < sizes.size(); b += word) {
        blocks.begin.push_back(place);
        const std::uint64_t size = littleWord(sizes.data() + b, word);
        if (size > markup.appendedEnd - place) return std::nullopt;
        place += size;
    }
    blocks.begin.push_back(place);
    return blocks;
}

/// Calls visit(first, bytes) for every block, unpacked, from several threads; `first` is the array's byte at
/// which it begins. False when a block is damaged or a call returns false.
template <class Visit>
bool unpack(const InputFile& file, const VtuMarkup& markup, const PackedBlocks& blocks,
            const Execution& execution, const Visit& visit) {
    const auto count = std::int64_t(blocks.begin.size() - 1);
    const auto atOnce = std::int64_t(std::max<std::size_t>(1, kPieceBytes / blocks.blockBytes));
    std::atomic<bool> isSound{true};
    parallelForChunks(execution, count, atOnce, [&](std::int64_t first, std::int64_t last) {
        const std::size_t from = blocks.begin[std::size_t(first)];
        UninitializedVector<char> packed(blocks.begin[std::size_t(last)] - from), unpacked;
        file.read(from, packed);
        using Decompressor = std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)>;
        Decompressor decompressor(nullptr, libdeflate_free_decompressor);
        if (markup.compressed) {
            decompressor.reset(libdeflate_alloc_decompressor());
            if (!decompressor) throw std::bad_alloc();
            unpacked.resize(blocks.blockBytes);
        }
        for (std::int64_t b = first; b < last && isSound; ++b) {
            const std::size_t begin = std::size_t(b) * blocks.blockBytes;
            const std::size_t bytes = std::min(blocks.blockBytes, blocks.bytes - begin);
            const std::size_t at = blocks.begin[std::size_t(b)];
            const std::size_t packedBytes = blocks.begin[std::size_t(b) + 1] - at;
            const char* values = packed.data() + (at - from);
            if (markup.compressed) {
                std::size_t got = 0;
                if (libdeflate_zlib_decompress(decompressor.get(), values, packedBytes, unpacked.data(),
                                               bytes, &got) != LIBDEFLATE_SUCCESS ||
                    got != bytes)
                    isSound = false;
                values = unpacked.data();
            }
            if (isSound && !visit(begin, std::span<const char>(values, bytes))) isSound = false;
        }
    });
    return isSound;
}

template <class Item>
Item itemAt(std::span<const char> bytes, std::size_t index) {
    Item item;
    std::memcpy(&item, bytes.data() + index * sizeof(Item), sizeof(Item));
    return item;
}

/// Calls use(T()) for the type that a name stands for. False for a name that stands for none.
template <class Use>
bool withType(const std::string& name, const Use& use) {
    if (name == "Float64") return use(double());
    if (name == "Float32") return use(float());
    if (name == "Int64") return use(std::int64_t());
    if (name == "UInt64") return use(std::uint64_t());
    if (name == "Int32") return use(std::int32_t());
    if (name == "UInt32") return use(std::uint32_t());
    if (name == "Int16") return use(std::int16_t());
    if (name == "UInt16") return use(std::uint16_t());
    if (name == "Int8") return use(std::int8_t());
    if (name == "UInt8") return use(std::uint8_t());
    return false;
}

class PlainVtu {
  public:
    PlainVtu(const InputFile& file, const VtuMarkup& markup, const Execution& execution)
        : file_(file), markup_(markup), execution_(execution) {}

    bool read(const ReadOptions& options, RawBlock& block) const {
        block.sourceCells = markup_.cells;
        if (!areTetrahedra() || !readTets(block.tets)) return false;
        const auto pointRoom = [&](std::size_t values) {
            resizeLarge(block.points, values / 3);
            return &block.points[0].x;
        };
        if (markup_.coordinates.components != 3 || !markup_.coordinates.type.starts_with("Float") ||
            !readValues(markup_.coordinates, markup_.points, pointRoom))
            return false;
        std::vector<ArrayInfo> unread;
        for (const VtuArray& array : markup_.fields) {
            ArrayInfo info{array.name, array.location, array.components, true};
            if (!isWanted(options, array.name, array.location)) {
                unread.push_back({array.name, array.location, 1, true});
                continue;
            }
            Field field{array.name, array.location, array.components, {}};
            const bool atPoints = array.location == FieldLocation::point;
            const auto fieldRoom = [&](std::size_t values) {
                resizeLarge(field.values, values);
                return field.values.data();
            };
            if (!readValues(array, atPoints ? markup_.points : markup_.cells, fieldRoom)) return false;
            block.arrays.push_back(std::move(info));
            block.fields.push_back(std::move(field));
        }
        block.arrays.insert(block.arrays.end(), unread.begin(), unread.end());
        return true;
    }

  private:
    template <class Value>
    std::optional<PackedBlocks> blocksOfValues(const VtuArray& array, std::size_t values) const {
        // Four values are never in two blocks.
        return blocksOf(file_, markup_, array.offset, values * sizeof(Value), 4 * sizeof(Value));
    }

    template <class Value, class Visit>
    bool visit(const PackedBlocks& blocks, const Visit& look) const {
        return unpack(file_, markup_, blocks, execution_,
                      [&](std::size_t begin, std::span<const char> bytes) {
                          return look(begin / sizeof(Value), bytes, bytes.size() / sizeof(Value));
                      });
    }

    /// @param makeRoom gives room for so many values; called when the file is known to hold them.
    template <class MakeRoom>
    bool readValues(const VtuArray& array, std::int64_t items, const MakeRoom& makeRoom) const {
        return withType(array.type, [&]<class Value>(Value) {
            const std::size_t count = std::size_t(items) * std::size_t(array.components);
            const auto blocks = blocksOfValues<Value>(array, count);
            if (!blocks) return false;
            double* values = makeRoom(count);
            return visit<Value>(*blocks,
                                [&](std::size_t first, std::span<const char> bytes, std::size_t there) {
                                    for (std::size_t i = 0; i < there; ++i)
                                        values[first + i] = double(itemAt<Value>(bytes, i));
                                    return true;
                                });
        });
    }

    /// Whether every cell is a tetrahedron and has the next four nodes of the list.
    bool areTetrahedra() const {
        const auto cells = std::size_t(markup_.cells);
        const auto types = blocksOfValues<std::uint8_t>(markup_.types, cells);
        if (!types || markup_.types.type != "UInt8") return false;
        const auto areTypes = [](std::size_t, std::span<const char> bytes, std::size_t) {
            return std::all_of(bytes.begin(), bytes.end(), [](char type) { return type == kTetrahedron; });
        };
        return visit<std::uint8_t>(*types, areTypes) && withIndices(markup_.offsets, [&]<class Index>(Index) {
                   const auto blocks = blocksOfValues<Index>(markup_.offsets, cells);
                   return blocks && visit<Index>(*blocks, [](std::size_t first, std::span<const char> bytes,
                                                             std::size_t there) {
                              std::uint64_t other = 0;
                              for (std::size_t i = 0; i < there; ++i)
                                  other |= std::uint64_t(itemAt<Index>(bytes, i)) ^
                                           std::uint64_t(4 * (first + i + 1));
                              return other == 0;
                          });
               });
    }

    /// False when a node isn't there, or a cell has one twice.
    bool readTets(std::vector<std::array<std::int32_t, 4>>& tets) const {
        return withIndices(markup_.connectivity, [&]<class Index>(Index) {
            const auto blocks = blocksOfValues<Index>(markup_.connectivity, std::size_t(markup_.cells) * 4);
            if (!blocks) return false;
            resizeLarge(tets, std::size_t(markup_.cells));
            return visit<Index>(
                *blocks, [&](std::size_t first, std::span<const char> bytes, std::size_t there) {
                    return takeTets<Index>(bytes, std::span(tets).subspan(first / 4, there / 4));
                });
        });
    }

    template <class Index>
    bool takeTets(std::span<const char> bytes, std::span<std::array<std::int32_t, 4>> tets) const {
        const auto points = std::uint64_t(markup_.points);
        bool isSound = true;
        for (std::size_t e = 0; e < tets.size(); ++e) {
            std::array<std::int32_t, 4>& tet = tets[e];
            for (std::size_t k = 0; k < 4; ++k) {
                const auto node = std::uint64_t(itemAt<Index>(bytes, 4 * e + k));
                isSound &= node < points;
                tet[k] = std::int32_t(node);
            }
            for (std::size_t k = 1; k < 4; ++k)
                for (std::size_t j = 0; j < k; ++j) isSound &= tet[j] != tet[k];
        }
        return isSound;
    }

    template <class Use>
    bool withIndices(const VtuArray& array, const Use& use) const {
        if (array.type == "Int64") return use(std::int64_t());
        return array.type == "Int32" && use(std::int32_t());
    }

    const InputFile& file_;
    const VtuMarkup& markup_;
    const Execution& execution_;
};

}  // namespace

std::optional<RawMesh> readPlainVtu(const std::string& path, const ReadOptions& options,
                                    const Execution& execution) {
    if (options.timeStep > 0) return std::nullopt;
    InputFile file(path);
    const std::optional<VtuMarkup> markup = parsePlainVtu(file);
    if (!markup) return std::nullopt;
    RawMesh raw;
    raw.statistics.format = "VTK XML unstructured grid";
    if (!PlainVtu(file, *markup, execution).read(options, raw.blocks.emplace_back())) return std::nullopt;
    return raw;
}

}  // namespace tessera
