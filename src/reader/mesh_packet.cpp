#include "reader/mesh_packet.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>

#include "base/large_pages.h"
#include "base/parallel.h"

namespace tessera {

namespace {

constexpr std::uint64_t kMagic = 0x316873656d737354;  // "Tssmesh1"
constexpr std::int64_t kChunk = 1 << 16;
constexpr std::int64_t kMostElements = std::int64_t(1) << 30;

/// Stands at the start of every packet.
struct PacketStart {
    std::uint64_t magic = kMagic;
    std::uint64_t packetBytes = 0;
    std::uint64_t headBytes = 0;  ///< of the head that follows, a multiple of 8; the arrays stand behind it
};

/// Calls visit(member) for every number of the statistics, always in one order.
template <class Statistics, class Visit>
void visitNumbers(Statistics& s, const Visit& visit) {
    static_assert(sizeof(ImportStatistics) ==
                      sizeof(std::string) + (18 + kCellKinds) * 8 + sizeof(std::vector<std::string>),
                  "a new member of ImportStatistics needs its line below");
    for (auto& count : s.cellsOfKind) visit(count);
    visit(s.cells), visit(s.skippedCells), visit(s.blankedCells), visit(s.higherOrderCells);
    visit(s.blocks), visit(s.addedNodes), visit(s.nodes), visit(s.elements);
    visit(s.flat), visit(s.inverted), visit(s.duplicate), visit(s.coincidentNodes);
    visit(s.boundaryFaces), visit(s.nonConformingFaces);
    visit(s.smallestEdgeWorld), visit(s.largestEdgeWorld);
    visit(s.smallestVolumeWorld), visit(s.largestVolumeWorld);
}

class HeadWriter {
  public:
    template <class Number>
    void put(Number value) {
        static_assert(std::is_arithmetic_v<Number> && sizeof(Number) == 8);
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
    void put(const std::string& text) {
        put(std::uint64_t(text.size()));
        bytes_ += text;
        bytes_.append((8 - text.size() % 8) % 8, '\0');
    }
    const std::string& bytes() const { return bytes_; }

  private:
    std::string bytes_;
};

class HeadReader {
  public:
    explicit HeadReader(std::span<const std::byte> bytes) : rest_(bytes) {}

    template <class Number>
    Number get() {
        Number value{};
        std::memcpy(&value, take(sizeof value).data(), sizeof value);
        return value;
    }
    std::string getText() {
        const auto length = get<std::uint64_t>();
        if (length > rest_.size()) throw DamagedPacket("a text is longer than the head");
        const auto bytes = take((length + 7) / 8 * 8);
        return {reinterpret_cast<const char*>(bytes.data()), length};
    }
    std::int64_t getCount(std::int64_t most, const char* what) {
        const auto count = get<std::int64_t>();
        if (count < 0 || count > most) throw DamagedPacket("it has " + std::to_string(count) + " " + what);
        return count;
    }
    bool atEnd() const { return rest_.empty(); }

  private:
    std::span<const std::byte> take(std::size_t count) {
        if (count > rest_.size()) throw DamagedPacket("the head ends early");
        const auto bytes = rest_.first(count);
        rest_ = rest_.subspan(count);
        return bytes;
    }
    std::span<const std::byte> rest_;
};

std::string headOf(const MeshFile& file) {
    HeadWriter head;
    head.put(std::int64_t(file.mesh.nodeCount()));
    head.put(std::int64_t(file.mesh.elementCount()));
    head.put(std::int64_t(file.mesh.fields.size()));
    for (const Field& field : file.mesh.fields) {
        head.put(field.name);
        head.put(std::int64_t(field.location == FieldLocation::point ? 0 : 1));
        head.put(std::int64_t(field.components));
    }
    head.put(file.readPeakBytes);
    head.put(file.statistics.format);
    visitNumbers(file.statistics, [&](auto number) { head.put(number); });
    head.put(std::int64_t(file.statistics.warnings.size()));
    for (const std::string& warning : file.statistics.warnings) head.put(warning);
    return head.bytes();
}

/// Everything but the arrays, which stay empty.
MeshFile readHead(std::span<const std::byte> bytes, std::int64_t& nodes, std::int64_t& elements) {
    HeadReader head(bytes);
    MeshFile file;
    nodes = head.getCount(std::numeric_limits<std::int32_t>::max(), "nodes");
    elements = head.getCount(kMostElements, "elements");
    const std::int64_t fields = head.getCount(std::int64_t(bytes.size()), "fields");
    for (std::int64_t f = 0; f < fields; ++f) {
        Field& field = file.mesh.fields.emplace_back();
        field.name = head.getText();
        field.location =
            head.getCount(1, "as a field's place") == 0 ? FieldLocation::point : FieldLocation::cell;
        field.components = int(head.getCount(9, "components in a field"));
        if (field.components == 0) throw DamagedPacket("a field has no components");
    }
    file.readPeakBytes = head.getCount(std::int64_t(1) << 60, "bytes of memory");
    file.statistics.format = head.getText();
    visitNumbers(file.statistics,
                 [&](auto& number) { number = head.get<std::remove_reference_t<decltype(number)>>(); });
    const std::int64_t warnings = head.getCount(std::int64_t(bytes.size()), "warnings");
    for (std::int64_t w = 0; w < warnings; ++w) file.statistics.warnings.push_back(head.getText());
    if (!head.atEnd()) throw DamagedPacket("the head has more bytes than it needs");
    return file;
}

template <class Item>
void writeArray(std::vector<Item>& items, const PacketSink& sink) {
    static_assert(std::is_trivially_copyable_v<Item> && sizeof(Item) % 8 == 0);
    if (!items.empty()) sink(items.data(), items.size() * sizeof(Item));
    items = {};
}

/// Copies the next `count` items and shortens `rest` by them.
template <class Item>
std::vector<Item> readArray(std::span<const std::byte>& rest, std::int64_t count, const char* what) {
    if (std::uint64_t(count) > rest.size() / sizeof(Item))
        throw DamagedPacket(std::string("it ends inside its ") + what);
    const auto* first = reinterpret_cast<const Item*>(rest.data());
    rest = rest.subspan(std::size_t(count) * sizeof(Item));
    std::vector<Item> items;
    reserveLarge(items, std::size_t(count));
    items.assign(first, first + count);
    return items;
}

template <class IsSound>
void checkItems(std::int64_t count, const Execution& execution, const char* complaint,
                const IsSound& isSound) {
    parallelForChunks(execution, count, kChunk, [&](std::int64_t begin, std::int64_t end) {
        bool sound = true;
        for (std::int64_t i = begin; i < end; ++i) sound &= isSound(std::size_t(i));
        if (!sound) throw DamagedPacket(complaint);
    });
}

void checkArrays(const TetMesh& mesh, const Execution& execution) {
    const auto nodes = std::uint32_t(mesh.points.size());
    checkItems(mesh.elementCount(), execution, "a node index is out of range", [&](std::size_t e) {
        const auto& t = mesh.tets[e];
        return (std::uint32_t(t[0]) < nodes) & (std::uint32_t(t[1]) < nodes) & (std::uint32_t(t[2]) < nodes) &
               (std::uint32_t(t[3]) < nodes);
    });
    checkItems(mesh.nodeCount(), execution, "a coordinate isn't finite", [&](std::size_t n) {
        const Vec3d& p = mesh.points[n];
        return std::isfinite(p.x) & std::isfinite(p.y) & std::isfinite(p.z);
    });
}

}  // namespace

std::int64_t packetBytes(const MeshFile& file) {
    std::size_t bytes = sizeof(PacketStart) + headOf(file).size() + file.mesh.points.size() * sizeof(Vec3d) +
                        file.mesh.tets.size() * sizeof(file.mesh.tets[0]);
    for (const Field& field : file.mesh.fields) bytes += field.values.size() * sizeof(double);
    return std::int64_t(bytes);
}

void writePacket(MeshFile file, const PacketSink& sink) {
    try {
        checkMesh(file.mesh);
    } catch (const InputError& error) {
        throw InternalError(error.what());  // a reader's fault, not the file's
    }
    const std::string head = headOf(file);
    const PacketStart start{kMagic, std::uint64_t(packetBytes(file)), head.size()};
    sink(&start, sizeof start);
    sink(head.data(), head.size());
    writeArray(file.mesh.points, sink);
    writeArray(file.mesh.tets, sink);
    for (Field& field : file.mesh.fields) writeArray(field.values, sink);
}

MeshFile readPacket(std::span<const std::byte> packet, const Execution& execution) {
    PacketStart start;
    if (packet.size() < sizeof start) throw DamagedPacket("it is too short");
    std::memcpy(&start, packet.data(), sizeof start);
    if (start.magic != kMagic) throw DamagedPacket("it doesn't begin as a mesh does");
    if (start.packetBytes != packet.size())
        throw DamagedPacket("it has " + std::to_string(packet.size()) + " bytes, not the " +
                            std::to_string(start.packetBytes) + " that it declares");
    std::span<const std::byte> rest = packet.subspan(sizeof start);
    if (start.headBytes > rest.size() || start.headBytes % 8 != 0)
        throw DamagedPacket("its head has no such size");
    std::int64_t nodes = 0, elements = 0;
    MeshFile file = readHead(rest.first(start.headBytes), nodes, elements);
    rest = rest.subspan(start.headBytes);
    file.mesh.points = readArray<Vec3d>(rest, nodes, "nodes");
    file.mesh.tets = readArray<std::array<std::int32_t, 4>>(rest, elements, "elements");
    for (Field& field : file.mesh.fields)
        field.values = readArray<double>(
            rest, (field.location == FieldLocation::point ? nodes : elements) * field.components, "fields");
    if (!rest.empty()) throw DamagedPacket("bytes are left over");
    checkArrays(file.mesh, execution);
    return file;
}

}  // namespace tessera
