// Input: bytes that choose cells of every kind, degenerate ones too, as a reader hands them on: blocks,
// merging, splitting and statistics.

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string_view>

#include "fuzz_tools.h"
#include "mesh_files/assemble_mesh.h"
#include "mesh_files/raw_mesh.h"

namespace tessera {
namespace {

constexpr double kLargest = std::numeric_limits<double>::max();
constexpr std::array<double, 32> kCoordinates{
    0,     1,     2,      3,      0.5,      -1,       1.0 / 3,     0.1,
    1e-9,  1e9,   1e12,   1e-30,  1e30,     1e100,    -1e100,      1e150,
    1e200, 1e300, 1e-300, 5e-324, 2.3e-308, kLargest, -kLargest,   kLargest / 2,
    -0.0,  1e15,  1e16,   0.25,   0.75,     4,        1 + 0x1p-52, 1 - 0x1p-53};

constexpr std::array<std::int64_t, 16> kNodeIds{0, 1, 2,  3,  4,  5,   6,  7,
                                                8, 9, 10, 11, 12, 100, -1, std::int64_t(1) << 40};

/// Takes bytes from the front; zeros when there are none left.
class Bytes {
  public:
    explicit Bytes(std::string_view rest) : rest_(rest) {}
    bool empty() const { return rest_.empty(); }
    int next(int count) {
        if (rest_.empty()) return 0;
        const int byte = static_cast<unsigned char>(rest_.front());
        rest_.remove_prefix(1);
        return byte % count;
    }
    double coordinate() {
        const int byte = next(256);
        if (byte < 224) return kCoordinates[std::size_t(byte % 32)];
        double value = 0;
        const std::size_t count = std::min(rest_.size(), sizeof value);
        std::memcpy(&value, rest_.data(), count);
        rest_.remove_prefix(count);
        return value;
    }

  private:
    std::string_view rest_;
};

void addCell(Bytes& bytes, int points, CellList& cells) {
    const auto kind = CellKind(bytes.next(6));
    std::vector<std::int32_t> nodes;
    if (kind == CellKind::polyhedron) {
        const int faces = bytes.next(9);
        nodes.push_back(faces);
        for (int f = 0; f < faces; ++f) {
            const int count = bytes.next(8);
            nodes.push_back(count);
            for (int i = 0; i < count; ++i) nodes.push_back(bytes.next(points));
        }
    } else {
        for (int i = 0; i < nodeCountOf(kind); ++i) nodes.push_back(bytes.next(points));
    }
    cells.add(kind, nodes.data(), std::int64_t(nodes.size()));
}

RawBlock makeBlock(Bytes& bytes) {
    RawBlock block;
    const int points = 4 + bytes.next(20);
    for (int p = 0; p < points; ++p) {
        const double x = bytes.coordinate(), y = bytes.coordinate();
        block.points.push_back({x, y, bytes.coordinate()});
    }
    const int cells = 1 + bytes.next(12);
    for (int c = 0; c < cells; ++c) addCell(bytes, points, block.cells);
    block.sourceCells = cells;
    Field atPoints{"f", FieldLocation::point, 1, {}}, inCells{"f", FieldLocation::cell, 2, {}};
    for (int p = 0; p < points; ++p) atPoints.values.push_back(bytes.coordinate());
    for (int c = 0; c < 2 * cells; ++c) inCells.values.push_back(c);
    for (Field* field : {&atPoints, &inCells}) {
        block.arrays.push_back({field->name, field->location, field->components, true});
        block.fields.push_back(std::move(*field));
    }
    if (bytes.next(4) == 1)
        for (int p = 0; p < points; ++p) block.nodeIds.push_back(kNodeIds[std::size_t(bytes.next(16))]);
    return block;
}

void run(std::string_view input) {
    Bytes bytes(input);
    RawMesh raw;
    raw.statistics.format = "fuzz";
    const int blocks = 1 + bytes.next(3);
    for (int b = 0; b < blocks && !bytes.empty(); ++b) raw.blocks.push_back(makeBlock(bytes));
    fuzz::checkAssembled(assembleMesh("fuzz", raw, {}, fuzz::oneThread()));
    // The same as parts of a mesh, each a file.
    ReadOptions options;
    for (std::size_t b = 1; b < raw.blocks.size(); ++b) {
        raw.blocks[b].part = b;
        options.otherParts.push_back("part");
    }
    fuzz::checkAssembled(assembleMesh("fuzz", std::move(raw), options, fuzz::oneThread()));
}

}  // namespace
}  // namespace tessera

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    tessera::fuzz::expectInputErrorsOnly([&] { tessera::run({reinterpret_cast<const char*>(data), size}); });
    return 0;
}
