#include "mesh_files/write_tets.h"

#include <libdeflate.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "files/atomic_file.h"
#include "files/html_text.h"

namespace tessera {

namespace {

constexpr std::size_t kBlockBytes = 1 << 18;
constexpr int kCompression = 4;  // of 1 to 12: more takes twice the time for a few percent

/// zlib blocks of an array, with the head that VTK puts before them.
class PackedBlocks {
  public:
    /// @param fill writes bytes [begin, begin + size) of the array to a place.
    template <class Fill>
    PackedBlocks(std::size_t bytes, const Fill& fill, const Execution& execution) {
        const std::size_t blocks = (bytes + kBlockBytes - 1) / kBlockBytes;
        blocks_.resize(blocks);
        parallelFor(execution, std::int64_t(blocks), [&](std::int64_t b) {
            const std::size_t begin = std::size_t(b) * kBlockBytes;
            std::vector<char> raw(std::min(kBlockBytes, bytes - begin));
            fill(begin, std::span(raw));
            blocks_[std::size_t(b)] = compressed(raw);
        });
        head_ = {blocks, kBlockBytes, bytes % kBlockBytes};
        for (const std::vector<char>& block : blocks_) head_.push_back(block.size());
    }

    std::size_t bytes() const {
        std::size_t sum = head_.size() * sizeof(head_[0]);
        for (const std::vector<char>& block : blocks_) sum += block.size();
        return sum;
    }

    void write(AtomicFile& file, std::int64_t& at) const {
        const auto put = [&](const void* data, std::size_t count) {
            file.writeAt(at, data, count);
            at += std::int64_t(count);
        };
        put(head_.data(), head_.size() * sizeof(head_[0]));
        for (const std::vector<char>& block : blocks_) put(block.data(), block.size());
    }

  private:
    static std::vector<char> compressed(std::span<const char> raw) {
        using Compressor = std::unique_ptr<libdeflate_compressor, void (*)(libdeflate_compressor*)>;
        const Compressor compressor(libdeflate_alloc_compressor(kCompression), libdeflate_free_compressor);
        if (!compressor) throw std::bad_alloc();
        std::vector<char> packed(libdeflate_zlib_compress_bound(compressor.get(), raw.size()));
        packed.resize(
            libdeflate_zlib_compress(compressor.get(), raw.data(), raw.size(), packed.data(), packed.size()));
        return packed;
    }

    std::vector<std::uint64_t> head_;
    std::vector<std::vector<char>> blocks_;
};

/// The file's text and, behind it, its arrays.
class VtuFile {
  public:
    explicit VtuFile(const Execution& execution) : execution_(execution) {}

    void begin(const std::string& section) { body_ += "<" + section + ">\n"; }
    void end(const std::string& section) { body_ += "</" + section + ">\n"; }
    void add(const std::string& attributes, PackedBlocks array) {
        body_ += "<DataArray " + attributes + " format=\"appended\" offset=\"" + std::to_string(appended_) +
                 "\"/>\n";
        appended_ += array.bytes();
        arrays_.push_back(std::move(array));
    }
    template <class Item>
    void add(const std::string& attributes, std::span<const Item> items) {
        const char* bytes = reinterpret_cast<const char*>(items.data());
        const auto copy = [&](std::size_t begin, std::span<char> to) {
            std::memcpy(to.data(), bytes + begin, to.size());
        };
        add(attributes, PackedBlocks(items.size_bytes(), copy, execution_));
    }
    /// Item i is what `item(i)` says.
    template <class Item, class Make>
    void make(const std::string& attributes, std::int64_t count, const Make& item) {
        static_assert(kBlockBytes % sizeof(Item) == 0);
        const auto fill = [&](std::size_t begin, std::span<char> to) {
            std::vector<Item> items(to.size() / sizeof(Item));
            for (std::size_t i = 0; i < items.size(); ++i)
                items[i] = item(std::int64_t(begin / sizeof(Item) + i));
            std::memcpy(to.data(), items.data(), to.size());
        };
        add(attributes, PackedBlocks(std::size_t(count) * sizeof(Item), fill, execution_));
    }

    void write(AtomicFile& file) const {
        const std::string head =
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" "
            "byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n" +
            body_ + "<AppendedData encoding=\"raw\">\n_";
        std::int64_t at = 0;
        const auto put = [&](const std::string& text) {
            file.writeAt(at, text.data(), text.size());
            at += std::int64_t(text.size());
        };
        put(head);
        for (const PackedBlocks& array : arrays_) array.write(file, at);
        put("\n</AppendedData>\n</VTKFile>\n");
    }

  private:
    const Execution& execution_;
    std::string body_;
    std::size_t appended_ = 0;
    std::vector<PackedBlocks> arrays_;
};

void addFields(const TetMesh& mesh, FieldLocation location, const std::string& section, VtuFile& vtu) {
    vtu.begin(section);
    for (const Field& field : mesh.fields)
        if (field.location == location)
            vtu.add("type=\"Float64\" Name=\"" + inHtml(field.name) + "\" NumberOfComponents=\"" +
                        std::to_string(field.components) + "\"",
                    std::span<const double>(field.values));
    vtu.end(section);
}

}  // namespace

void writeTets(const TetMesh& mesh, const std::string& path, const Execution& execution) {
    static_assert(sizeof(Vec3d) == 3 * sizeof(double));
    constexpr unsigned char kTetra = 10;  // VTK's type of cell
    const Execution quiet = execution.withoutProgress();
    AtomicFile file(path);
    VtuFile vtu(quiet);
    vtu.begin("UnstructuredGrid");
    vtu.begin("Piece NumberOfPoints=\"" + std::to_string(mesh.nodeCount()) + "\" NumberOfCells=\"" +
              std::to_string(mesh.elementCount()) + "\"");
    addFields(mesh, FieldLocation::point, "PointData", vtu);
    addFields(mesh, FieldLocation::cell, "CellData", vtu);
    vtu.begin("Points");
    vtu.add("type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"", std::span<const Vec3d>(mesh.points));
    vtu.end("Points");
    vtu.begin("Cells");
    vtu.make<std::int64_t>(
        "type=\"Int64\" Name=\"connectivity\"", 4 * mesh.elementCount(),
        [&](std::int64_t i) { return std::int64_t(mesh.tets[std::size_t(i / 4)][std::size_t(i % 4)]); });
    vtu.make<std::int64_t>("type=\"Int64\" Name=\"offsets\"", mesh.elementCount(),
                           [](std::int64_t i) { return 4 * (i + 1); });
    vtu.make<unsigned char>("type=\"UInt8\" Name=\"types\"", mesh.elementCount(),
                            [](std::int64_t) { return kTetra; });
    vtu.end("Cells");
    vtu.end("Piece");
    vtu.end("UnstructuredGrid");
    vtu.write(file);
    file.commit(execution);
}

}  // namespace tessera
