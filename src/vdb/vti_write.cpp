#include "vdb/vti_write.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <functional>
#include <glm/common.hpp>
#include <limits>

#include "base/check.h"
#include "base/floor_div.h"
#include "base/parallel.h"
#include "base/text.h"
#include "files/atomic_file.h"
#include "refine/brick_result.h"
#include "tessera/error.h"
#include "vdb/vdb_metadata.h"

namespace tessera {
namespace {

// As VTK names and numbers them (vtkDataSetAttributes).
constexpr const char* kMaskName = "vtkValidPointMask";
constexpr const char* kGhostName = "vtkGhostType";
constexpr char kHiddenPoint = 2, kHiddenCell = 32;

constexpr std::int64_t kBlockItems = 1 << 15;  // points or cells that are compressed together
constexpr std::int64_t kBatchBlocks = 64;      // blocks that are held at once
constexpr int kCompressionLevel = 1;           // floats hardly shrink more by higher ones
constexpr std::size_t kOffsetDigits = 20;

/// 8^3 points: samples, or points outside the mesh that carry a value, or both.
struct PointTile {
    const Tile* samples = nullptr;
    const Tile* extension = nullptr;
};

/// What is stored at a point: a tile that has its values, or null.
struct StoredPoint {
    const Tile* tile = nullptr;
    int offset = 0;
    bool isCovered = false;
};

/// Calls visit(index, samples, extension) for every tile of a flat grid: its first point over 8, and what it
/// holds, one of both null. A tile may come once for its samples and once for its extension.
template <class Visit>
void forTiles(const BrickTree& tree, const BrickStore& store, const Visit& visit) {
    const int n = store.tilesPerEdge();
    for (std::size_t leaf = 0; leaf < tree.leafCount(); ++leaf) {
        const Vec3i first = floorDiv(tree.ownedPoints(tree.leaves()[leaf]).min, kTileSize);
        for (int t = 0; t < store.tileCount(); ++t)
            if (const Tile* tile = store.tile(leaf, t))
                visit(first + Vec3i(t / (n * n), t / n % n, t % n), tile, nullptr);
    }
    for (const auto& [key, tile] : store.extension()) visit(key.index, nullptr, &tile);
}

/// Calls visit(tile, offset) for every point that a flat grid stores.
template <class Visit>
void forPoints(const BrickTree& tree, const BrickStore& store, const Visit& visit) {
    forTiles(tree, store, [&](const Vec3i& index, const Tile* samples, const Tile* extension) {
        const Tile& tile = samples ? *samples : *extension;
        for (std::size_t w = 0; w < 8; ++w)
            for (std::uint64_t bits = tile.coverage[w]; bits != 0; bits &= bits - 1)
                visit(index, tile, int(w) * 64 + std::countr_zero(bits));
    });
}

/// The box of a flat grid's points and one layer around it, and the tiles there in an array.
///
/// Nothing is stored in that layer, so all cells at the image's border are hidden: ParaView 5.11 shows wrong
/// faces, or crashes, where some cells are hidden and one at the border isn't.
class PointBox {
  public:
    PointBox(const BrickTree& tree, const BrickStore& store);
    bool isEmpty() const { return count_ == 0; }
    std::int64_t storedPoints() const { return count_; }
    const Vec3i& min() const { return min_; }
    std::int64_t size(int axis) const { return std::int64_t(max_[axis]) - min_[axis] + 1; }
    double pointCount() const { return double(size(0)) * double(size(1)) * double(size(2)); }

    /// To be called before `at`, once the size is known to be bearable.
    void arrange(const BrickTree& tree, const BrickStore& store);
    /// @param x, y, z from the box's first point.
    StoredPoint at(std::int64_t x, std::int64_t y, std::int64_t z) const;

  private:
    std::vector<PointTile> tiles_;
    Vec3i firstTile_{0};
    std::array<std::int64_t, 3> tileCounts_{};
    Vec3i min_{std::numeric_limits<int>::max()}, max_{std::numeric_limits<int>::min()};
    std::int64_t count_ = 0;
};

PointBox::PointBox(const BrickTree& tree, const BrickStore& store) {
    forPoints(tree, store, [&](const Vec3i& tile, const Tile&, int offset) {
        const Vec3i p = tile * kTileSize + pointInTile(offset);
        min_ = glm::min(min_, p);
        max_ = glm::max(max_, p);
        ++count_;
    });
    if (isEmpty()) return;
    min_ -= 1;
    max_ += 1;
}

void PointBox::arrange(const BrickTree& tree, const BrickStore& store) {
    firstTile_ = floorDiv(min_, kTileSize);
    const Vec3i lastTile = floorDiv(max_, kTileSize);
    for (int axis = 0; axis < 3; ++axis)
        tileCounts_[std::size_t(axis)] = std::int64_t(lastTile[axis]) - firstTile_[axis] + 1;
    tiles_.resize(std::size_t(tileCounts_[0] * tileCounts_[1] * tileCounts_[2]));
    forTiles(tree, store, [&](const Vec3i& index, const Tile* samples, const Tile* extension) {
        const Vec3i t = index - firstTile_;
        for (int axis = 0; axis < 3; ++axis)  // a tile without a point may lie outside
            if (t[axis] < 0 || t[axis] >= tileCounts_[std::size_t(axis)]) return;
        PointTile& tile = tiles_[std::size_t((t.z * tileCounts_[1] + t.y) * tileCounts_[0] + t.x)];
        if (samples) tile.samples = samples;
        if (extension) tile.extension = extension;
    });
}

StoredPoint PointBox::at(std::int64_t x, std::int64_t y, std::int64_t z) const {
    const Vec3i p = min_ + Vec3i(int(x), int(y), int(z));
    const Vec3i t = floorDiv(p, kTileSize) - firstTile_;
    const PointTile& tile = tiles_[std::size_t((t.z * tileCounts_[1] + t.y) * tileCounts_[0] + t.x)];
    const int offset = offsetInTile(p);
    if (tile.samples && tile.samples->covered(offset)) return {tile.samples, offset, true};
    if (tile.extension && tile.extension->covered(offset)) return {tile.extension, offset, false};
    return {};
}

/// An array of the file.
struct ImageArray {
    std::string name;
    const char* type = "";  ///< as VTK's files call it
    int components = 1;
    std::int64_t itemBytes = 0;  ///< of all components
    std::int64_t items = 0;      ///< points, cells, or values
    /// Puts items begin to end into bytes.
    std::function<void(std::int64_t begin, std::int64_t end, char* bytes)> fill;
    std::size_t offsetAt = 0;  ///< where the header says at which byte the array begins
};

/// Walks points or cells in VTK's order, x fastest. @param visit of (position from begin, x, y, z).
template <class Visit>
void forItems(const std::array<std::int64_t, 3>& size, std::int64_t begin, std::int64_t end,
              const Visit& visit) {
    std::int64_t x = begin % size[0], y = begin / size[0] % size[1], z = begin / size[0] / size[1];
    for (std::int64_t i = begin; i < end; ++i) {
        visit(i - begin, x, y, z);
        if (++x < size[0]) continue;
        x = 0;
        if (++y < size[1]) continue;
        y = 0;
        ++z;
    }
}

/// What the components of a field are where nothing is stored: the stored value that is closest to 0.
/// Programs that don't leave out hidden points then still see no value that the field doesn't have, nor
/// another range.
std::vector<float> smallestValue(const OutputField& field, const BrickResult& result) {
    std::vector<float> smallest(static_cast<std::size_t>(field.components)), value(smallest);
    double smallestSquare = std::numeric_limits<double>::infinity();
    forPoints(result.tree, result.store, [&](const Vec3i&, const Tile& tile, int offset) {
        double square = 0;
        for (std::size_t c = 0; c < value.size(); ++c) {
            value[c] = tile.channel(field.firstChannel + int(c))[offset] + 0.0f;  // no -0
            square += double(value[c]) * double(value[c]);
        }
        // Of equal ones the least, whatever order they come in. One that isn't finite is never taken.
        if (!(square < smallestSquare || (square == smallestSquare && value < smallest)) ||
            !std::isfinite(square))
            return;
        smallest = value;
        smallestSquare = square;
    });
    return smallest;
}

ImageArray valueArray(const OutputField& field, const PointBox& box, const std::array<std::int64_t, 3>& size,
                      const std::vector<float>& hidden) {
    const auto fill = [&box, size, hidden, first = field.firstChannel](std::int64_t begin, std::int64_t end,
                                                                       char* bytes) {
        std::vector<float> values(hidden.size());
        const std::size_t itemBytes = values.size() * sizeof(float);
        forItems(size, begin, end, [&](std::int64_t i, std::int64_t x, std::int64_t y, std::int64_t z) {
            const StoredPoint point = box.at(x, y, z);
            bool isFinite = true;
            for (std::size_t c = 0; c < values.size(); ++c) {
                values[c] = point.tile ? point.tile->channel(first + int(c))[point.offset] : hidden[c];
                isFinite = isFinite && std::isfinite(values[c]);
            }
            if (!isFinite) std::fill(values.begin(), values.end(), std::numeric_limits<float>::quiet_NaN());
            std::memcpy(bytes + std::size_t(i) * itemBytes, values.data(), itemBytes);
        });
    };
    return {field.name, "Float32", field.components, field.components * 4, size[0] * size[1] * size[2],
            fill,       0};
}

ImageArray maskArray(const PointBox& box, const std::array<std::int64_t, 3>& size) {
    const auto fill = [&box, size](std::int64_t begin, std::int64_t end, char* bytes) {
        forItems(size, begin, end, [&](std::int64_t i, std::int64_t x, std::int64_t y, std::int64_t z) {
            bytes[i] = char(box.at(x, y, z).isCovered);
        });
    };
    return {kMaskName, "Int8", 1, 1, size[0] * size[1] * size[2], fill, 0};
}

ImageArray pointGhosts(const PointBox& box, const std::array<std::int64_t, 3>& size) {
    const auto fill = [&box, size](std::int64_t begin, std::int64_t end, char* bytes) {
        forItems(size, begin, end, [&](std::int64_t i, std::int64_t x, std::int64_t y, std::int64_t z) {
            bytes[i] = box.at(x, y, z).tile ? 0 : kHiddenPoint;
        });
    };
    return {kGhostName, "UInt8", 1, 1, size[0] * size[1] * size[2], fill, 0};
}

/// A cell is hidden when one of its corners is.
ImageArray cellGhosts(const PointBox& box, const std::array<std::int64_t, 3>& size) {
    const std::array<std::int64_t, 3> cells{size[0] - 1, size[1] - 1, size[2] - 1};
    const auto fill = [&box, cells](std::int64_t begin, std::int64_t end, char* bytes) {
        forItems(cells, begin, end, [&](std::int64_t i, std::int64_t x, std::int64_t y, std::int64_t z) {
            bool isWhole = true;
            for (int corner = 0; corner < 8 && isWhole; ++corner)
                isWhole = box.at(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)).tile != nullptr;
            bytes[i] = isWhole ? 0 : kHiddenCell;
        });
    };
    return {kGhostName, "UInt8", 1, 1, cells[0] * cells[1] * cells[2], fill, 0};
}

ImageArray textArray(const std::string& name, const std::string& text) {
    const auto fill = [text](std::int64_t begin, std::int64_t end, char* bytes) {
        std::memcpy(bytes, text.c_str() + begin, std::size_t(end - begin));  // the last one is '\0'
    };
    return {name, "String", 1, 1, std::int64_t(text.size()) + 1, fill, 0};
}

ImageArray numberArray(const std::string& name, double number) {
    const auto fill = [number](std::int64_t, std::int64_t, char* bytes) {
        std::memcpy(bytes, &number, sizeof number);
    };
    return {name, "Float64", 1, sizeof number, 1, fill, 0};
}

/// Whether XML takes a character, if only by its number.
bool isXmlCharacter(char32_t code) {
    return code == '\t' || code == '\n' || code == '\r' || (code >= 0x20 && code < 0xd800) ||
           (code >= 0xe000 && code < 0xfffe) || (code >= 0x10000 && code < 0x110000);
}

/// Text of an XML attribute. Names come from other files: what no XML file can hold becomes U+FFFD.
std::string attributeText(const std::string& text) {
    const std::vector<char32_t> codes = decodeUtf8(text);
    std::string escaped;
    for (const char32_t found : codes) {
        const char32_t code = isXmlCharacter(found) ? found : char32_t(0xfffd);
        if (code >= 0x20 && code < 0x7f && code != '&' && code != '<' && code != '>' && code != '"') {
            escaped += char(code);
        } else {
            escaped += "&#" + std::to_string(std::uint32_t(code)) + ";";
        }
    }
    return escaped;
}

struct ImageParts {
    std::vector<ImageArray> fieldData, pointData, cellData;
};

/// Everything before the arrays' bytes; leaves room for their offsets and notes where that is.
std::string headerText(ImageParts& parts, const PointBox& box, const Vec3d& origin, double spacing,
                       const std::string& scalars) {
    std::string text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n";
    const std::string extent = "0 " + std::to_string(box.size(0) - 1) + " 0 " +
                               std::to_string(box.size(1) - 1) + " 0 " + std::to_string(box.size(2) - 1);
    const std::string h = exactText(spacing);
    text += "<ImageData WholeExtent=\"" + extent + "\" Origin=\"" + exactText(origin.x) + " " +
            exactText(origin.y) + " " + exactText(origin.z) + "\" Spacing=\"" + h + " " + h + " " + h +
            "\">\n";
    const auto list = [&](std::vector<ImageArray>& arrays) {
        for (ImageArray& array : arrays) {
            const bool isText = std::strcmp(array.type, "String") == 0;
            text += isText ? "<Array" : "<DataArray";
            text += " type=\"" + std::string(array.type) + "\" Name=\"" + attributeText(array.name) + "\"";
            if (&arrays == &parts.fieldData)
                text += " NumberOfTuples=\"1\"";
            else
                text += " NumberOfComponents=\"" + std::to_string(array.components) + "\"";
            text += " format=\"appended\" offset=\"";
            array.offsetAt = text.size();
            text.append(kOffsetDigits, '0').append("\"/>\n");
        }
    };
    text += "<FieldData>\n";
    list(parts.fieldData);
    text += "</FieldData>\n<Piece Extent=\"" + extent + "\">\n<PointData";
    if (!scalars.empty()) text += " Scalars=\"" + attributeText(scalars) + "\"";
    text += ">\n";
    list(parts.pointData);
    text += "</PointData>\n<CellData>\n";
    list(parts.cellData);
    return text + "</CellData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_";
}

std::vector<Bytef> compressed(const std::vector<char>& bytes) {
    std::vector<Bytef> packed(compressBound(uLong(bytes.size())));
    uLongf size = uLongf(packed.size());
    const int outcome = compress2(packed.data(), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                                  uLong(bytes.size()), kCompressionLevel);
    if (outcome != Z_OK) throw IoError("zlib failed with code " + std::to_string(outcome));
    packed.resize(size);
    return packed;
}

/// Writes arrays as VTK lays them out: the number of blocks, the size of a block and of the last one when
/// that is smaller, the compressed sizes, then the blocks.
class ArrayWriter {
  public:
    ArrayWriter(AtomicFile& file, std::int64_t totalBytes, const Execution& execution)
        : file_(file), execution_(execution), totalBytes_(totalBytes), end_(file.size()), begin_(end_) {}

    void write(const ImageArray& array);

  private:
    AtomicFile& file_;
    const Execution& execution_;
    std::int64_t totalBytes_, doneBytes_ = 0;
    std::int64_t end_;    // of the file
    std::int64_t begin_;  // what offsets are counted from
};

void ArrayWriter::write(const ImageArray& array) {
    std::string offset = std::to_string(end_ - begin_);
    offset.insert(0, kOffsetDigits - offset.size(), '0');
    file_.writeAt(std::int64_t(array.offsetAt), offset.data(), offset.size());

    const std::int64_t blocks = (array.items + kBlockItems - 1) / kBlockItems;
    std::vector<std::uint64_t> head{std::uint64_t(blocks), std::uint64_t(kBlockItems * array.itemBytes),
                                    std::uint64_t(array.items % kBlockItems * array.itemBytes)};
    const std::int64_t headAt = end_;
    end_ += std::int64_t(head.size() + std::size_t(blocks)) * std::int64_t(sizeof(std::uint64_t));
    for (std::int64_t first = 0; first < blocks; first += kBatchBlocks) {
        const std::int64_t count = std::min(kBatchBlocks, blocks - first);
        std::vector<std::vector<Bytef>> packed(static_cast<std::size_t>(count));
        parallelFor(execution_, count, [&](std::int64_t b) {
            const std::int64_t begin = (first + b) * kBlockItems;
            const std::int64_t end = std::min(array.items, begin + kBlockItems);
            std::vector<char> bytes(std::size_t((end - begin) * array.itemBytes));
            array.fill(begin, end, bytes.data());
            packed[std::size_t(b)] = compressed(bytes);
        });
        for (const std::vector<Bytef>& block : packed) {
            file_.writeAt(end_, block.data(), block.size());
            end_ += std::int64_t(block.size());
            head.push_back(block.size());
        }
        doneBytes_ += count * kBlockItems * array.itemBytes;
        execution_.report(Stage::writing, std::min(doneBytes_, totalBytes_), totalBytes_);
    }
    file_.writeAt(headAt, head.data(), head.size() * sizeof(std::uint64_t));
}

void checkNames(const std::vector<OutputField>& fields) {
    for (const OutputField& field : fields)
        if (field.name == kMaskName || field.name == kGhostName)
            throw InputError("a .vti file has a " + field.name +
                             " of its own: rename the field with --field " + field.sourceName + "=newname");
}

void checkSize(const PointBox& box, const VdbWriteOptions& options) {
    if (box.isEmpty())
        throw InputError("no voxel lies in the mesh, and a .vti file has at least one: take a finer spacing");
    const std::int64_t limit = std::max(kDefaultImagePoints, options.maxVoxels);
    if (box.pointCount() <= double(limit)) return;
    throw InputError("a .vti file would hold " + std::to_string(box.size(0)) + " x " +
                     std::to_string(box.size(1)) + " x " + std::to_string(box.size(2)) +
                     " points, all of the box around the mesh, and the limit is " + std::to_string(limit) +
                     ": take a coarser spacing or --bounds, a larger --max-voxels, or a .vdb file, which "
                     "holds the voxels in the mesh alone");
}

std::vector<ImageArray> describe(const std::vector<OutputField>& fields, const BrickResult& result,
                                 const VdbWriteOptions& options, double unitScale) {
    std::vector<ImageArray> entries;
    for (const auto& [key, value] : encodeMetadata(describeFile(fields, result, options, unitScale)))
        if (key != "tessera_bricks" && key != "tessera_background") entries.push_back(textArray(key, value));
    if (options.time) entries.push_back(numberArray("TimeValue", *options.time));
    return entries;
}

}  // namespace

void checkVtiOptions(const VdbWriteOptions& options) {
    if (options.halfFloat)
        throw InputError("--half: a .vti file holds 32-bit floats; a .vdb file can be half");
    if (options.upAxis != UpAxis::keep)
        throw InputError("--up-axis: a .vti file keeps the mesh's axes, so that it lies over the mesh");
    if (options.voxelShift != 0)
        throw InputError("--voxel-shift: a .vti file has its points where the samples are");
}

VdbWriteResult writeVti(const std::string& path, const std::vector<OutputField>& fields, BrickResult& result,
                        const VdbWriteOptions& options, const Execution& execution) {
    checkVtiOptions(options);
    checkOutputFields(fields);
    checkNames(fields);
    TESSERA_CHECK(options.layout == VdbLayout::flat && result.bricks, "a VTK image holds one grid a field");
    VdbWriteResult written;
    written.unitScale = options.unitScale > 0 ? options.unitScale : 1;  // VTK takes voxels of any size
    AtomicFile file(path);
    PointBox box(result.tree, result.store);
    checkSize(box, options);
    box.arrange(result.tree, result.store);
    const std::array<std::int64_t, 3> size{box.size(0), box.size(1), box.size(2)};
    ImageParts parts;
    parts.fieldData = describe(fields, result, options, written.unitScale);
    std::string scalars;
    for (const OutputField& field : fields) {
        parts.pointData.push_back(valueArray(
            field, box, size,
            options.hiddenValue ? std::vector<float>(std::size_t(field.components), *options.hiddenValue)
                                : smallestValue(field, result)));
        if (field.components == 1 && scalars.empty()) scalars = field.name;
    }
    parts.pointData.push_back(maskArray(box, size));
    parts.pointData.push_back(pointGhosts(box, size));
    parts.cellData.push_back(cellGhosts(box, size));

    const double spacing = result.tree.spacingWorld(0);
    const Vec3d origin = result.tree.originWorld() + spacing * Vec3d(box.min());
    const std::string header =
        headerText(parts, box, origin * written.unitScale, spacing * written.unitScale, scalars);
    file.writeAt(0, header.data(), header.size());
    std::int64_t bytes = 0;
    for (const auto* arrays : {&parts.fieldData, &parts.pointData, &parts.cellData})
        for (const ImageArray& array : *arrays) bytes += array.items * array.itemBytes;
    ArrayWriter writer(file, bytes, execution);
    for (const auto* arrays : {&parts.fieldData, &parts.pointData, &parts.cellData})
        for (const ImageArray& array : *arrays) writer.write(array);
    const std::string footer = "\n</AppendedData>\n</VTKFile>\n";
    file.writeAt(file.size(), footer.data(), footer.size());
    written.activeVoxels = box.storedPoints();
    written.fileBytes = file.size();
    file.commit(execution);
    return written;
}

}  // namespace tessera
